"""A number that rests on the absence of a cause says so, and by how much it would change."""

from __future__ import annotations

import re

import numpy as np
import pytest

from wbc.dynamics import link_torque, rotor_torque
from wbc.effects import EFFECTS, ActuationDelay, RotorInertia, ViscousFriction, load_robot
from wbc.identification import diagnose
from wbc.identification.answer.doubts import absent_ties
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.measurement import Log
from wbc.robot import Motion

ROBOT = load_robot("simple_pendulum")
TRUTH = (ViscousFriction("pendulum", coefficient=0.3), RotorInertia("pendulum", 0.02))
RATE = 250.0


def swung(*waves: tuple[float, float]) -> Log:
    """Return a log of the pendulum with both effects, moved by waves (amplitude, frequency)."""
    time = np.arange(0.0, 8.0, 1.0 / RATE)
    turns = [(a, 2.0 * np.pi * f) for a, f in waves]
    q = sum(a * np.sin(w * time) for a, w in turns)[:, None]
    v = sum(a * w * np.cos(w * time) for a, w in turns)[:, None]
    rise = sum(-a * w**2 * np.sin(w * time) for a, w in turns)[:, None]
    motion = Motion(q, v, rise)
    robot = ROBOT.with_effects(*TRUTH)
    torque, _ = rotor_torque(robot, motion, link_torque(robot, motion))
    random = np.random.default_rng(0)
    noise = random.standard_normal((3, len(time)))
    return Log(
        time,
        {
            "pendulum.position": q[:, 0] + 1e-5 * noise[0],
            "pendulum.velocity": v[:, 0] + 1e-4 * noise[1],
            "pendulum.rotor_torque": torque[:, 0] + 1e-2 * noise[2],
        },
    )


def test_one_frequency_does_not_tell_friction_and_inertia_from_a_delay() -> None:
    problem = EstimationProblem.from_logs(ROBOT, [swung((0.1, 1.3))])
    fit = problem.fit(TRUTH)
    friction, _ = absent_ties(problem, fit, list(EFFECTS.values()))
    (said,) = [text for text in friction if "actuation_delay" in text]
    delay, stated = (float(x) for x in re.findall(r"delay (\S+) s open.* be (\S+) N m", said)[0])
    # At one frequency the torque of a moment later is the same mix of speed and acceleration: the
    # sentence says what a fit beside that delay finds.
    delayed = ROBOT.with_effects(ActuationDelay("pendulum", delay=delay))
    beside = EstimationProblem.from_logs(delayed, [swung((0.1, 1.3))]).fit(TRUTH)
    assert stated == pytest.approx(beside.effects[0].values["coefficient"], abs=0.02)
    assert abs(stated - 0.3) > 0.03


def test_several_frequencies_tell_them_apart() -> None:
    problem = EstimationProblem.from_logs(ROBOT, [swung((0.6, 0.4), (0.25, 1.7), (0.08, 4.3))])
    assert not any(absent_ties(problem, problem.fit(TRUTH), [ActuationDelay]))


def test_the_answer_holds_the_tie() -> None:
    found = diagnose(ROBOT, [swung((0.1, 1.3))], [ViscousFriction, RotorInertia, ActuationDelay])
    assert found.findings
    assert any(
        "rests on the absence of actuation_delay" in text
        for f in found.findings
        for text in f.warnings
    )
