"""Arrays whose memory stays where it is, handed to machine code all at once.

Handing an array over to a compiled function takes 50 ns, as long as a small robot's work on it.
Memory that is made once can be described once: a table of where every array lies takes the place
of all of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic
from numba.np.arrayobj import populate_array

from wbc.arrays import IntArray, frozen

FixedTable = types.Array(types.int64, 2, "C", readonly=True)
"""The table of some `FixedArrays`, as an argument of a compiled function."""
_DTYPES = {kind: np.dtype(str(kind)) for kind in (types.float64, types.int64, types.boolean)}
_WORDS = 5  # address, two lengths, two strides


class FixedArrays:
    """Some arrays and where they lie.

    Keeps them alive. Whoever makes it sees to it that the arrays of its owner stay the same
    objects, or makes another one.

    Attributes:
        arrays: the arrays.
        table: (k, 5), address, lengths and strides of each, for `array_at`.
    """

    def __init__(self, kinds: Sequence[Any], arrays: Sequence[Any]) -> None:
        """Describe the arrays.

        Args:
            kinds: what the compiled function takes each for, as in `wbc.compiled`.
            arrays: of one or two dimensions.

        Raises:
            TypeError: an array that is not of its kind.
        """
        self.arrays = tuple(arrays)
        rows = [_described(kind, array) for kind, array in zip(kinds, arrays, strict=True)]
        self.table: IntArray = frozen(rows, np.int64)


def _described(kind: Any, array: Any) -> list[int]:
    """Return address, lengths and strides of an array."""
    if array.ndim != kind.ndim or array.dtype != _DTYPES[kind.dtype]:
        raise TypeError(f"an array of {array.ndim} dimensions of {array.dtype} is no {kind}")
    if (kind.layout == "C" and not array.flags.c_contiguous) or (
        kind.mutable and not array.flags.writeable
    ):
        raise TypeError(f"an array with gaps or that cannot be written is no {kind}")
    row = [0] * _WORDS
    row[0] = array.__array_interface__["data"][0]
    row[1 : 1 + array.ndim] = array.shape
    row[3 : 3 + array.ndim] = array.strides
    return row


def _array_at(context: Any, table: Any, number: Any, kind: Any) -> Any:
    """Return array `number` of a table as what `kind` says, without owning it."""
    array = kind.instance_type

    def build(target: Any, builder: Any, signature: Any, given: Any) -> Any:
        source = target.make_array(table)(target, builder, given[0])
        first = builder.mul(given[1], target.get_constant(types.int64, _WORDS))

        def word(place: int) -> Any:
            at = builder.add(first, target.get_constant(types.int64, place))
            return builder.load(builder.gep(source.data, [at]))

        found = target.make_array(array)(target, builder)
        populate_array(
            found,
            data=builder.inttoptr(word(0), found.data.type),
            shape=[word(1 + axis) for axis in range(array.ndim)],
            strides=[word(3 + axis) for axis in range(array.ndim)],
            itemsize=target.get_constant(types.intp, array.dtype.bitwidth // 8),
            meminfo=None,
        )
        return found._getvalue()

    return array(table, number, kind), build


array_at: Any = intrinsic(_array_at)
