"""The planar leg with lossless gears in MuJoCo: rotors as armature N^2 I_r.

The foot is a sphere so small that it does not roll, and the contact as stiff as the step allows.
"""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np
import pytest

from wbc import Robot, load_robot
from wbc.sim import Plant

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


def _robot() -> Robot:
    return load_robot("planar_leg_strong").lossless()


def _plant_run(robot: Robot, position, torque, step, duration) -> np.ndarray:
    plant = Plant(robot)
    state = plant.state(position)
    ratio = robot.transmission.gear_ratio
    for i in range(round(duration / step)):
        command = torque((i + 0.5) * step, state.position, state.velocity) / ratio
        state = plant.step(state, command, step).state
    return state.position


def _armature(robot: Robot) -> float:
    return float(robot.transmission.reflected_inertia[0])


def _swing(time, q, v):
    return np.array([4.0 * np.sin(9.0 * time), 3.0 * np.cos(7.0 * time)])


def test_free_motion_converges_to_mujoco_at_first_order() -> None:
    robot = _robot()
    start = robot.configuration(hip=0.4, knee=-0.9, base_z=5.0)
    model = leg_model(2.5e-5, armature=_armature(robot), ground=False, integrator="RK4")
    truth = run(model, start, _swing, 0.5)
    errors = [
        np.abs(_plant_run(robot, start, _swing, step, 0.5) - truth).max()
        for step in (2e-3, 1e-3, 5e-4)
    ]
    assert errors[1] / errors[0] == pytest.approx(0.5, abs=0.05)
    assert errors[2] / errors[1] == pytest.approx(0.5, abs=0.05)
    assert errors[2] < 5e-3


def _standing(robot: Robot):
    start = robot.configuration(hip=-0.5, knee=1.0)
    start[1] = 2 * 0.4 * np.cos(0.5)
    driven = robot.actuated

    def squat(time, q, v):
        wish = start[driven] + np.array([-0.1, 0.2]) * np.sin(6.0 * time)
        return 400.0 * (wish - q[driven]) - 20.0 * v[driven]

    return start, squat


def test_sticking_contact_converges_to_mujoco() -> None:
    robot = _robot()
    start, squat = _standing(robot)
    gaps = []
    for step in (1e-3, 5e-4, 2.5e-4):
        ours = _plant_run(robot, start, squat, step, 0.4)
        model = leg_model(step, armature=_armature(robot), ground=True)
        theirs = run(model, start, squat, 0.4)
        gaps.append(np.abs(ours - theirs).max())
    assert gaps[1] / gaps[0] == pytest.approx(0.5, abs=0.05)
    assert gaps[2] / gaps[1] == pytest.approx(0.5, abs=0.05)
    assert gaps[2] < 1e-3
