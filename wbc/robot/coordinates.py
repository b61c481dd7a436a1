"""Coordinates of a robot: their axes and units, and states and torques in other joint orders."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.arrays import FloatArray, IntArray, frozen
from wbc.errors import RobotError
from wbc.robot.effect import Motion
from wbc.robot.robot import Robot


def joint_axis(robot: Robot, joint: str) -> FloatArray:
    """Return the axis (3,) of a joint with one degree of freedom, in the joint's frame."""
    return np.asarray(np.sum(_unit_twist(robot, joint), axis=0))  # one of the two is zero


def slides(robot: Robot, joint: str) -> bool:
    """Return whether a joint with one degree of freedom is prismatic."""
    return bool(np.linalg.norm(_unit_twist(robot, joint)[1]) < 0.5)


def unit_at(robot: Robot, where: str, unit: str) -> str:
    """Return the unit of a number of an effect at a place.

    The units of effects are those of joints that turn. At a joint that slides a torque is a force,
    an angle a length and an inertia a mass.

    Args:
        robot: that has the effect.
        where: its joint or body.
        unit: of its parameter.
    """
    if where not in robot.single_joints or not slides(robot, where):
        return unit
    return unit.replace("kg m^2", "kg").replace("N m", "N").replace("rad", "m")


def output_units(robot: Robot) -> tuple[str, ...]:
    """Return the unit of every output of a residual: driven joints, then the other coordinates."""
    sliding = [robot.velocity_index(name) for name in robot.single_joints if slides(robot, name)]
    sliding += [first + k for _, first in robot.free_flyers.values() for k in range(3)]
    rows = (*robot.actuated.tolist(), *robot.unactuated.tolist())
    return tuple("N" if row in sliding else "N m" for row in rows)


def _unit_twist(robot: Robot, joint: str) -> tuple[FloatArray, FloatArray]:
    own = robot.model.createData().joints[robot.model.getJointId(joint)]
    motion = np.asarray(own.S).reshape(6, -1)[:, 0]
    return motion[:3], motion[3:]


@final
@dataclass(frozen=True, eq=False)
class JointMap:
    """Turns values of joints in an order of their own into states of a robot, and torques back.

    Make it with `of`. The foreign software may know more joints than the robot (grippers that are
    locked here); those are left out on the way in and get zero on the way out.

    Attributes:
        robot: the robot.
        names: joints of the foreign software, in its order.
        places: where among them the robot's one-degree joints stand (j,).
        positions, velocities: their rows of q and v (j,).
    """

    robot: Robot
    names: tuple[str, ...]
    places: IntArray
    positions: IntArray
    velocities: IntArray

    @classmethod
    def of(cls, robot: Robot, names: Sequence[str]) -> JointMap:
        """Return the map of one-degree joints, by names in any order, as in a ROS `JointState`.

        Raises:
            RobotError: a joint of the robot is missing among them, or stands there twice.
        """
        known, own = tuple(names), robot.single_joints
        for joint in own:
            if joint not in known:
                raise RobotError(
                    f"joint '{joint}' of '{robot.name}' is missing among the names: "
                    f"{', '.join(known) or '(none)'}. Weld it with `lock` in robot.toml if "
                    "nothing moves it."
                )
            if known.count(joint) > 1:
                raise RobotError(f"joint '{joint}' stands {known.count(joint)} times in the names.")
        finders = known.index, robot.position_index, robot.velocity_index
        rows = (frozen([find(joint) for joint in own], np.int_) for find in finders)
        return cls(robot, known, *rows)

    def motion(
        self, position: ArrayLike, velocity: ArrayLike, base: BaseState | None = None
    ) -> Motion:
        """Return the state behind joint positions and velocities in the foreign order.

        Args:
            position, velocity: of all foreign joints [rad, rad/s]. Of a MuJoCo model with a free
                joint first these are `qpos[7:]` and `qvel[6:]`.
            base: of a free-flyer; the neutral pose at rest when left out.

        Raises:
            RobotError: a base of a robot without a free-flyer.
        """
        robot = self.robot
        given, rates = np.asarray(position, dtype=np.float64), np.asarray(velocity, np.float64)
        q, v = robot.neutral(), np.zeros(robot.model.nv)
        q[self.positions], v[self.velocities] = given[self.places], rates[self.places]
        if base is not None:
            if not robot.has_free_flyer:
                raise RobotError(f"'{robot.name}' has no free base; leave its state out.")
            q[:7], v[:6] = base.position, base.velocity
        return Motion(q, v)

    def torques(self, rotor_torque: ArrayLike) -> FloatArray:
        """Return joint torques in the foreign order, N tau_phi behind D, zero for other joints.

        For a plant whose joints are driven without gears, which do not lose anything; rotors that
        the plant does not have must be subtracted by the caller.

        Args:
            rotor_torque: tau_phi (m,) [N m], as `Command.rotor_torque`.
        """
        on_joints, result = np.zeros(self.robot.model.nv), np.zeros(len(self.names))
        distribution = self.robot.transmission.distribution
        on_joints[self.robot.actuated] = distribution @ np.asarray(rotor_torque, dtype=np.float64)
        result[self.places] = on_joints[self.velocities]
        return result


@final
@dataclass(frozen=True, eq=False)
class BaseState:
    """The state of a free-flyer as pinocchio has it.

    Attributes:
        position: (7,) place [m] and quaternion x, y, z, w.
        velocity: (6,) linear over angular, in the base's own axes [m/s, rad/s].
    """

    position: FloatArray
    velocity: FloatArray

    @classmethod
    def of(
        cls, place: ArrayLike, quaternion: ArrayLike, linear: ArrayLike, angular: ArrayLike
    ) -> BaseState:
        """Return the state from what estimators and simulators report.

        Args:
            place: (3,) [m] in the world.
            quaternion: (4,) x, y, z, w; it is brought to length one.
            linear: (3,) [m/s] in the world.
            angular: (3,) [rad/s] in the base's axes.

        Raises:
            RobotError: a quaternion of no length.
        """
        turn = np.array(quaternion, dtype=np.float64)
        length = float(np.linalg.norm(turn))
        if not length > 0.0:
            raise RobotError("the quaternion of the base has no length.")
        turn /= length
        rotation = pin.Quaternion(*np.roll(turn, 1)).toRotationMatrix()
        own = rotation.T @ np.asarray(linear, dtype=np.float64)
        return cls(np.concatenate([place, turn]), np.concatenate([own, angular]))
