"""Loops over small arrays as machine code: there a call into numpy takes longer than its work.

Functions are compiled for fixed types when their module is first imported, and kept on disk beside
it, so that no tick ever waits for the compiler; under `NUMBA_CACHE_DIR` where that is set, in the
user's own cache where the sources cannot be written beside. They check nothing: whoever calls them
owns the shapes.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import cache
from typing import Any, TypeVar

import numba
from numba import types

Number, Count, Flag, Nothing = types.float64, types.int64, types.boolean, types.void
Vector = types.Array(types.float64, 1, "A", readonly=True)
"""To read, with any stride."""
Row = types.Array(types.float64, 1, "C", readonly=True)
"""To read, without gaps."""
Matrix = types.Array(types.float64, 2, "A", readonly=True)
"""To read, in any order."""
Dense = types.Array(types.float64, 2, "C", readonly=True)
"""To read, row by row."""
Places = types.Array(types.int64, 1, "C", readonly=True)
"""Row numbers to read."""
Table = types.Array(types.int64, 2, "C", readonly=True)
"""Whole numbers to read, row by row."""
Flags = types.Array(types.boolean, 1, "A", readonly=True)
"""To read."""
OutFlags = types.Array(types.boolean, 1, "A")
"""To write."""
OutVector = types.Array(types.float64, 1, "A")
"""To write."""
OutRow = types.Array(types.float64, 1, "C")
"""To write, without gaps."""
OutMatrix = types.Array(types.float64, 2, "A")
"""To write."""
OutDense = types.Array(types.float64, 2, "C")
"""To write, row by row."""
OutPlaces = types.Array(types.int64, 1, "C")
"""Row numbers to write."""

_Function = TypeVar("_Function", bound=Callable[..., Any])


def compiled(result: Any, *arguments: Any) -> Callable[[_Function], _Function]:
    """Return a decorator that compiles a function for the types of its result and arguments.

    Sums may be taken in any order, so that they use the processor's vectors; what is not finite
    stays so. Where no folder can be written the function is compiled anew in every process.
    """

    def decorator(function: _Function) -> _Function:
        try:
            return _machine_code(function, result(*arguments), kept=True)
        except (RuntimeError, OSError):  # no folder, or one that is full
            found = _machine_code(function, result(*arguments), kept=False)
            _warn_of_compiling()
            return found

    return decorator


def _machine_code(function: _Function, signature: Any, *, kept: bool) -> _Function:
    compiler: Callable[[_Function], _Function] = numba.njit(
        [signature], cache=kept, error_model="numpy", fastmath={"reassoc", "contract"}
    )
    return compiler(function)


@cache
def _warn_of_compiling() -> None:
    """Say it once per process."""
    warnings.warn(
        "wbc finds no folder to keep its compiled functions in and compiles them in every "
        "process, for some seconds; set NUMBA_CACHE_DIR to a folder that can be written.",
        stacklevel=2,
    )
