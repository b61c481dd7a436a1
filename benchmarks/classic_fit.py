"""Diagnosis beside the classic fit on recorded machines: what is left, what it costs.

    python -m benchmarks.classic_fit DATA [--only NAME ...] [--budget SECONDS] [--json FILE]

DATA is the folder with the recorded logs. All see the same logs, band, weights and folds; what is
left is held out: each fold predicted by numbers that were fitted without it. The classic fit is
`wbc identify`: base parameters, rotor inertias, viscous and Coulomb friction, offsets. The ratio is
that to the best plain fit at each joint: the robot as given, friction and offset of each joint, the
classic fit. Its standard error is that of the ratio to the classic fit: blocks of the logs are
drawn with replacement, the same for both.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from rich.table import Table

from benchmarks.recorded import run_on_machines
from wbc.arrays import FloatArray
from wbc.identification import diagnose
from wbc.identification.choice.plain_models import FRICTION, at_all_joints
from wbc.identification.classic import classic_fit, held_out_residual
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.fit import Fit
from wbc.identification.records.record import rms
from wbc.measurement import Log
from wbc.robot import Robot

_DRAWS = 2000  # of the blocks; the standard error of a standard error is then 2 %


def main() -> None:
    """Measure, print, write."""
    run_on_machines(__doc__.splitlines()[0], measure)


def measure(
    machine: str, robot: Robot, logs: Sequence[Log], budget: float
) -> tuple[dict[str, Any], Table]:
    """Return what both leave per joint [N m] and their CPU seconds, and the table."""
    start = time.process_time()
    problem = EstimationProblem.from_logs(robot, logs)
    prepared = time.process_time() - start
    classic = classic_fit(problem)
    classic_seconds = time.process_time() - start
    start = time.process_time()
    diagnosis = diagnose(robot, logs, budget=budget)
    seconds = time.process_time() - start
    kept = [k for k in range(problem.residual.shape[1]) if k not in problem.floor.aside]
    found = diagnosis.robot.effects[len(problem.robot.effects) :]  # of the model to use
    left, friction = (
        left_by(problem, problem.fit(effects)) if effects else problem.residual[:, kept]
        for effects in (found, at_all_joints(problem, FRICTION))
    )
    plain = np.minimum(classic.before, rms(friction))
    result = {
        "joints": list(classic.joints),
        "before": classic.before.tolist(),
        "classic": classic.left.tolist(),
        "best": np.minimum(classic.left, plain).tolist(),
        "diagnosis": rms(left).tolist(),
        "ratio_error": ratio_error(left, classic.residual, problem.blocks).tolist(),
        "preparation_seconds": prepared,
        "classic_seconds": classic_seconds,
        "diagnosis_seconds": seconds,
        "classic_numbers": len(classic.parameters),
        "verdict": diagnosis.verdict,
        "found": [
            [f.effect.name, f.effect.where, round(f.support.group_probability, 3)]
            for f in diagnosis.findings
        ],
    }
    return result, table_of(machine, result)


def left_by(problem: EstimationProblem, fit: Fit) -> FloatArray:
    """Return (rows, outputs) what a fit leaves [N m], each fold predicted without itself."""
    return held_out_residual(
        problem, lambda used: fit.residual[~used] + fit.jacobian[~used] @ fit.step(used)
    )


def ratio_error(left: FloatArray, other: FloatArray, blocks: np.ndarray) -> FloatArray:
    """Return (outputs,) the standard error of the ratio of two rms values on the same rows.

    Args:
        left, other: (rows, outputs).
        blocks: (rows,) block of each row; what is left is not correlated from block to block.
    """
    _, block = np.unique(blocks, return_inverse=True)
    count = int(block.max()) + 1
    sums = [
        np.stack([np.bincount(block, column**2, count) for column in rows.T], axis=1)
        for rows in (left, other)
    ]
    drawn = np.random.default_rng(0).multinomial(count, np.full(count, 1.0 / count), _DRAWS)
    return np.asarray(np.std(np.sqrt((drawn @ sums[0]) / (drawn @ sums[1])), axis=0))


def table_of(name: str, result: dict[str, Any]) -> Table:
    """Return one machine's table."""
    heads = "joint", "before", "classic", "best plain", "diagnosis", "ratio"
    table = Table(*heads, box=None, title=name)
    keys = "joints", "before", "classic", "best", "diagnosis", "ratio_error"
    for joint, *numbers, error in zip(*(result[key] for key in keys), strict=True):
        shown = (f"{x:.3g}" for x in numbers)
        table.add_row(joint, *shown, f"{numbers[-1] / numbers[-2]:.3f} ± {error:.3f}")
    table.caption = (
        f"rms held out [N m]; classic {result['classic_numbers']} numbers, "
        f"{result['classic_seconds']:.1f} CPU s; diagnosis {result['verdict']}, "
        f"{len(result['found'])} causes, {result['diagnosis_seconds']:.1f} CPU s"
    )
    return table


if __name__ == "__main__":
    main()
