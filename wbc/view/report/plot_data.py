"""What the report's plots draw, thinned to what a screen can show."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from wbc.arrays import FloatArray
from wbc.identification import Series
from wbc.view.quantities.explained import explained_curves
from wbc.view.quantities.residuals import LogResiduals, ResidualRun
from wbc.view.report.content import log_name

_ROWS = 700  # of one line: about as many as a screen has points across
_NUMBERS = 500_000  # of all lines together: some 3 MB of text
_POINTS = 450
_STRETCHES = 200  # near reversals, shaded in one plot: more would be a grey wall


def residual_plots(
    residuals: LogResiduals, before: Sequence[Series], after: Sequence[Series]
) -> dict[str, Any]:
    """Return per output: torques and residuals over time, residuals over speed, position and load.

    Args:
        residuals: of the robot as given and of the one with the effects found.
        before: torques of the robot as given, one per log.
        after: torques of the robot with the effects found.
    """
    runs = residuals.runs
    rows = min(_ROWS, max(100, _NUMBERS // (6 * len(runs) * len(residuals.outputs))))
    stacked = {
        name: np.concatenate([getattr(run, name) for run in runs])
        for name in ("speed", "position", "load", "before", "after")
    }
    every = max(1, -(-len(stacked["before"]) // _POINTS))
    panels = []
    for k, output in enumerate(residuals.outputs):
        linear = residuals.units[k] == "N"
        over = []
        for name, unit in (
            ("speed", "m/s" if linear else "rad/s"),
            ("position", "m" if linear else "rad"),
            ("load", residuals.units[k]),
        ):
            x = stacked[name][::every, k]
            if np.isfinite(x).all():
                curves = explained_curves(
                    stacked[name][:, k],
                    stacked["before"][:, k] - stacked["after"][:, k],
                    stacked["speed"][:, k],
                )
                lines = [{"x": _short(c), "y": _short(mean)} for c, mean in curves]
                over.append({"name": name, "unit": unit, "x": _short(x), "explained": lines})
        panels.append(
            {
                "output": output,
                "unit": residuals.units[k],
                "floor": float(residuals.floor[k]),
                "over": over,
                "before": _short(stacked["before"][::every, k]),
                "after": _short(stacked["after"][::every, k]),
                "runs": [
                    _over_time(run, first, second, k, k < residuals.driven, rows)
                    for run, first, second in zip(runs, before, after, strict=True)
                ],
            }
        )
    return {"logs": [log_name(run.name) for run in runs], "panels": panels}


def _over_time(
    run: ResidualRun, before: Series, after: Series, k: int, driven: bool, rows: int
) -> dict[str, Any]:
    every = slice(None, None, max(1, -(-len(run.time) // rows)))
    lines = {"before": run.before[:, k], "after": run.after[:, k]}
    if driven:
        lines |= {
            "measured": before.measured[:, k],
            "given": before.modelled[:, k],
            "fitted": after.modelled[:, k],
        }
    short = {name: _short(values[every]) for name, values in lines.items()}
    unused = [_short(stretch, 6) for stretch in run.unused[k][:_STRETCHES]]
    return {"t": _short(run.time[every], 6), **short, "unused": unused}


def _short(values: FloatArray, digits: int = 4) -> list[float]:
    """Return values with a few significant digits: text is what the file is made of."""
    return [float(f"{value:.{digits}g}") for value in values]
