"""What these motions cannot show for what it is must not be named."""

import numpy as np
import pytest

import wbc
from wbc.effects import JointSpring, TorqueRipple
from wbc.identification.choice.prior import implausible
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.robot import Motion
from wbc.sim.excitation import record_with


@pytest.mark.parametrize(("order", "known"), [(5.0, False), (7.0, True)])
def test_a_ripple_is_recognised_from_one_period_on(order: float, known: bool) -> None:
    leg = wbc.load_robot("planar_leg_fixed")
    position = np.zeros((50, 2))
    position[:, 1] = np.linspace(0.3, 1.3, 50)
    motion = Motion(position, np.zeros((50, 2)))
    assert (
        TorqueRipple.search.recognisable(TorqueRipple("knee", 1.0, order, 0.0), leg, [motion])
        is known
    )


@pytest.mark.parametrize(("order", "believed"), [(1.5, False), (9.0, True)])
def test_a_fit_with_less_than_a_period_is_not_believed(order: float, believed: bool) -> None:
    leg = wbc.load_robot("planar_leg_fixed").lossless()
    ripple = TorqueRipple("hip", 0.5, order, 0.3)
    problem = EstimationProblem.from_logs(leg, record_with(leg, [ripple], duration=3.0))
    fit = problem.fit([ripple])
    assert fit.effects[0].values["order"] == pytest.approx(order, rel=0.1)
    assert (sum(implausible(problem, fit)) < 1.0) is believed


@pytest.mark.parametrize(("travel", "known"), [(1e-4, False), (0.1, True)])
def test_a_spring_is_recognised_where_its_joint_moves(travel: float, known: bool) -> None:
    leg = wbc.load_robot("planar_leg_fixed")
    position = np.zeros((50, 2))
    position[:, 1] = 0.5 + np.linspace(0.0, travel, 50)
    motion = Motion(position, np.zeros((50, 2)))
    assert JointSpring.search.recognisable(JointSpring("knee", 1000.0, 0.5), leg, [motion]) is known
