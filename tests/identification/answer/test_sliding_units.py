"""At a joint that slides, answers are in N and m, not in N m and rad; and never below sensors."""

from __future__ import annotations

import numpy as np
import pytest

from wbc import load_robot
from wbc.effects import CoulombFriction, ViscousFriction
from wbc.errors import LogError
from wbc.identification import diagnose
from wbc.identification.answer.diagnosis import Diagnosis
from wbc.measurement import Log


@pytest.fixture(scope="module")
def found() -> Diagnosis:
    robot = load_robot("emps")
    bare = robot.without_effects()
    ratio = float(robot.transmission.gear_ratio[0])
    mass = (
        float(bare.model.inertias[1].mass) + float(robot.transmission.rotor_inertia[0]) * ratio**2
    )
    logs = []
    for seed in range(2):
        rng = np.random.default_rng(seed)
        t = np.arange(0.0, 6.0, 1e-3)
        waves = [(0.05 / w, w, rng.uniform(0.0, 6.0)) for w in (2.0, 5.0, 9.0)]
        place = sum(a * np.sin(w * t + p) for a, w, p in waves)
        speed = sum(a * w * np.cos(w * t + p) for a, w, p in waves)
        push = mass * sum(-a * w * w * np.sin(w * t + p) for a, w, p in waves)
        push += 20.0 * np.sign(speed) + 0.05 * rng.standard_normal(len(t))
        columns = {"slide.position": place, "slide.velocity": speed, "slide.motor_torque": push}
        logs.append(Log(t, columns))
    return diagnose(bare, logs, [CoulombFriction, ViscousFriction])


def test_a_sliding_joint_is_answered_in_newtons_and_metres(found: Diagnosis) -> None:
    (friction,) = [f for f in found.findings if f.effect.name == "coulomb_friction"]
    assert friction.parameters["level"].value == pytest.approx(20.0, rel=0.05)
    assert friction.parameters["level"].unit == "N"
    assert "N m" not in str(found)
    assert "Coulomb friction of 20 N at slide" in str(found)


def test_nothing_is_attainable_below_the_noise_of_the_sensors(found: Diagnosis) -> None:
    assert all(min(o.after, o.floor) <= o.attainable <= o.after for o in found.outputs)


def test_a_log_without_the_joints_of_a_robot_says_how_to_hold_them_still() -> None:
    t = np.linspace(0.0, 1.0, 200)
    names = [f"{j}.{q}" for j in ("hip", "knee") for q in ("position", "velocity", "rotor_torque")]
    log = Log(t, {name: np.sin(3.0 * t) for name in names})
    with pytest.raises(
        LogError, match=r"robot\.toml:\n    lock = \['base_x', 'base_z', 'base_pitch'\]"
    ):
        diagnose(load_robot("planar_leg"), [log])
