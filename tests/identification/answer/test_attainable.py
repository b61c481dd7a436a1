"""What any model could explain of logs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, final

import numpy as np
import pytest

from wbc.arrays import FloatArray
from wbc.effects import (
    CoulombFriction,
    PayloadMass,
    load_robot,
)
from wbc.effects.joint_effect import JointEffect
from wbc.identification.answer.remainder import Attainable, attainable
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.robot import Effect, Motion, Parameter, Robot
from wbc.sim.excitation import record_with

LEG = load_robot("planar_leg_fixed").lossless()


@final
@dataclass(frozen=True)
class Saturating(JointEffect):
    """A loss that no effect of the list has: it peaks at a speed."""

    size: float

    name: ClassVar[str] = "saturating"
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("size", "N m", 0.0, 0.0, 9.0, 0.1),)
    explanation: ClassVar[str] = "None."
    experiment: ClassVar[str] = "None."

    def joint_torque(self, robot: Robot, motion: Motion) -> FloatArray:
        speed = self.joint_velocity(robot, motion)
        return self.on_joint(robot, motion, -self.size * speed / (0.2 + speed**4))


@pytest.mark.parametrize(
    "hidden", [[], [CoulombFriction("hip", 0.5), PayloadMass("foot", 0.5)]], ids=len
)
def test_with_the_true_causes_it_is_the_known_floor(hidden: list[Effect]) -> None:
    problem = EstimationProblem.from_logs(LEG, record_with(LEG, hidden, duration=5.0)[1:])
    assert not problem.floor.repeats
    level = attainable(problem, problem.fit(hidden))
    # What the true robot leaves is the noise of these logs: nothing explains any of it.
    assert np.sqrt(level.attainable / level.left) == pytest.approx(1.0, rel=0.1)


def test_without_them_it_is_still_near_the_floor() -> None:
    """The regression knows no effect, but what motion tells of one it finds."""
    hidden = [Saturating("knee", 1.0)]
    problem = EstimationProblem.from_logs(LEG, record_with(LEG, hidden, duration=5.0)[1:])
    level = attainable(problem, problem.fit(()))
    knee = np.sqrt(level.attainable / level.left)[1]
    assert np.sqrt(level.left)[1] > 20.0
    assert knee < 0.25


def test_what_is_left_counts_as_noise_by_the_share_in_which_it_forgets_itself() -> None:
    """No step where what is left is nearly white: logs that hardly differ get the same answer."""

    def excess(whiteness: float) -> float:
        one = np.array([4.0]), np.array([4.0]), np.array([200.0]), np.array([whiteness])
        return float(Attainable(*one, 1).excess[0])

    assert excess(0.0) == 3.0
    steps = np.diff([excess(share) for share in np.linspace(0.0, 1.0, 101)])
    assert np.all((steps < 0.0) & (steps > -0.05))
    assert excess(1.0) < 0.05
