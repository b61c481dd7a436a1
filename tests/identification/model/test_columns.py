"""Derivatives that many fits share equal those that each fit would make for itself."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from wbc.effects import (
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
from wbc.identification.model.columns import Columns, derivatives
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.evaluation import evaluate, with_changes
from wbc.identification.model.residual import condensed_residual
from wbc.robot import Effect
from wbc.sim.excitation import record_with

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
def problem() -> EstimationProblem:
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
    problem: EstimationProblem, beside: list[Effect]
) -> None:
    shared = Columns(problem.robot, problem.records)
    larger = [e.with_values({p.name: 1.1 * e.values[p.name] for p in e.parameters}) for e in LINKS]
    for effects in (PLAIN, [*PLAIN, *LINKS], [*PLAIN[::-1], *larger], [*LINKS, *PLAIN]):
        alone, found = _both(problem, [*effects, *beside], shared)
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
