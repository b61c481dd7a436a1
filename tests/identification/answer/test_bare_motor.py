"""The shaft of a bare motor: friction is all that it reports, 2500 times what its links need."""

import numpy as np
import pytest

from wbc import load_robot
from wbc.effects import CoulombFriction, CurrentLimit, TorqueOffset, ViscousFriction
from wbc.identification import diagnose
from wbc.identification.choice.plain_models import FRICTION, at_all_joints
from wbc.identification.choice.trials import Trials
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.readings import suspicions
from wbc.measurement import Log
from wbc.robot import Robot

_HORN = """<robot name="motor"><link name="body"/>
<link name="horn"><inertial><origin xyz="0 0 0"/><mass value="0.05"/>
<inertia ixx="2e-5" iyy="2e-5" izz="2e-5" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="shaft" type="revolute"><parent link="body"/><child link="horn"/><axis xyz="0 0 1"/>
<limit lower="-3.15" upper="3.15" effort="6" velocity="7"/></joint></robot>"""
_ROBOT = """name = "motor"
model = "motor.urdf"
base = "fixed"
[gears.shaft]
gear_ratio = { value = 200.0, unit = "1", source = "data sheet" }
rotor_inertia = { value = 0.0, unit = "kg m^2", source = "unknown" }
"""


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> tuple[Robot, list[Log]]:
    """Return the robot, and logs of friction that depends on position and falls with speed."""
    folder = tmp_path_factory.mktemp("motor")
    (folder / "motor.urdf").write_text(_HORN)
    (folder / "robot.toml").write_text(_ROBOT)
    rng, logs, time = np.random.default_rng(0), [], np.arange(0.0, 20.0, 0.02)
    for rates in ((2.1, 0.7), (3.3, 1.1), (1.3, 0.4)):
        q, v = np.zeros((2, time.size))
        for size, rate in zip((1.0, 0.8), rates, strict=True):
            q, v = q + size * np.sin(rate * time), v + size * rate * np.cos(rate * time)
        way = np.tanh(v / 0.05)
        torque = way * (0.05 + 0.03 * np.sin(4.0 * q) + 0.06 * np.exp(-((v / 0.8) ** 2)))
        torque += 0.005 * rng.normal(size=time.size)
        columns = {"position": q, "velocity": v, "motor_torque": torque}
        logs.append(Log(time, {f"shaft.{name}": values for name, values in columns.items()}))
    return load_robot(folder / "robot.toml"), logs


def test_friction_far_above_the_need_is_no_wrong_unit(bare: tuple[Robot, list[Log]]) -> None:
    """It held N cm, or the gear ratio was applied once too often: the log was refused."""
    robot, logs = bare
    assert not any("shaft.motor_torque" in text for text in suspicions(robot, logs))


def test_a_limit_in_the_place_of_friction_is_no_better_model(
    bare: tuple[Robot, list[Log]],
) -> None:
    """What it cuts off was no error: it left 1.2 times as much of the reports as a plain fit."""
    robot, logs = bare
    kinds = [CurrentLimit, CoulombFriction, ViscousFriction, TorqueOffset]
    used = diagnose(robot, logs, kinds).robot.effects
    trials = Trials(EstimationProblem.from_logs(robot, logs))
    found, plain = trials.of(used), trials.of(at_all_joints(trials.problem, FRICTION))
    assert found is not None
    assert plain is not None
    assert found.reported.mean() < 1.02**2 * plain.reported.mean()
    limited = trials.of((CoulombFriction("shaft", 0.0156), CurrentLimit("shaft", 0.0156)))
    assert limited is not None
    assert limited.reported.mean() > 2.0 * plain.reported.mean() > 2.0 * limited.squares.mean()
    assert plain.reported == pytest.approx(plain.squares)
