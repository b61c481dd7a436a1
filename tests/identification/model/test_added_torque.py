"""What an effect adds by itself is what it takes away from the residual of a whole robot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pytest

from wbc.effects import (
    EFFECTS,
    ActuationDelay,
    CurrentLimit,
    TorqueConstant,
    TransmissionEfficiency,
    load_robot,
)
from wbc.identification.choice.candidate_columns import evidence, make_regressors
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.evaluation import evaluate
from wbc.identification.model.residual import condensed_residual
from wbc.identification.model.sparse_columns import ADDS, SparseColumns, added_torque, condensed
from wbc.measurement import Log
from wbc.robot import Effect, Motion, Robot

ADDING = [kind for kind in EFFECTS.values() if kind.acts_by <= ADDS]


def waving(robot: Robot) -> Log:
    """Return a log in which joints and base wave, and torques and forces are any."""
    time, random = np.arange(400) / 100.0, np.random.default_rng(1)
    columns: dict[str, np.ndarray] = {}

    def wave(size: float, mean: float = 0.0) -> np.ndarray:
        angle = np.outer(time, random.uniform(1.0, 9.0, 3)) + random.uniform(0.0, 6.0, 3)
        return mean + size * np.sin(angle).sum(axis=1)

    usual = robot.pose() if robot.poses else np.full(robot.model.nq, 0.3)
    for joint, place in zip(robot.transmission.joints, robot.actuated_position, strict=True):
        columns[f"{joint}.position"] = wave(0.1, usual[place])
        columns[f"{joint}.rotor_torque"] = wave(0.2)
    if robot.has_free_flyer:
        names = [f"position.{x}" for x in "xyz"] + [f"orientation.{x}" for x in "xyzw"]
        for name, mean in zip(names, usual[:7], strict=True):
            columns[f"base.{name}"] = wave(0.02, mean)
        norm = np.linalg.norm([columns[f"base.{name}"] for name in names[3:]], axis=0)
        for name in names[3:]:
            columns[f"base.{name}"] = columns[f"base.{name}"] / norm
        for contact in robot.contacts:
            for axis, mean in zip("xyz", (0.0, 0.0, 6.0), strict=True):
                columns[f"{contact.name}.force.{axis}"] = wave(0.5, mean)
    return Log(time, columns)


# An arm with a coupled wrist; a quadruped on its feet.
@pytest.fixture(scope="module", params=["staubli_tx40", "solo12"])
def problem(request: pytest.FixtureRequest) -> EstimationProblem:
    robot = load_robot(request.param).without_effects().lossless()
    return EstimationProblem.from_logs(robot, [waving(robot)])


def _some(robot: Robot, kind: type[Effect]) -> Effect:
    """Return an effect of a kind at the last place with every number away from nothing."""
    where = kind.places(robot)[-1]
    values = {
        p.name: float(np.clip(p.null + 0.7 * p.scale, p.low, p.high)) for p in kind.parameters
    }
    return kind.at(where, values)


@pytest.mark.parametrize("kind", ADDING, ids=lambda kind: kind.name)
def test_it_is_what_the_whole_residual_loses(
    problem: EstimationProblem, kind: type[Effect]
) -> None:
    robot, records = problem.robot, problem.records
    effect = _some(robot, kind)
    parts = [condensed(record, [added_torque(robot, effect, record)])[0] for record in records]
    alone = SparseColumns.stacked(parts).full()[:, :, 0]
    before, after = (condensed_residual(r, records) for r in (robot, robot.with_effect(effect)))
    assert alone == pytest.approx(before - after, abs=1e-9 * max(1.0, float(np.abs(before).max())))


def _others(robot: Robot) -> Sequence[Effect]:
    """Return drives, and a lossy gear, beside which columns are different ones."""
    first, second, *_ = robot.transmission.joints
    return (
        TorqueConstant(first, 1.3),
        CurrentLimit(second, 1.0),
        TransmissionEfficiency(second, 0.7, 0.6),
    )


def test_columns_beside_drives_and_a_lossy_gear_are_those_of_the_residual(
    problem: EstimationProblem,
) -> None:
    records = problem.records
    robot = problem.robot.with_effects(*_others(problem.robot))
    before = condensed_residual(robot, records)
    at = evaluate(problem.robot, _others(problem.robot), records, problem.whitening)
    regressors = make_regressors(problem.columns, at, ADDING, [(evidence(robot, records), None)])
    assert {regressor.effect for regressor in regressors} >= {
        EFFECTS["viscous_friction"],
        EFFECTS["presliding"],
    }
    for regressor in regressors[:: max(len(regressors) // 40, 1)]:
        for k, unit in enumerate(regressor.screen.units):
            changed = robot.with_effect(regressor.effect.at(regressor.where, unit))
            lost = before - condensed_residual(changed, records)
            column = regressor.columns.full()[:, :, k]
            assert column == pytest.approx(lost, abs=1e-6 * max(float(np.abs(lost).max()), 1e-9))


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
    leg = load_robot("planar_leg_fixed").lossless()
    problem = EstimationProblem.from_logs(leg, [waving(leg)])
    at = evaluate(leg, (), problem.records, problem.whitening)
    found = make_regressors(
        problem.columns, at, [_Leaking], [(evidence(leg, problem.records), None)]
    )
    assert found
    assert all(len(regressor.columns.outputs) == 2 for regressor in found)
