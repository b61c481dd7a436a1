"""A trial that is not finite loses: it ends neither a fit nor a diagnosis."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, final

import numpy as np
import pytest

from wbc import Robot, load_robot
from wbc.arrays import FloatArray
from wbc.effects import Backlash, JointCompliance, JointEffect, ViscousFriction
from wbc.identification import diagnose
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.measurement import Log
from wbc.robot import Effect, Motion, Parameter
from wbc.sim.excitation import record_with


@pytest.fixture(scope="module")
def leg() -> Robot:
    return load_robot("planar_leg_fixed").lossless()


def _falling(leg: Robot, seconds: float) -> list[Log]:
    """Return a log of a leg that stands on its head, which a soft gear cannot hold."""
    time = np.arange(0.0, seconds, 0.01)
    random = np.random.default_rng(0)
    columns = {}
    for k, joint in enumerate(leg.transmission.joints):
        angle = 2.0 * np.pi * (0.5 + 0.2 * k) * time
        rate = 2.0 * np.pi * (0.5 + 0.2 * k)
        columns[f"{joint}.position"] = 0.3 * np.sin(angle) + (np.pi if k == 0 else 0.0)
        columns[f"{joint}.velocity"] = 0.3 * rate * np.cos(angle)
        columns[f"{joint}.motor_torque"] = 5.0 * np.sin(angle + 1.0)
        for name, size in (("position", 1e-5), ("velocity", 1e-3), ("motor_torque", 1e-2)):
            columns[f"{joint}.{name}"] += size * random.standard_normal(time.size)
    return [Log(time, columns)]


def test_a_link_that_flies_off_loses_and_ends_nothing(leg: Robot) -> None:
    problem = EstimationProblem.from_logs(leg, _falling(leg, 200.0))
    for start in (
        [JointCompliance("hip", 1.0, 0.0)],
        [JointCompliance("hip", 1.0, 0.0), ViscousFriction("hip", 0.1)],
        [Backlash("hip", 0.01, 1.0, 0.0)],
    ):
        fit = problem.fit(start)
        assert "flies off" in fit.failed
        assert "'hip'" in fit.failed
        assert fit.error == np.inf
        assert np.all(np.isinf(problem.held_out(fit)))
    assert not problem.fit([JointCompliance("hip", 5000.0, 10.0)]).failed


def test_a_diagnosis_survives_gears_that_hold_nothing(leg: Robot) -> None:
    found = diagnose(
        leg, _falling(leg, 12.0), candidates=[JointCompliance, Backlash, ViscousFriction]
    )
    assert np.isfinite(found.error.after)


@final
@dataclass(frozen=True)
class Broken(JointEffect):
    """A torque that is no number where the joint is fast."""

    size: float
    name: ClassVar[str] = "broken"
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("size", "1", 0.0, 0.0, 9.0, 1.0),)
    explanation: ClassVar[str] = "A mistake."
    experiment: ClassVar[str] = "Correct it."

    def joint_torque(self, robot: Robot, motion: Motion) -> FloatArray:
        """Return no number."""
        with np.errstate(invalid="ignore"):
            root = np.sqrt(0.1 - self.size * np.abs(self.joint_velocity(robot, motion)))
        return self.on_joint(robot, motion, -root)


def test_an_effect_that_gives_no_number_is_dropped(leg: Robot) -> None:
    logs = record_with(leg, [ViscousFriction("knee", 0.3)], duration=3.0)
    assert EstimationProblem.from_logs(leg, logs).fit([Broken("knee", 1.0)]).failed
    classes: list[type[Effect]] = [Broken, ViscousFriction]
    found = diagnose(leg, logs, candidates=classes)
    assert [f.effect.name for f in found.findings] == ["viscous_friction"]
