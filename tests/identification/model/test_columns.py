"""Columns of effects equal what the residual of a whole robot loses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pytest

from wbc.effects import (
    EFFECTS,
    ActuationDelay,
    CenterOfMass,
    CoulombFriction,
    CurrentLimit,
    JointSpring,
    LinkInertias,
    LoadFriction,
    PayloadMass,
    PositionOffset,
    RotorInertia,
    StribeckFriction,
    TorqueConstant,
    TorqueRipple,
    TransmissionEfficiency,
    ViscousFriction,
    load_robot,
)
from wbc.identification.choice.candidate_columns import evidence, make_regressors
from wbc.identification.model.columns import Columns, derivatives
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.evaluation import evaluate, with_changes
from wbc.identification.model.residual import condensed_residual
from wbc.identification.model.sparse_columns import ADDS
from wbc.measurement import Log
from wbc.robot import Effect, Motion, Robot
from wbc.sim.excitation import record_with

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


def _others(robot: Robot) -> Sequence[Effect]:
    """Return drives, and a lossy gear, beside which columns are different ones."""
    first, second, *_ = robot.transmission.joints
    return (
        TorqueConstant(first, 1.3),
        CurrentLimit(second, 1.0),
        TransmissionEfficiency(second, 0.7, 0.6),
    )


@pytest.mark.parametrize("beside", [False, True], ids=["alone", "beside drives and a lossy gear"])
def test_columns_are_what_the_whole_residual_loses(
    problem: EstimationProblem, beside: bool
) -> None:
    records, others = problem.records, _others(problem.robot) if beside else ()
    robot = problem.robot.with_effects(*others)
    before = condensed_residual(robot, records)
    at = evaluate(problem.robot, others, records, problem.whitening)
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


LEG = load_robot("planar_leg_fixed").lossless()
PLAIN: list[Effect] = [
    ViscousFriction("hip", 0.3),
    CoulombFriction("knee", 0.4),
    StribeckFriction("hip", 0.2, 0.5),
    TorqueRipple("knee", 0.3, 6.0, 0.4),
    JointSpring("hip", 2.0, 0.2),
    RotorInertia("hip", 0.05),
]
ROUNDING = 1e-6
LINKS: list[Effect] = [PayloadMass("foot", 0.2), CenterOfMass("thigh", 0.01, 0.0, 0.02)]


@pytest.fixture(scope="module")
def leg_problem() -> EstimationProblem:
    return EstimationProblem.from_logs(
        LEG, record_with(LEG, [CoulombFriction("hip", 0.3)], duration=3.0)
    )


def _both(
    problem: EstimationProblem, effects: Sequence[Effect], shared: Columns
) -> tuple[np.ndarray, np.ndarray]:
    """Return derivatives by differences of whole residuals, and those of columns."""
    at = evaluate(LEG, effects, problem.records, problem.whitening)
    slots = tuple((k, p) for k, effect in enumerate(effects) for p in effect.parameters)
    alone = []
    for k, parameter in slots:
        moved = with_changes(effects, {(k, parameter.name): 1e-3 * parameter.scale})
        after = evaluate(LEG, moved, problem.records, problem.whitening)
        alone.append((after.residual - at.residual) / 1e-3)
    return np.stack(alone, axis=-1), derivatives(shared, at, slots, problem.whitening)


@pytest.mark.parametrize(
    "beside",
    [
        [],
        [TorqueConstant("hip", 1.2), CurrentLimit("knee", 3.0)],
        [TransmissionEfficiency("knee", 0.8, 0.7)],
        [LoadFriction("hip", 0.0)],
        [PositionOffset("hip", 0.05)],
    ],
    ids=["nothing", "drives", "a lossy gear", "a gear at the edge of loss", "a wrong zero"],
)
def test_columns_do_not_depend_on_when_they_were_made(
    leg_problem: EstimationProblem, beside: list[Effect]
) -> None:
    shared = Columns(leg_problem.robot, leg_problem.records)
    larger = [e.with_values({p.name: 1.1 * e.values[p.name] for p in e.parameters}) for e in LINKS]
    for effects in (PLAIN, [*PLAIN, *LINKS], [*PLAIN[::-1], *larger], [*LINKS, *PLAIN]):
        alone, found = _both(leg_problem, [*effects, *beside], shared)
        assert found == pytest.approx(alone, abs=ROUNDING)


def test_derivatives_by_link_inertias_beside_a_lossy_gear_are_those_of_the_residual() -> None:
    gear = TransmissionEfficiency("knee", 0.8, 0.9)
    problem = EstimationProblem.from_logs(LEG, record_with(LEG, [gear], duration=4.0))
    null = LinkInertias.null_values(LEG, "robot")
    drawn = LinkInertias.at("robot", {name: 0.05 for name in null})
    effects = (gear, CoulombFriction("hip", 0.3), drawn)
    at = evaluate(LEG, effects, problem.records, problem.whitening)
    slots = [(2, parameter) for parameter in drawn.parameters]
    columns = derivatives(problem.columns, at, slots, problem.whitening)
    for row, (k, parameter) in enumerate(slots):
        moved = with_changes(effects, {(k, parameter.name): 1e-4 * parameter.scale})
        after = condensed_residual(LEG.with_effects(*moved), problem.records) @ problem.whitening
        expected = (after - at.residual) / 1e-4
        size = max(float(np.max(np.abs(columns))), 1e-12)
        assert np.max(np.abs(columns[:, :, row] - expected)) < 2e-3 * size
