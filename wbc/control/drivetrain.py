"""What is between the joints and the drives: gears, motors, effects."""

from __future__ import annotations

from typing import Any

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.control.kinematics import Kinematics
from wbc.control.memory import GEARS
from wbc.control.rows.limits import RotorTorqueLimit
from wbc.control.settings import ControllerSettings, RestPolicy
from wbc.dynamics.equation import rotor_coupling
from wbc.effects import tables
from wbc.robot import Motion, Robot


class GearModel:
    """Gears, motors and effects of a robot in one structure, kept up to date tick by tick.

    K' E_s H_s K qdd + K' E_s c_s = J'f + [0; B E_m] tau_phi holds row by row as

        undriven:  (M qdd + bias - J'f)_u = 0                       (the same in every direction)
        driven:    T = D' (M qdd + bias - J'f)_m                    (torque that leaves the gears)
        rotors:    N tau_phi = t(T) + rotor qdd + rotor_bias        (t: the mesh law)

    so that the directions of power enter in t alone. M is H_l, plus what a rotor's spin asks of
    its housing where the robot couples the two. Effects that no table holds are asked by their
    hooks; structural effects are folded into the robot already.

    Attributes:
        memory: the GEARS.
        size: how many gears there are.
        limited: numbers of the gears that have a torque limit to keep.
        coupled: whether rotors turn with links, so that a state takes more than its kinematics.
        learns: whether an observer learns what the model misses.
        differs: whether hooks of effects stand between the torque on the rotors and the command.
    """

    def __init__(
        self,
        robot: Robot,
        kinematics: Kinematics,
        settings: ControllerSettings,
        limit: RotorTorqueLimit | None,
    ) -> None:
        """Lay everything out.

        Raises:
            ControlError: a bound of the observer of another size than nv.
        """
        gears, nv = robot.transmission, robot.model.nv
        blend, observer = settings.speed_blend, settings.disturbance
        self.robot, self.size, self._settings = robot, gears.size, settings
        self._ratio, self._kinematics = gears.gear_ratio, kinematics
        self.coupled = robot.rotors_turn_with_links
        bounded = np.isfinite(gears.torque_limit) & (limit is not None)
        self.limited: IntArray = np.flatnonzero(bounded)
        self._table, self._effects = tables.effect_table(robot), tables.left_for_hooks(robot)
        asked = frozenset[str]().union(*[effect.acts_by for effect in self._effects])
        self.differs = bool(asked & {"rotor_torque", "drive_inverse"})
        self._pushed = bool(asked & {"joint_torque", "joint_friction", "rotor_torque"})
        self._gears_act = bool(self._table.gears[:, tables.COEFFICIENT].any())
        varies = limit is not None and (limit.knee is not None or "rotor_torque" in asked)
        self._varying = limit if varies else None
        self._contacts: object = None
        self._rotor_own = gears.reflected_inertia[:, None] * robot.motor_rows
        rate = 0.0 if observer is None else observer.rate
        self.learns = rate > 0.0
        self.memory: Any = GEARS.of(
            {"m": gears.size, "v": nv},
            driven=np.array(robot.actuated, dtype=np.int_),
            from_joints=np.array(gears.motor_from_joint),
            topology=np.array(gears.topology),
            inverse_ratio=1.0 / gears.gear_ratio,
            mass=np.zeros((nv, nv)) if self.coupled else kinematics.mass_matrix,
            rotor=self._rotor_own.copy(),
            dry=np.abs(self._ratio) * gears.rotor_coulomb_friction,
            viscous=self._ratio**2 * gears.rotor_viscous_friction,
            lower=np.full(gears.size, -np.inf),
            upper=np.full(gears.size, np.inf),
            laws=self._table.joints,
            numbers=self._table.numbers,
            drives=self._table.drives,
            predicted=np.full(nv, np.nan),
            bound=np.zeros(nv) if observer is None else observer.bounds(nv),
            inertia=robot.motor_rows.T @ self._rotor_own,
            blend=np.array([blend.trusted_error, blend.full_speed, blend.correction, rate]),
        )
        self._take_efficiencies(gears.forward_efficiency, gears.backward_efficiency)
        if limit is not None:
            self._take_limits(*limit.bounds(robot, np.zeros(gears.size)))

    def true_motion(self, motion: Motion) -> Motion:
        """Return the motion behind what the encoders report."""
        for effect in reversed(self._effects):
            motion = effect.true(self.robot, motion)
        return motion

    def take(self, motion: Motion, contacts: object) -> None:
        """Take what effects, limits and the observer say of a state.

        Args:
            motion: the state; the kinematics stand at it where `coupled`.
            contacts: the active contacts, to be told from those of the last tick.
        """
        memory, added = self.memory, None
        if self._pushed or self.coupled:
            memory.effects[:], memory.rubbing[:], added = self._exerted(motion)
        if self._gears_act:
            gears, now = self.robot.transmission, np.empty((2, self.size))
            given = gears.forward_efficiency, gears.backward_efficiency
            tables.fill_efficiencies(self._table.gears, self.speed(motion.velocity), *given, *now)
            self._take_efficiencies(*now)
        if self._varying is not None:
            speed = self._ratio * self.speed(motion.velocity)
            self._take_limits(*self._varying.bounds(self.robot, speed), added)
        if self.coupled:  # what rotors and their housings ask of one another
            state = self._kinematics
            inertia, on_links, on_rotors = rotor_coupling(self.robot, state.velocity, state.data)
            turns = self._ratio[:, None] * self.robot.motor_rows
            np.add(state.mass_matrix, inertia.T @ turns, out=memory.mass)
            np.add(self._rotor_own, self._ratio[:, None] * inertia, out=memory.rotor)
            np.multiply(self._ratio, on_rotors, out=memory.rotor_added)
            memory.effects[:] -= on_links
        if self.learns and contacts != self._contacts:
            self.interrupt()

    def _exerted(self, motion: Motion) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return what hooks say: torque, level of dry friction (nv,), torque on rotors (m,)."""
        nv = len(self.memory.bias)
        totals = np.zeros(nv), np.zeros(nv), np.zeros(self.size)
        for effect in self._effects:
            tables.add_torques(self.robot, effect, motion, totals)
        return totals

    def _take_efficiencies(self, forward: FloatArray, backward: FloatArray) -> None:
        """Write the slopes of the mesh law t(T) from efficiencies (m,).

        With sigma in [-1, 1] how surely a gear turns and which way, t = T/eta_f where T sigma > 0
        and eta_b T where T sigma < 0, at sigma = +-1; in between it is blended with what the policy
        prefers at rest. Every blend of the three lies inside the interval that holds T at rest.
        """
        memory, policy = self.memory, self._settings.rest_policy
        memory.forward[:], memory.backward[:] = 1.0 / forward, backward
        low = np.minimum(memory.forward, memory.backward)
        high = np.maximum(memory.forward, memory.backward)
        ends = {RestPolicy.NEUTRAL: 1.0, RestPolicy.LEAST_TORQUE: 0.0}
        preferred = ends.get(policy, 0.5 * (low + high))  # else MOST_MARGIN
        free = self._settings.rest_margin * (high - low)
        memory.rest[:] = np.clip(preferred, low + free, high - free)

    def on_joints(self, motion: Motion) -> FloatArray:
        """Return the torque of effects on the coordinates (nv,), dry friction left out."""
        state = np.ascontiguousarray(motion.position), np.ascontiguousarray(motion.velocity)
        smooth, dry = np.empty_like(self.memory.bias), np.empty_like(self.memory.bias)
        tables.fill_torques(self._table.joints, self._table.numbers, *state, smooth, dry)
        return np.asarray(smooth + self._exerted(motion)[0] if self._pushed else smooth)

    def _take_limits(
        self, low: FloatArray, high: FloatArray, more: FloatArray | None = None
    ) -> None:
        """Take the least and greatest torque of the drives (m,) [N m], and what is added to it."""
        added = self._table.drives[:, 2] if more is None else self._table.drives[:, 2] + more
        one, other = self._ratio * (low + added), self._ratio * (high + added)
        np.minimum(one, other, out=self.memory.lower)
        np.maximum(one, other, out=self.memory.upper)

    def remember(self, velocity: FloatArray, contacts: object) -> None:
        """Take the velocity (nv,) that a tick with a solution leads to; learn from it next time."""
        self.memory.learned[:], self.memory.predicted[:] = self.memory.disturbance, velocity
        self._contacts = contacts

    def interrupt(self) -> None:
        """Predict nothing of the next tick, as the last one had no solution."""
        self.memory.predicted[:] = np.nan

    def forget(self) -> None:
        """Forget what was learned."""
        self.memory.learned[:], self.memory.disturbance[:] = 0.0, 0.0
        self.interrupt()

    def speed(self, velocity: FloatArray) -> FloatArray:
        """Return dpsi (m,) [rad/s] of v (nv,)."""
        return np.asarray(self.memory.from_joints @ velocity[self.memory.driven])

    def to_drive(self, motion: Motion, torque: FloatArray) -> FloatArray:
        """Return the drive command (m,) that puts N tau_phi = `torque` on the rotors."""
        rotor = torque * self.memory.inverse_ratio
        if self.differs:
            rotor -= self._exerted(motion)[2]
        tables.fill_commands(self._table.drives, rotor, rotor)
        for effect in reversed(self._effects):
            rotor = effect.drive_inverse(self.robot, motion, rotor)
        return np.asarray(rotor)
