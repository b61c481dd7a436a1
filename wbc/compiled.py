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
from hashlib import sha256
from typing import Any, TypeVar, cast

import numba
from numba import types
from numba.core.cgutils import alloca_once
from numba.extending import intrinsic
from numba.np.arrayobj import populate_array

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
OutTable = types.Array(types.int64, 2, "C")
"""Whole numbers to write, row by row."""

_Function = TypeVar("_Function", bound=Callable[..., Any])


def several(*fields: Any) -> Any:
    """Return the type of a tuple of arrays and numbers, as a result."""
    return types.Tuple(fields)


def group(names: type[tuple[Any, ...]], *fields: Any) -> Any:
    """Return the type of a NamedTuple of arrays and numbers, as an argument or a result."""
    if len(set(fields)) == 1:
        return types.NamedUniTuple(fields[0], len(fields), names)
    return types.NamedTuple(fields, names)


def _view(context: Any, array: Any, start: Any, rows: Any, columns: Any) -> Any:
    """Return the entries of an array (n,) from `start` on as a matrix, without owning them.

    A slice counts who holds its memory each time that it is passed on, which takes longer than a
    loop over a small robot. This does not: the caller keeps `array` alive.
    """
    matrix = types.Array(array.dtype, 2, "C")

    def build(target: Any, builder: Any, signature: Any, given: Any) -> Any:
        source = target.make_array(array)(target, builder, given[0])
        found = target.make_array(matrix)(target, builder)
        size = target.get_constant(types.intp, array.dtype.bitwidth // 8)
        along = builder.mul(given[3], size)
        populate_array(
            found,
            data=builder.gep(source.data, [given[1]]),
            shape=[given[2], given[3]],
            strides=[along, size],
            itemsize=size,
            meminfo=None,
        )
        return found._getvalue()

    return matrix(array, start, rows, columns), build


view: Any = intrinsic(_view)


def _local(context: Any, size: Any) -> Any:
    """Return an array (n,) of numbers on the stack, with any content; n is written as a number.

    It lives as long as the call that makes it, and must not be returned. One that is made in a
    loop is the same every time.
    """
    found = types.Array(types.float64, 1, "C")

    def build(target: Any, builder: Any, signature: Any, given: Any) -> Any:
        number, count = target.get_value_type(types.float64), size.literal_value
        array = target.make_array(found)(target, builder)
        length = target.get_constant(types.intp, count)
        width = target.get_constant(types.intp, 8)
        data = alloca_once(builder, number, size=length)
        populate_array(
            array, data=data, shape=[length], strides=[width], itemsize=width, meminfo=None
        )
        return array._getvalue()

    return found(size), build


local: Any = intrinsic(prefer_literal=True)(_local)


def compiled(
    result: Any, *arguments: Any, counted: bool = True
) -> Callable[[_Function], _Function]:
    """Return a decorator that compiles a function for the types of its result and arguments.

    Sums may be taken in any order, so that they use the processor's vectors; what is not finite
    stays so. Where no folder can be written the function is compiled anew in every process.

    Args:
        result: type of what it returns.
        arguments: types of what it takes.
        counted: whether it counts who holds the memory of its arrays, as a function that makes
            arrays must. One that only reads and writes those that it is given need not, and then
            slices cost nothing; its own small arrays come from `local`.
    """

    def decorator(function: _Function) -> _Function:
        try:
            return _machine_code(function, result(*arguments), kept=True, counted=counted)
        except (RuntimeError, OSError):  # no folder, or one that is full
            found = _machine_code(function, result(*arguments), kept=False, counted=counted)
            _warn_of_compiling()
            return found

    return decorator


def _machine_code(function: _Function, signature: Any, *, kept: bool, counted: bool) -> _Function:
    compiler = numba.njit(
        cache=kept, error_model="numpy", fastmath={"reassoc", "contract"}, _nrt=counted
    )
    found = compiler(function)
    if kept:
        _stamp(found)
    found.compile(signature)
    found.disable_compile()
    return cast(_Function, found)


def _stamp(dispatcher: Any) -> None:
    """Mark what is kept of a function with all that its machine code is made of.

    Numba looks at the function's own file alone. Its machine code also holds the functions that it
    calls and the numbers that it reads from its module: when one of these has changed since, it is
    compiled anew.
    """
    function, kept = dispatcher.py_func, dispatcher._cache._cache_file
    parts = [repr(kept._source_stamp)]
    for name in function.__code__.co_names:
        used = function.__globals__.get(name)
        if isinstance(used, int | float | tuple):
            parts.append(f"{name} = {used!r}")
        parts.append(getattr(used, "wbc_stamp", ""))
    dispatcher.wbc_stamp = sha256("\n".join(parts).encode()).hexdigest()
    kept._source_stamp = dispatcher.wbc_stamp


@cache
def _warn_of_compiling() -> None:
    """Say it once per process."""
    warnings.warn(
        "wbc finds no folder to keep its compiled functions in and compiles them in every "
        "process, for some seconds; set NUMBA_CACHE_DIR to a folder that can be written.",
        stacklevel=2,
    )
