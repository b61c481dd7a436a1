"""A robot in MuJoCo with its lossy gears, as `wbc export --to mujoco` writes it, on flat ground."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from wbc import Robot
from wbc.arrays import FloatArray
from wbc.export import export_robot, loss_numbers
from wbc.export.losses import Losses
from wbc.robot import Motion


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
        ground = '<geom type="plane" size="50 50 1"/>'
        for edge, height in slabs:
            half = 0.5 * height
            ground += f'<geom type="box" pos="{edge + 5.0} 0 {half}" size="5 5 {half}"/>'
        text = export_robot(robot, "mujoco").text.replace("<worldbody>", f"<worldbody>{ground}", 1)
        self._robot, self._step = robot, step
        self._model: Any = mujoco.MjModel.from_xml_string(text)
        self._model.opt.timestep = step
        self._losses = Losses(self._model, loss_numbers(robot))
        self._data: Any = mujoco.MjData(self._model)
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
        return [c.name for c in self._robot.contacts if self._model.geom(c.name).id in geoms]

    def advance(self, rotor_torque: FloatArray, push: FloatArray, time: float) -> None:
        """Go on for `time` [s] under rotor torques (m,) and a force (3,) [N] on the base."""
        data = self._data
        data.ctrl[:] = self._robot.transmission.gear_ratio * rotor_torque
        data.xfrc_applied[1, :3] = push
        for _ in range(round(time / self._step)):
            self._losses.apply(data)
            mujoco.mj_step(self._model, data)
