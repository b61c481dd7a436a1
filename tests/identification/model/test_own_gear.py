"""What many gears feel apart is seen in one evaluation, as if each were moved alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pytest

from wbc.effects import (
    EFFECTS,
    ActuationDelay,
    CoulombFriction,
    LoadPresliding,
    PositionOffset,
    RotorInertia,
    TorqueConstant,
    TransmissionEfficiency,
    ViscousFriction,
    load_robot,
)
from wbc.identification.choice import candidate_columns
from wbc.identification.choice.candidate_columns import evidence, make_regressors
from wbc.identification.model import derivatives as differences
from wbc.identification.model.derivatives import derivatives, evaluate
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.kept_columns import KeptColumns
from wbc.robot import Effect, Motion, Robot
from wbc.sim.excitation import record_with

LEG = load_robot("planar_leg_fixed").lossless()
COUPLED = LEG.with_transmission(LEG.transmission.replace(topology=[[1.0, 0.0], [0.5, 1.0]]))


def _problem(robot: Robot) -> EstimationProblem:
    return EstimationProblem.from_logs(
        robot, record_with(robot, [CoulombFriction("hip", 0.3)], duration=2.0)
    )


@pytest.fixture(scope="module", params=[LEG, COUPLED], ids=["one gear a joint", "coupled"])
def problem(request: pytest.FixtureRequest) -> EstimationProblem:
    return _problem(request.param)


AT_BOTH: list[list[Effect]] = [
    [
        e
        for joint in ("hip", "knee")
        for e in (
            TransmissionEfficiency(joint, 0.8, 0.7),
            ViscousFriction(joint, 0.2),
            CoulombFriction(joint, 0.3),
            RotorInertia(joint, 0.02),
            TorqueConstant(joint, 0.9),
        )
    ],
    [LoadPresliding("hip", 0.8, 0.7, 0.05), LoadPresliding("knee", 0.9, 0.8, 0.02)],
    [TransmissionEfficiency("hip", 0.8, 0.7), PositionOffset("knee", 0.01)],
]


@pytest.mark.parametrize("effects", AT_BOTH, ids=["common", "memory", "encoder"])
def test_derivatives_of_several_gears_at_once_are_those_of_each(
    problem: EstimationProblem, effects: Sequence[Effect], monkeypatch: pytest.MonkeyPatch
) -> None:
    at = evaluate(problem.robot, effects, problem.records, problem.whitening)
    slots = tuple((k, p) for k, effect in enumerate(effects) for p in effect.parameters)
    arguments = (problem.robot, at, slots, problem.records, problem.whitening)
    kept = KeptColumns(problem.robot, problem.records)
    together = derivatives(*arguments, kept=kept)
    monkeypatch.setattr(differences, "_felt", lambda *_: None)
    each = derivatives(*arguments)
    np.testing.assert_allclose(together, each, rtol=1e-6, atol=1e-9 * np.abs(each).max())


def test_several_gears_take_one_evaluation(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = _problem(LEG)
    effects = [TransmissionEfficiency(joint, 0.8, 0.7) for joint in ("hip", "knee")]
    at = evaluate(LEG, effects, problem.records, problem.whitening)
    slots = tuple((k, p) for k, effect in enumerate(effects) for p in effect.parameters)
    calls = []
    once = differences.condensed_residual

    def counted(*arguments: object) -> np.ndarray:
        calls.append(arguments)
        return once(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(differences, "condensed_residual", counted)
    derivatives(LEG, at, slots, problem.records, problem.whitening)
    assert len(calls) == 2  # eta_f of both gears, eta_b of both


def test_the_columns_of_every_effect_are_those_of_each_place_alone(
    problem: EstimationProblem, monkeypatch: pytest.MonkeyPatch
) -> None:
    direct = [
        kind for kind in EFFECTS.values() if kind.name not in ("joint_compliance", "backlash")
    ]
    known = evidence(problem.robot, problem.records)
    together = make_regressors(problem.robot, problem.records, direct, known)
    monkeypatch.setattr(candidate_columns, "own_gear", lambda *_: None)
    each = make_regressors(problem.robot, problem.records, direct, known)
    assert [r.key for r in together] == [r.key for r in each]
    for one, other in zip(together, each, strict=True):
        size = np.abs(other.columns.values).max()
        np.testing.assert_allclose(
            one.columns.full(), other.columns.full(), rtol=1e-7, atol=1e-9 * size
        )


@dataclass(frozen=True)
class _Leaking(ActuationDelay):
    """A drive that takes torque from its neighbour, as a user's own class may."""

    name = "leaking"

    @classmethod
    def places(cls, robot: Robot) -> tuple[str, ...]:
        return robot.transmission.joints

    def drive(self, robot: Robot, motion: Motion, torque: np.ndarray) -> np.ndarray:
        return torque + 1e3 * self.delay * torque[..., ::-1]


def test_an_effect_that_other_gears_feel_is_judged_place_by_place() -> None:
    problem = _problem(LEG)
    known = evidence(LEG, problem.records)
    found = make_regressors(LEG, problem.records, [_Leaking], known)
    assert found
    assert all(len(regressor.columns.outputs) == 2 for regressor in found)
