"""Columns of effects equal what the residual of a whole robot loses."""

from dataclasses import dataclass

import numpy as np
import pytest

from tests.moved import waving
from wbc import effects, load_robot
from wbc.identification.choice.candidate_columns import evidence, make_regressors
from wbc.identification.model import estimation_problem
from wbc.identification.model.columns import ADDS, Change, derivatives
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.residual import condensed_residual, evaluate, with_changes
from wbc.robot import Effect, Motion, Robot

ADDING = [kind for kind in effects.EFFECTS.values() if kind.acts_by <= ADDS]


# An arm with a coupled wrist; a quadruped on its feet.
@pytest.fixture(scope="module", params=["staubli_tx40", "solo12"])
def problem(request: pytest.FixtureRequest) -> EstimationProblem:
    robot = load_robot(request.param).without_effects().lossless()
    with pytest.MonkeyPatch.context() as patch:  # the torques are any: no column looks right
        patch.setattr(estimation_problem, "suspicions", lambda *_: [])
        return EstimationProblem.from_logs(robot, [waving(robot)])


@pytest.mark.parametrize("beside", [False, True], ids=["alone", "beside drives and a lossy gear"])
def test_columns_are_what_the_whole_residual_loses(
    problem: EstimationProblem, beside: bool
) -> None:
    records, (first, second, *_) = problem.records, problem.robot.transmission.joints
    drives = effects.TorqueConstant(first, 1.3), effects.CurrentLimit(second, 1.0)
    others = (*drives, effects.TransmissionEfficiency(second, 0.7, 0.6)) if beside else ()
    robot = problem.robot.with_effects(*others)
    before = condensed_residual(robot, records)
    at = evaluate(problem.robot, others, records, problem.whitening)
    regressors = make_regressors(problem.columns, at, ADDING, [(evidence(robot, records), None)])
    assert {regressor.effect.name for regressor in regressors} >= {"viscous_friction", "presliding"}
    for regressor in regressors[:: max(len(regressors) // 40, 1)]:
        for k, coefficients in enumerate(np.eye(regressor.size)):
            own = regressor.build(robot, coefficients)
            assert own is not None
            lost = before - condensed_residual(robot.with_effect(own), records)
            column = regressor.columns.full()[:, :, k]
            assert column == pytest.approx(lost, abs=1e-6 * max(float(np.abs(lost).max()), 1e-6))


@dataclass(frozen=True)
class _Leaking(effects.ActuationDelay):
    """A drive that takes torque from its neighbour, as a user's own class may."""

    name = "leaking"

    @classmethod
    def places(cls, robot: Robot) -> tuple[str, ...]:
        return robot.transmission.joints

    def drive(self, robot: Robot, motion: Motion, torque: np.ndarray) -> np.ndarray:
        return torque + 1e3 * self.delay * torque[..., ::-1]


def test_an_effect_that_other_gears_feel_is_judged_place_by_place() -> None:
    leg = load_robot("planar_leg_fixed").lossless()
    problem = EstimationProblem.from_logs(leg, [waving(leg)])
    at = evaluate(leg, (), problem.records, problem.whitening)
    shown = [(evidence(leg, problem.records), None)]
    # What it leaves alone where it does nothing says nothing of where it acts.
    problem.columns.of(at, [Change(_Leaking("hip", 0.0), 1.0)], held=True)
    found = make_regressors(problem.columns, at, [_Leaking], shown)
    assert found
    assert all(len(regressor.columns.outputs) == 2 for regressor in found)


@pytest.mark.parametrize(
    "beside",
    [
        [],
        [effects.TorqueConstant("hip", 1.2), effects.CurrentLimit("knee", 3.0)],
        [effects.TransmissionEfficiency("knee", 0.8, 0.7)],
        [effects.LoadFriction("hip", 0.0)],
        [effects.PositionOffset("hip", 0.05)],
    ],
    ids=["nothing", "drives", "a lossy gear", "a gear at the edge of loss", "a wrong zero"],
)
def test_derivatives_are_differences_of_the_residual_of_a_whole_robot(beside: list[Effect]) -> None:
    leg = load_robot("planar_leg_fixed").lossless()
    problem = EstimationProblem.from_logs(leg, [waving(leg)])
    of_link = {name: 0.05 for name in effects.LinkInertias.null_values(leg, "robot")}
    links = [effects.PayloadMass("foot", 0.2), effects.LinkInertias.at("robot", of_link)]
    plain = [effects.CoulombFriction("knee", 0.4), effects.StribeckFriction("hip", 0.2, 0.5)]
    plain += [effects.TorqueRipple("knee", 0.3, 6.0, 0.4), effects.RotorInertia("hip", 0.05)]
    # Columns of a robot are kept for all its fits: their order must not matter.
    for causes in ([*plain, *beside], [*links, *plain[::-1], *beside]):
        at = evaluate(leg, causes, problem.records, problem.whitening)
        slots = tuple((k, p) for k, effect in enumerate(causes) for p in effect.parameters)
        found = derivatives(problem.columns, at, slots, problem.whitening, {})
        for row, (k, parameter) in enumerate(slots):
            moved = with_changes(causes, {(k, parameter.name): 1e-4 * parameter.scale})
            after = evaluate(leg, moved, problem.records, problem.whitening)
            lost = (after.residual - at.residual) / 1e-4
            size = max(float(np.max(np.abs(found))), 1e-12)
            assert np.max(np.abs(found[:, :, row] - lost)) < 2e-3 * size, (k, parameter.name)
