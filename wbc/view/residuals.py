"""Residuals of a robot before and after a diagnosis, and what they may depend on, for a page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from wbc.arrays import FloatArray
from wbc.identification.answer.remainder import quantities
from wbc.identification.answer.shown import Series
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.records.record import Record, output_names, output_units
from wbc.measurement.checks import true_runs
from wbc.view.rows import short_label

_HALF = 0.5  # weight below which a row counts as not used
_ROWS = 700  # of one line: about as many as a screen has points across
_NUMBERS = 500_000  # of all lines together: some 3 MB of text
_POINTS = 450
_STRETCHES = 200  # near reversals, shaded in one plot: more would be a grey wall
_OVER = {
    "N": {"speed": "m/s", "position": "m", "load": "N"},
    "N m": {"speed": "rad/s", "position": "rad", "load": "N m"},
}
"""Unit of an output -> what its residual is drawn over, with their units."""


def residual_plots(
    problem: EstimationProblem, given: Sequence[Series], fitted: Sequence[Series]
) -> dict[str, Any]:
    """Return per output: torques and residuals over time, residuals over speed, position and load.

    Args:
        problem: the robot and its logs.
        given: torques and residuals (rows, outputs) of every log, of the robot that was given.
        fitted: the same of the robot with the effects found.
    """
    robot, runs = problem.robot, list(zip(problem.records, given, fitted, strict=True))
    names, floor = output_names(robot), problem.floor.values
    before, after = (np.concatenate([one.residual for one in each]) for each in (given, fitted))
    rows = min(_ROWS, max(100, _NUMBERS // (6 * len(runs) * len(names))))
    few = slice(None, None, max(1, -(-len(before) // _POINTS)))
    panels = []
    for k, (output, unit) in enumerate(zip(names, output_units(robot), strict=True)):
        driven = k < robot.transmission.size
        seen = [(record, quantities(record, k)) for record in problem.records]
        over = [
            {
                "name": name,
                "unit": own_unit,
                "x": _short(np.concatenate([one.thinned(own[name][1]) for one, own in seen])[few]),
            }
            for name, own_unit in _OVER[unit].items()
            if driven or name == "speed"
        ]
        panels.append(
            {
                "output": output,
                "unit": unit,
                "floor": float(floor[k]),
                "over": over,
                "before": _short(before[few, k]),
                "after": _short(after[few, k]),
                "runs": [_over_time(*run, k, driven, rows) for run in runs],
            }
        )
    return {"logs": [short_label(one.name) for one in given], "panels": panels}


def _over_time(
    record: Record, given: Series, fitted: Series, k: int, driven: bool, rows: int
) -> dict[str, Any]:
    """Return the lines of one output over the time of a log, and the stretches not used."""
    every = slice(None, None, max(1, -(-len(given.time) // rows)))
    lines = {"before": given.residual, "after": fitted.residual}
    if driven:
        lines |= {"measured": given.measured, "given": given.modelled, "fitted": fitted.modelled}
    short = {name: _short(values[every, k]) for name, values in lines.items()}
    inside = record.weight[record.edge : len(record.weight) - record.edge, k] < _HALF
    ends = record.time[0] + (np.stack(true_runs(inside), axis=1) - [0, 1]) / record.rate
    unused = [_short(stretch, 6) for stretch in ends[:_STRETCHES]]
    return {"t": _short(given.time[every], 6), **short, "unused": unused}


def _short(values: FloatArray, digits: int = 4) -> list[float]:
    """Return values with a few significant digits: text is what the file is made of."""
    return [float(f"{value:.{digits}g}") for value in values]
