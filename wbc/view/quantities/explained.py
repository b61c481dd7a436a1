"""What the effects found explain, as curves over one quantity."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray

Curve = tuple[FloatArray, FloatArray]

_BINS = 24
_LEAST = 8
_DECIDES = 0.5
_MATTERS = 0.1


def explained_curves(x: FloatArray, explained: FloatArray, speed: FloatArray) -> tuple[Curve, ...]:
    """Return the mean of `explained` over `x`, where `x` decides it.

    One curve where `x` alone accounts for more than half of its variance; two, for either
    direction of motion, where both together do: what a gear loses has a branch for each. None where
    `x` does not decide.

    Args:
        x: (rows,) what is on the axis.
        explained: (rows,) residual of the robot as given minus that with the effects.
        speed: (rows,) of the joint.
    """
    spread = float(np.var(explained)) * len(x)
    if spread == 0.0 or not np.isfinite(x).all():
        return ()
    for split in (np.ones(x.shape, dtype=bool),), (speed > 0.0, speed < 0.0):
        if min(int(part.sum()) for part in split) < 2 * _LEAST:
            continue
        within = sum(float(np.var(explained[part])) * int(part.sum()) for part in split)
        curves = tuple(binned_mean(x[part], explained[part]) for part in split)
        left = sum(
            float(np.sum((explained[part] - np.interp(x[part], *curve)) ** 2))
            for part, curve in zip(split, curves, strict=True)
        )
        # Two branches that do not depend on `x` are a matter of the direction alone.
        if within > _MATTERS * spread and left < _DECIDES * within:
            return curves
    return ()


def binned_mean(x: FloatArray, y: FloatArray, bins: int = _BINS) -> Curve:
    """Return mean x and mean y in bins of equal count, ordered by x; at least eight in a bin."""
    order = np.argsort(x)
    parts = np.array_split(order, max(1, min(bins, len(x) // _LEAST)))
    return (
        np.array([np.mean(x[part]) for part in parts]),
        np.array([np.mean(y[part]) for part in parts]),
    )
