"""The planar leg with lossless gears in MuJoCo: rotors as armature N^2 I_r.

The foot is a sphere so small that it does not roll, and the contact as stiff as the step allows.
"""

from collections.abc import Callable

import mujoco
import numpy as np
import pytest

from wbc import load_robot
from wbc.sim import Plant, simulate

ROD = """<inertial pos="0 0 -0.2" mass="2"
  diaginertia="0.0266666666666667 0.0266666666666667 1e-9"/>"""
MODEL = """
<mujoco>
  <option timestep="{step}" integrator="{integrator}" gravity="0 0 -9.81" cone="elliptic"
          tolerance="1e-14" iterations="200"/>
  <default><geom friction="1 0 0" condim="3" contype="{ground}" conaffinity="{ground}"
    solref="{time_constant} 1" solimp="0.9999 0.9999 0.001"/></default>
  <worldbody>
    <geom type="plane" size="10 10 1"/>
    <body>
      <joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>
      <joint type="hinge" axis="0 1 0"/>
      <inertial pos="0 0 0" mass="15" diaginertia="0.3125 0.625 0.3125"/>
      <body>
        <joint name="hip" type="hinge" axis="0 1 0" armature="{armature}"/>{rod}
        <body pos="0 0 -0.4">
          <joint name="knee" type="hinge" axis="0 1 0" armature="{armature}"/>{rod}
          <geom type="sphere" size="1e-6" pos="0 0 -0.399999"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="hip"/><motor joint="knee"/></actuator>
</mujoco>
"""


def leg_model(
    step: float = 1e-3, *, armature: float, ground: bool, integrator: str = "Euler"
) -> mujoco.MjModel:
    """Return the leg with rotors as armature, over a ground or in the air."""
    numbers = {"step": step, "integrator": integrator, "armature": armature, "rod": ROD}
    text = MODEL.format(**numbers, ground=int(ground), time_constant=2.0 * step)
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_EULERDAMP
    return model


def run(
    model: mujoco.MjModel, position: np.ndarray, torque: Callable, duration: float
) -> np.ndarray:
    """Return q (5,) after `duration` under joint torques from (time, q, v), held."""
    data, step = mujoco.MjData(model), model.opt.timestep
    data.qpos[:] = position
    for i in range(round(duration / step)):
        data.ctrl[:] = torque((i + 0.5) * step, data.qpos, data.qvel)
        mujoco.mj_step(model, data)
    return np.array(data.qpos)


LEG = load_robot("planar_leg_strong").lossless()
ARMATURE, DRIVEN = float(LEG.transmission.reflected_inertia[0]), LEG.actuated
STAND = LEG.configuration(hip=-0.5, knee=1.0, base_z=2 * 0.4 * np.cos(0.5))


def plant_run(plant: Plant, position, torque, step, duration) -> np.ndarray:
    """Return q after `duration` in our plant under the same joint torques."""
    ratio = plant.robot.transmission.gear_ratio

    def held(state):
        return torque(state.time + 0.5 * step, state.position, state.velocity) / ratio

    return simulate(plant, held, plant.state(position), duration, dt=step).state.position


def _swing(time, q, v):
    return np.array([4.0 * np.sin(9.0 * time), 3.0 * np.cos(7.0 * time)])


def _squat(time, q, v):
    wish = STAND[DRIVEN] + np.array([-0.1, 0.2]) * np.sin(6.0 * time)
    return 400.0 * (wish - q[DRIVEN]) - 20.0 * v[DRIVEN]


def _halves(errors, last: float) -> None:
    """First order: half the step, half the error."""
    assert errors[1] / errors[0] == pytest.approx(0.5, abs=0.05)
    assert errors[2] / errors[1] == pytest.approx(0.5, abs=0.05)
    assert errors[2] < last


def test_free_motion_converges_to_mujoco_at_first_order() -> None:
    start = LEG.configuration(hip=0.4, knee=-0.9, base_z=5.0)
    model = leg_model(2.5e-5, armature=ARMATURE, ground=False, integrator="RK4")
    truth = run(model, start, _swing, 0.5)
    ends = [plant_run(Plant(LEG), start, _swing, step, 0.5) for step in (2e-3, 1e-3, 5e-4)]
    _halves([np.abs(end - truth).max() for end in ends], 5e-3)


def test_sticking_contact_converges_to_mujoco() -> None:
    gaps = []
    for step in (1e-3, 5e-4, 2.5e-4):
        theirs = run(leg_model(step, armature=ARMATURE, ground=True), STAND, _squat, 0.4)
        gaps.append(np.abs(plant_run(Plant(LEG), STAND, _squat, step, 0.4) - theirs).max())
    _halves(gaps, 1e-3)
