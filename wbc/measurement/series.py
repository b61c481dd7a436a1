"""Checks of single channels; what a log is made of has passed them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wbc.arrays import FloatArray, frozen
from wbc.errors import LogError
from wbc.measurement.columns.mend import say_so


def checked_time(values: ArrayLike, label: str) -> FloatArray:
    """Return time stamps (N,) [s] after checking that they increase strictly.

    Raises:
        LogError: fewer than two rows, no finite number, or a stamp not after the one before.
    """
    time = checked_series(values, "time", None, label)
    if time.size < 2:
        raise LogError(f"{label}: {time.size} rows; a log needs at least two.")
    steps = np.diff(time)
    bad = np.flatnonzero(steps <= 0.0)
    if bad.size:
        row = int(bad[0]) + 1
        back = steps < 0.0
        kind = "goes back" if back[row - 1] else "repeats"
        keep = say_so({"time": {"repeated": "first"}}, "keep the first of such rows")
        way = "Sort the rows." if back.any() else f"Drop them; of a file, {keep}"
        raise LogError(
            f"{label}: time {kind} at row {row} ({time[row - 1]:.9g} s, then {time[row]:.9g} s; "
            f"{bad.size} such rows). {way}"
        )
    return time


def checked_series(values: ArrayLike, name: str, rows: int | None, label: str) -> FloatArray:
    """Return a read-only float channel (N,) after checking length and finiteness.

    An array that nobody can write to is kept as it is, any other is copied.

    Raises:
        LogError: text or objects instead of numbers, another length, NaN or infinity.
    """
    array = np.asarray(values)
    if array.dtype.kind not in "fiub":
        raise LogError(f"{label}: column '{name}' holds {array.dtype} instead of numbers.")
    if array.ndim != 1:
        raise LogError(f"{label}: column '{name}' has shape {array.shape}, expected one axis.")
    if rows is not None and array.size != rows:
        raise LogError(f"{label}: column '{name}' has {array.size} rows, time has {rows}.")
    series = array if _unwritable(array) else frozen(array)
    # A sum is finite unless an entry is not (or it overflows): no mask array for the usual case.
    with np.errstate(over="ignore", invalid="ignore"):
        total = float(np.sum(series))
    if not np.isfinite(total):
        bad = np.flatnonzero(~np.isfinite(series))
        if bad.size:
            row = int(bad[0])
            drop = say_so({"columns": {name: {"missing": "drop_rows"}}}, "drop these rows")
            raise LogError(
                f"{label}: column '{name}' holds {series[row]} at row {row} ({bad.size} such rows "
                f"of {series.size}). Repair them; of a file, {drop}"
            )
    return series


def _unwritable(array: NDArray[Any]) -> bool:
    """Whether an array and everything it is a view of are read-only float64."""
    if array.dtype != np.float64:
        return False
    owner: object = array
    while isinstance(owner, np.ndarray):
        if owner.flags.writeable:
            return False
        owner = owner.base
    return owner is None
