"""What the robot's physical effects ask of the controller, found by their hooks alone."""

from __future__ import annotations

from collections.abc import Sequence

from wbc.arrays import FloatArray
from wbc.robot import Effect, Hook, Motion, Robot


class EffectTorques:
    """Calls the hooks that the robot's effects override, and no others.

    Structural effects are already folded into the robot and cost nothing here.
    """

    def __init__(self, robot: Robot) -> None:
        """Sort the effects by hook."""
        self._robot = robot
        self._smooth = _overriding(robot.effects, "joint_torque")
        self._dry = _overriding(robot.effects, "joint_friction")
        self._rotor = _overriding(robot.effects, "rotor_torque")
        self._gears = _overriding(robot.effects, "gear_efficiencies")
        self._drive = tuple(reversed(_overriding(robot.effects, "drive_inverse")))
        self._truth = tuple(reversed(_overriding(robot.effects, "true")))

    @property
    def act_on_joints(self) -> bool:
        """Whether any effect puts torque on the coordinates."""
        return bool(self._smooth or self._dry)

    @property
    def act_on_rotors(self) -> bool:
        """Whether any effect adds torque on the rotors."""
        return bool(self._rotor)

    @property
    def act_on_gears(self) -> bool:
        """Whether the efficiencies of any gear depend on the motion."""
        return bool(self._gears)

    @property
    def act_within_ticks(self) -> bool:
        """Whether any effect has to be asked between a state and the drive commands."""
        joints_or_gears = self.act_on_joints or self.act_on_gears
        return joints_or_gears or self.act_on_rotors or self.act_on_drives

    @property
    def act_on_drives(self) -> bool:
        """Whether any effect stands between the torque on the rotors and the drive command."""
        return bool(self._rotor or self._drive)

    def true_motion(self, motion: Motion) -> Motion:
        """Return the motion behind what the encoders report."""
        for effect in self._truth:
            motion = effect.true(self._robot, motion)
        return motion

    def on_joints(self, motion: Motion, certainty: FloatArray) -> FloatArray | None:
        """Return the torque of the effects on the coordinates (nv,), None without such effects.

        Dry friction acts against the direction that `certainty` (nv,), -1 to 1, gives it.
        """
        total: FloatArray | None = None
        for effect in self._smooth:
            torque = effect.joint_torque(self._robot, motion)
            if torque is not None:
                total = torque if total is None else total + torque
        for effect in self._dry:
            level = effect.joint_friction(self._robot, motion)
            if level is not None:
                total = -level * certainty if total is None else total - level * certainty
        return total

    def on_rotors(self, motion: Motion) -> FloatArray | None:
        """Return the torque that effects add on the rotors (m,), None without such effects."""
        total: FloatArray | None = None
        for effect in self._rotor:
            torque = effect.rotor_torque(self._robot, motion)
            if torque is not None:
                total = torque if total is None else total + torque
        return total

    def to_drive(self, motion: Motion, torque: FloatArray) -> FloatArray:
        """Return what to command so that the drives deliver `torque` (m,)."""
        for effect in self._drive:
            torque = effect.drive_inverse(self._robot, motion, torque)
        return torque


def _overriding(effects: Sequence[Effect], hook: Hook) -> tuple[Effect, ...]:
    return tuple(effect for effect in effects if hook in effect.acts_by)
