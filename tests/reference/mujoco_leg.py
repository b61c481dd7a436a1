"""The planar leg with lossless gears in MuJoCo: rotors as armature N^2 I_r.

The foot is a sphere so small that it does not roll, and the contact as stiff as the step allows.
"""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np

MODEL = """
<mujoco>
  <option timestep="{step}" integrator="{integrator}" gravity="0 0 -9.81" cone="elliptic"
          tolerance="1e-14" iterations="200">
    <flag warmstart="enable"/>
  </option>
  <worldbody>
    <geom name="ground" type="plane" size="10 10 1" friction="1 0 0" condim="3"
          contype="{ground}" conaffinity="{ground}" solref="{time_constant} 1"
          solimp="0.9999 0.9999 0.001"/>
    <body name="base">
      <joint name="base_x" type="slide" axis="1 0 0"/>
      <joint name="base_z" type="slide" axis="0 0 1"/>
      <joint name="base_pitch" type="hinge" axis="0 1 0"/>
      <inertial pos="0 0 0" mass="15" diaginertia="0.3125 0.625 0.3125"/>
      <body name="thigh">
        <joint name="hip" type="hinge" axis="0 1 0" armature="{armature}"/>
        <inertial pos="0 0 -0.2" mass="2" diaginertia="0.0266666666666667 0.0266666666666667 1e-9"/>
        <body name="shin" pos="0 0 -0.4">
          <joint name="knee" type="hinge" axis="0 1 0" armature="{armature}"/>
          <inertial pos="0 0 -0.2" mass="2"
                    diaginertia="0.0266666666666667 0.0266666666666667 1e-9"/>
          <geom name="foot" type="sphere" size="1e-6" pos="0 0 -0.399999" friction="1 0 0"
                condim="3" contype="{ground}" conaffinity="{ground}"
                solref="{time_constant} 1" solimp="0.9999 0.9999 0.001"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor joint="hip" gear="1"/><motor joint="knee" gear="1"/>
  </actuator>
</mujoco>
"""


def leg_model(
    step: float = 1e-3, *, armature: float, ground: bool, integrator: str = "Euler"
) -> mujoco.MjModel:
    """Return the leg with rotors as armature, over a ground or in the air."""
    text = MODEL.format(
        step=step,
        integrator=integrator,
        armature=armature,
        ground=int(ground),
        time_constant=2.0 * step,
    )
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_EULERDAMP
    return model


def run(
    model: mujoco.MjModel,
    position: np.ndarray,
    torque: Callable[[float, np.ndarray, np.ndarray], np.ndarray],
    duration: float,
) -> np.ndarray:
    """Return q (5,) after `duration` under joint torques from (time, q, v), held."""
    data, step = mujoco.MjData(model), model.opt.timestep
    data.qpos[:] = position
    for i in range(round(duration / step)):
        data.ctrl[:] = torque((i + 0.5) * step, data.qpos, data.qvel)
        mujoco.mj_step(model, data)
    return np.array(data.qpos)
