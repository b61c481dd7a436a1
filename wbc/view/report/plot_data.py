"""What the report's plots draw, thinned to what a screen can show."""

from __future__ import annotations

from typing import Any

import numpy as np

from wbc.arrays import FloatArray
from wbc.view.explained import explained_curves
from wbc.view.residuals import Residuals

_ROWS = 700
_POINTS = 450


def residual_plots(residuals: Residuals) -> dict[str, Any]:
    """Return per output: residuals over time of every run, and over speed, position and load."""
    runs = residuals.runs
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
                "runs": [_over_time(run.time, run.before[:, k], run.after[:, k]) for run in runs],
            }
        )
    return {"logs": [_name(run.name) for run in runs], "panels": panels}


def _over_time(time: FloatArray, before: FloatArray, after: FloatArray) -> dict[str, Any]:
    every = max(1, -(-len(time) // _ROWS))
    return {
        "t": _short(time[::every], 6),
        "before": _short(before[::every]),
        "after": _short(after[::every]),
    }


def _name(label: str) -> str:
    return label.rsplit("/", 1)[-1]


def _short(values: FloatArray, digits: int = 4) -> list[float]:
    """Return values with a few significant digits: text is what the file is made of."""
    return [float(f"{value:.{digits}g}") for value in values]
