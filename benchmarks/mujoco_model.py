"""A robot of this library as a MuJoCo model, as `wbc export` writes it, on flat ground."""

from __future__ import annotations

import mujoco

from wbc import Robot
from wbc.export import export_robot


def mujoco_model(robot: Robot, step: float) -> mujoco.MjModel:
    """Return the model: rotors as armature, point feet, no stops; MJCF holds no loss of a gear."""
    ground = '<worldbody><geom type="plane" size="50 50 1"/>'
    text = export_robot(robot, "mjcf").text.replace("<worldbody>", ground, 1)
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.timestep, model.jnt_limited[:] = step, 0
    return model
