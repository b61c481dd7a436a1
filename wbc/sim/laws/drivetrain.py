"""The constant part of a robot's dissipative rows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray, frozen
from wbc.robot import Robot
from wbc.transmission import Flanks


@dataclass(frozen=True, eq=False)
class Drivetrain:
    """Gears of a robot as rows; all quantities at the motor outputs psi.

    Attributes:
        rows: D^-1 on the driven columns (m, nv), psi_dot = rows @ v.
        ratio: N (m,).
        inertia: N^2 I_r (m,) [kg m^2].
        viscous: N^2 times the rotor's viscous friction (m,).
        coulomb: |N| times the rotor's Coulomb friction (m,).
        forward, backward: eta_f, eta_b (m,).
        stiffness: (m,) [N m/rad], infinite where rigid.
        damping: (m,) beside it.
        play: (m,) [rad] backlash.
        springs: the gears that are compliant, each with its number.
        loose: (m,) whether the motor's output may leave the joint (stiffness or play).
        any_loose: whether any of them may.
        hard_play: (m,) whether it may within play, whose flanks are rigid.
        rubs: whether any rotor has friction.
        direct: whether each gear turns its joint alone and rigidly, so that joint friction and
            gear share a row.
        shares: (m,) whether a gear can; a self-locking one cannot: the set of impulses that it
            holds at rest has a hole, which friction beside it fills.
        actuated: (m,) rows of v.
        every: (m,) 0 .. m - 1.
        zero: (m,) zeros.
        firm: (m,) infinities, the stiffness of rows without springs.
    """

    rows: FloatArray
    ratio: FloatArray
    inertia: FloatArray
    viscous: FloatArray
    coulomb: FloatArray
    forward: FloatArray
    backward: FloatArray
    stiffness: FloatArray
    damping: FloatArray
    play: FloatArray
    springs: tuple[tuple[int, Flanks], ...]
    loose: BoolArray
    any_loose: bool
    hard_play: BoolArray
    rubs: bool
    direct: bool
    shares: BoolArray
    actuated: IntArray
    every: IntArray
    zero: FloatArray
    firm: FloatArray

    @property
    def size(self) -> int:
        """m, the number of gears."""
        return len(self.ratio)

    def spring_energy(self, deflection: FloatArray) -> float:
        """Return the energy stored in the compliant gears at deflections (m,) [J]."""
        return float(sum(flanks.energy(deflection[i]) for i, flanks in self.springs))


def drivetrain(robot: Robot) -> Drivetrain:
    """Return the constant part of the rows of `robot`."""
    gears = robot.transmission
    rows = np.zeros((gears.size, robot.model.nv))
    rows[:, robot.actuated] = gears.motor_from_joint
    # What these lose is up to their effects, which carry a state.
    kept = np.ones(gears.size, dtype=bool)
    kept[[gears.index(e.where) for e in robot.effects if "meshed" in e.acts_by]] = False
    forward, backward = (
        frozen(np.where(kept, eta, 1.0))
        for eta in (gears.forward_efficiency, gears.backward_efficiency)
    )
    loose = np.isfinite(gears.stiffness) | (gears.backlash > 0.0)
    return Drivetrain(
        rows=frozen(rows),
        ratio=gears.gear_ratio,
        inertia=frozen(gears.reflected_inertia),
        viscous=frozen(gears.gear_ratio**2 * gears.rotor_viscous_friction),
        coulomb=frozen(np.abs(gears.gear_ratio) * gears.rotor_coulomb_friction),
        forward=forward,
        backward=backward,
        stiffness=gears.stiffness,
        damping=gears.damping,
        play=gears.backlash,
        springs=tuple(
            (i, gears.flanks(joint))
            for i, joint in enumerate(gears.joints)
            if np.isfinite(gears.stiffness[i])
        ),
        loose=frozen(loose, np.bool_),
        any_loose=bool(loose.any()),
        hard_play=frozen(loose & ~np.isfinite(gears.stiffness), np.bool_),
        rubs=bool(gears.rotor_coulomb_friction.any() or gears.rotor_viscous_friction.any()),
        direct=bool(np.array_equal(gears.topology, np.eye(gears.size)) and not loose.any()),
        shares=frozen(backward >= 0.0, np.bool_),
        actuated=robot.actuated,
        every=frozen(np.arange(gears.size), np.int_),
        zero=frozen(np.zeros(gears.size)),
        firm=frozen(np.full(gears.size, np.inf)),
    )
