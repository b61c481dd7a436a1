"""A law that is there has one size everywhere; what stands in for another law has not."""

import numpy as np
import pytest

from wbc.effects import (
    JointSpring,
    QuadraticDrag,
    TorqueOffset,
    ViscousFriction,
    load_robot,
)
from wbc.identification.choice.certainty import Odds, Support, support_of
from wbc.identification.choice.trials import Trials
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.measurement import Log
from wbc.robot import Effect
from wbc.sim.excitation import record_with

LEG = load_robot("planar_leg_fixed").lossless()


def support(cause: Effect, logs: list[Log]) -> Support:
    """Return what speaks for a cause of these logs, alone, once it is fitted."""
    trials = Trials(EstimationProblem.from_logs(LEG, logs))
    h = trials.of((cause,))
    assert h is not None
    excess = np.maximum(h.outputs - 1.0, 0.0)
    support, _ = support_of(trials, h, Odds((h,), (0.0,), (1.0,)), excess)
    return support[cause.key]


def recorded(*hidden: Effect) -> list[Log]:
    return [*record_with(LEG, list(hidden), duration=4.0)]


@pytest.mark.parametrize(
    ("hidden", "cause", "variable"),
    [
        (QuadraticDrag("hip", 0.3), ViscousFriction("hip", 0.5), "speed"),
        (ViscousFriction("hip", 0.8), QuadraticDrag("hip", 0.3), "speed"),
        (JointSpring("knee", 6.0, 0.5), TorqueOffset("knee", 1.0), "position"),
    ],
)
def test_what_stands_in_for_a_law_changes_its_size(
    hidden: Effect, cause: Effect, variable: str
) -> None:
    logs = recorded(hidden)
    stands_in, itself = support(cause, logs), support(hidden, logs)
    assert stands_in.varies > 1.0
    assert stands_in.group_probability < stands_in.belief
    assert variable in stands_in.follows
    assert itself.varies < 0.0
    assert itself.belief == pytest.approx(itself.group_probability)


def test_the_order_of_logs_says_nothing_of_constancy() -> None:
    logs = recorded(QuadraticDrag("hip", 0.3))
    one, other = (support(ViscousFriction("hip", 0.5), own) for own in (logs, logs[::-1]))
    assert one.varies == pytest.approx(other.varies, rel=1e-3)
    assert one.follows == other.follows
