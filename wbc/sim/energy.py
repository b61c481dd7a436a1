"""Where the energy of a step went: work, losses, and what is stored."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from wbc.arrays import FloatArray
from wbc.compiled import Count, Number, Row, compiled, several
from wbc.mechanics.inertia import bodies_at, momentum_of
from wbc.mechanics.kinematics import columns_at, place
from wbc.sim.setup import Setup
from wbc.sim.state import SimState
from wbc.sim.step.books import spring_energy
from wbc.sim.step.compliant import stored_at
from wbc.sim.step.contacts import solid_gap, touch_ground
from wbc.sim.step.field import AHEAD
from wbc.sim.step.gears import motor_speeds
from wbc.sim.step.tables import (
    DEFLECTION,
    HERTZ,
    INERTIA,
    OPENED,
    REACH,
    STIFFNESS,
    Opened,
    point_of_reference,
)


@dataclass(frozen=True, slots=True)
class EnergyFlow:
    """Work in and losses out over some time, each in joule.

    Motor and external work are exact for the impulses and displacements of the step; each loss is
    impulse times the speed at the end of the step, which makes it non-negative, and differs from
    the exact one by O(h^2) per step. That, and the weight that is lifted where an overlap is
    taken back, is the audit's residual.

    Attributes:
        motor: work of the rotor torques.
        external: work of external forces given to the step.
        effects: work of the robot's effects that are no friction (springs, drag, ripple).
        ground: work of ground that moves, impacts included.
        reloaded: what bent bristles gained because the load on them changed.
        bent: change of what bristles hold (presliding).
        mesh: lost in the meshes.
        rotor_friction: lost in rotor bearings and motors.
        gear_damping: lost between mesh and joint, where gears are compliant or have play.
        joint_friction: lost in joint friction.
        bristles: lost in friction that builds up (presliding).
        contact: lost in sliding contacts, and where one closes without an impact.
        impact_mesh: lost in the meshes during impacts.
        impact: lost in contacts and joint limits during impacts.
    """

    motor: float = 0.0
    external: float = 0.0
    effects: float = 0.0
    ground: float = 0.0
    reloaded: float = 0.0
    bent: float = 0.0
    mesh: float = 0.0
    rotor_friction: float = 0.0
    gear_damping: float = 0.0
    joint_friction: float = 0.0
    bristles: float = 0.0
    contact: float = 0.0
    impact_mesh: float = 0.0
    impact: float = 0.0

    def __add__(self, other: EnergyFlow) -> EnergyFlow:
        """Return the sum of two flows."""
        return EnergyFlow(*[getattr(self, name) + getattr(other, name) for name in _NAMES])

    @property
    def work(self) -> float:
        """All work done on the robot, and on what is bent in it."""
        return self.motor + self.external + self.effects + self.ground + self.reloaded

    @property
    def losses(self) -> dict[str, float]:
        """Every loss by its cause."""
        return {name: float(getattr(self, name)) for name in _LOSSES}

    @property
    def lost(self) -> float:
        """Sum of all losses."""
        return sum(self.losses.values())


_NAMES = tuple(field.name for field in fields(EnergyFlow))
_LOSSES = _NAMES[_NAMES.index("mesh") :]


@dataclass(frozen=True, slots=True)
class EnergyAudit:
    """Work in = change of mechanical energy + losses + residual.

    Attributes:
        flow: work and losses of the run.
        stored: change of kinetic plus potential energy of links, rotors and gear springs [J].
        joule_heat: of the windings, R (tau / k_t)^2 over time [J]; NaN where a motor's constants
            are unknown. It comes from the supply beside the motors' work and is no part of the
            balance above.
    """

    flow: EnergyFlow
    stored: float
    joule_heat: float = np.nan

    @property
    def residual(self) -> float:
        """What the books do not close by [J]; O(dt) by the order of the time step."""
        return self.flow.work - self.stored - self.flow.bent - self.flow.lost

    @property
    def electric(self) -> float:
        """What the supply gives, less what it gets back: motor work plus Joule heat [J]."""
        return self.flow.motor + self.joule_heat

    def __str__(self) -> str:
        """Return the books as a table."""
        rows = [
            ("motor work", self.flow.motor),
            ("external work", self.flow.external),
            ("work of effects", self.flow.effects),
            *([("work of the ground", self.flow.ground)] if self.flow.ground else []),
            ("stored", self.stored),
            *_bristles(self.flow),
            *((f"lost: {name.replace('_', ' ')}", v) for name, v in self.flow.losses.items()),
            ("residual", self.residual),
        ]
        if np.isfinite(self.joule_heat):
            rows.append(("beside: Joule heat", self.joule_heat))
        return "\n".join(f"{name:24s}{value:14.6f} J" for name, value in rows)


def _bristles(flow: EnergyFlow) -> list[tuple[str, float]]:
    """Return the lines of the store of bristles, none where nothing bent."""
    if flow.bent == flow.reloaded == 0.0:
        return []
    return [("stored in bristles", flow.bent), ("bristles loaded anew", flow.reloaded)]


@compiled(several(Number, Number, Count), OPENED, Row, Row, Number)
def survey(plant: Opened, q: FloatArray, v: FloatArray, time: float) -> tuple[float, float, int]:
    """Return what a plant stores at q (nq,), v (nv,), time [J]; the deepest body, and its gap.

    Stored are the kinetic energy of links and rotors, gravity's, and that of springs in gears and
    compliant contacts. The gap is
    that of the origin of the joint that carries a body, from the nearest solid that loops know.
    """
    tree, placed, gears = plant.tree, plant.placed, plant.gears
    joints, poses, solids, m = tree.joints, placed.poses, plant.obstacles.solids, len(gears.rows)
    place(joints, tree.shapes, q, poses)
    about = point_of_reference(plant.flight.bases, poses)
    columns_at(joints, tree.shapes, poses, about, placed.columns)
    bodies_at(joints, tree.shapes, poses, about, placed.bodies)
    count, energy, deepest, lowest = len(joints), 0.0, np.inf, -1
    motion, momentum, motor, normal = np.zeros((count, 6)), np.empty(6), np.empty(m), np.empty(3)
    for i in range(count):
        first, body = joints[i, 3], placed.bodies[i]
        last = joints[i + 1, 3] if i + 1 < count else len(v)
        for k in range(6):
            motion[i, k] = motion[joints[i, 0], k] if joints[i, 0] >= 0 else 0.0
            for row in range(first, last):
                motion[i, k] += placed.columns[row, k] * v[row]
        momentum_of(body, motion[i], momentum)
        for k in range(6):
            energy += 0.5 * momentum[k] * motion[i, k]
        for k in range(3):
            energy -= tree.gravity[k] * (body[1 + k] + body[0] * about[k])
        gap = np.inf
        for s in range(len(solids)):
            gap = min(gap, solid_gap(solids[s], poses[i, 9:], normal))
        if body[0] > 0.0 and gap < deepest:
            deepest, lowest = gap, i
    motor_speeds(gears, v, motor)
    for g in range(m):
        energy += 0.5 * gears.numbers[g, INERTIA] * motor[g] * motor[g]
        if gears.numbers[g, STIFFNESS] < np.inf:
            energy += spring_energy(gears.numbers[g], gears.motion[g, DEFLECTION])
        if len(gears.coupling):
            for c in range(len(v)):
                energy += motor[g] * gears.coupling[g, c] * v[c]
    if plant.bounds[HERTZ] > 0.0:
        plant.bounds[REACH] = AHEAD
        touch_ground(plant, time, np.zeros(0, dtype=np.bool_))
        plant.obstacles.stands[:] = np.nan
        for b in range(len(plant.obstacles.touch)):
            energy += stored_at(plant.bounds[HERTZ], -plant.obstacles.touch[b, 0])
    return energy, deepest, lowest


def surveyed(setup: Setup, state: SimState) -> tuple[float, float, int]:
    """Return what `survey` finds in a state."""
    setup.tell_coupling(state.position, state.velocity)
    setup.core.tell_motion(state)
    q, v = np.ascontiguousarray(state.position), np.ascontiguousarray(state.velocity)
    found: tuple[float, float, int] = survey(setup.core.plant, q, v, state.time)
    return found
