"""What any model could explain of logs."""

import numpy as np
import pytest

from wbc.effects import CoulombFriction, JointSpring, PayloadMass, ViscousFriction, load_robot
from wbc.identification.answer.remainder import attainable
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.robot import Effect
from wbc.sim.excitation import record_with

LEG = load_robot("planar_leg_fixed").lossless()


@pytest.mark.parametrize(
    "hidden", [[], [CoulombFriction("hip", 0.5), PayloadMass("foot", 0.5)]], ids=len
)
def test_with_the_true_causes_it_is_the_known_floor(hidden: list[Effect]) -> None:
    problem = EstimationProblem.from_logs(LEG, record_with(LEG, hidden, duration=5.0)[1:])
    assert not problem.floor.repeats
    level = attainable(problem, problem.fit(hidden))
    # What the true robot leaves is the noise of these logs: nothing explains any of it.
    assert np.sqrt(level.attainable / level.left) == pytest.approx(1.0, rel=0.1)


@pytest.mark.parametrize(
    "hidden", [JointSpring("knee", 5.0, 0.2), ViscousFriction("knee", 1.0)], ids=lambda e: e.name
)
def test_without_them_it_is_still_near_the_floor(hidden: Effect) -> None:
    """The regression knows no effect, but what motion tells of one it finds."""
    problem = EstimationProblem.from_logs(LEG, record_with(LEG, [hidden], duration=5.0)[1:])
    level = attainable(problem, problem.fit(()))
    assert np.sqrt(level.left)[1] > 20.0
    assert np.sqrt(level.attainable / level.left)[1] < 0.25
