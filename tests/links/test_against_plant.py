"""The motion of links along logs of the simulator, whose gears follow the same law."""

from __future__ import annotations

import pytest

from wbc import load_robot
from wbc.effects import Backlash, JointCompliance
from wbc.identification.model.derivatives import evaluate
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.robot import Effect
from wbc.sim.excitation import record_with


@pytest.mark.parametrize(
    "gears",
    [
        (JointCompliance("hip", 600.0, 2.0), JointCompliance("knee", 200.0, 1.0)),
        (JointCompliance("hip", 600.0, 2.0), Backlash("knee", 0.015, 3000.0, 8.0)),
    ],
    ids=["soft and soft", "soft and loose"],
)
def test_the_plants_own_numbers_leave_little(gears: tuple[Effect, ...]) -> None:
    """Measured over 3 s: 0.5 and 1.6 of 3500 and 3800 floors^2 that stiff gears leave."""
    robot = load_robot("planar_leg_fixed").lossless()
    problem = EstimationProblem.from_logs(robot, record_with(robot, list(gears), duration=3.0))
    stiff, true = (
        evaluate(robot, effects, problem.records, problem.whitening).cost for effects in ((), gears)
    )
    assert true < 2e-3 * stiff
