"""A robot in MuJoCo with lossy gears: the losses are an external torque of this file's own.

MuJoCo knows links, rotors (as armature) and soft contacts, but no direction of power. Per gear, the
torque that enters the mesh is what the motor gives beyond the rotor's own inertia, and the teeth
keep a share of it from the joint: t (1 - eta_f) where the motor drives, |t| (1/eta_b - 1) where the
joint does. Nothing here is shared with `wbc.sim`, which solves the gears as part of its time step.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from benchmarks.mujoco_model import mujoco_model
from wbc import Robot
from wbc.arrays import FloatArray
from wbc.robot import Motion

_CREEP = 0.01  # [rad/s] under which the loss is viscous, so that a gear at rest creeps


class MujocoPlant:
    """A legged robot with a free base and serial gears."""

    def __init__(
        self,
        robot: Robot,
        position: FloatArray,
        step: float = 2e-4,
        slabs: Sequence[tuple[float, float]] = (),
    ) -> None:
        """Place the robot at q (nq,) at rest.

        Args:
            robot: links, gears and feet.
            position: q (nq,).
            step: MuJoCo's own [s].
            slabs: on the flat ground: x where one begins and its height [m].
        """
        self._robot, self._step = robot, step
        self._model: Any = mujoco_model(robot, step, slabs)
        self._data: Any = mujoco.MjData(self._model)
        gears = robot.transmission
        self._ratio, self._inertia = gears.gear_ratio, gears.reflected_inertia
        self._kept_forward = 1.0 - gears.forward_efficiency
        self._kept_backward = 1.0 / gears.backward_efficiency - 1.0
        self._dofs = robot.actuated
        x, y, z, w = position[3:7]
        self._data.qpos[:] = np.concatenate([position[:3], [w, x, y, z], position[7:]])
        mujoco.mj_forward(self._model, self._data)

    @property
    def motion(self) -> Motion:
        """The state as pinocchio has it: base velocity in the base's own axes."""
        data = self._data
        q, v = np.array(data.qpos), np.array(data.qvel)
        w, x, y, z = q[3:7]
        q[3:7] = x, y, z, w
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, np.array([w, x, y, z]))
        v[:3] = turn.reshape(3, 3).T @ v[:3]
        return Motion(q, v)

    def touching(self) -> list[str]:
        """Return the names of the contact points that touch the ground."""
        geoms = {geom for pair in self._data.contact.geom for geom in pair.tolist()}
        first = self._model.ngeom - len(self._robot.contacts)
        return [c.name for i, c in enumerate(self._robot.contacts) if first + i in geoms]

    def advance(self, rotor_torque: FloatArray, push: FloatArray, time: float) -> None:
        """Go on for `time` [s] under rotor torques (m,) and a force (3,) [N] on the base."""
        data, given = self._data, self._ratio * rotor_torque
        data.xfrc_applied[1, :3] = push
        for _ in range(round(time / self._step)):
            speed = data.qvel[self._dofs]
            mesh = given - self._inertia * data.qacc[self._dofs]
            drives = mesh * speed > 0.0
            kept = np.abs(mesh) * np.where(drives, self._kept_forward, self._kept_backward)
            loss = -kept * np.clip(speed / _CREEP, -1.0, 1.0)
            data.qfrc_applied[self._dofs] = given + loss
            mujoco.mj_step(self._model, data)
