"""Loops over small arrays as machine code: there a call into numpy takes longer than its work.

Functions are compiled for fixed types when their module is first imported, and kept on disk beside
it (or under `NUMBA_CACHE_DIR`), so that no tick ever waits for the compiler. They check nothing:
whoever calls them owns the shapes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba
from numba import types

Number, Count, Flag, Nothing = types.float64, types.int64, types.boolean, types.void
Vector = types.Array(types.float64, 1, "A", readonly=True)
"""To read, with any stride."""
Matrix = types.Array(types.float64, 2, "A", readonly=True)
"""To read, in any order."""
Dense = types.Array(types.float64, 2, "C", readonly=True)
"""To read, row by row."""
Places = types.Array(types.int64, 1, "C", readonly=True)
"""Row numbers to read."""
OutVector = types.Array(types.float64, 1, "A")
"""To write."""
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
    stays so.
    """
    decorator: Callable[[_Function], _Function] = numba.njit(
        [result(*arguments)],
        cache=True,
        error_model="numpy",
        fastmath={"reassoc", "contract"},
    )
    return decorator
