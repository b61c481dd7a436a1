"""Memory that a step takes its arrays from, one after the other, in compiled loops.

To ask the system for each array, and to count who holds it, takes a third of a small robot's step.
Whoever takes arrays in a loop sets `used` back to what it was; a part of a step begins with zero.
"""

from __future__ import annotations

from typing import NamedTuple

from wbc.compiled import Dense, OutDense, OutPlaces, OutRow, Row, ask, compiled, inner, view
from wbc.mechanics.linear import copy_to
from wbc.structures import structured


@structured
class Heap(NamedTuple):
    """Memory to take arrays from; they are as long as asked for, with any content.

    Attributes:
        words: (w,) all of it.
        whole: the same as whole numbers.
        used: (2,) words that are taken, and how many are needed where there are too few.
        more: address of a function of Python that puts longer memory in its place.
    """

    words: OutRow
    whole: OutPlaces
    used: OutPlaces
    more: int


@inner
def reserve(heap: Heap, size: int) -> None:
    """Take care that `size` words are there; none may be taken before."""
    heap.used[0], heap.used[1] = 0, size
    if size > len(heap.words):
        ask(heap.more)


@inner
def taken(heap: Heap, size: int) -> int:
    """Take words; return the place of the first."""
    first = int(heap.used[0])
    heap.used[0] = first + size
    return first


@compiled(inside=True)
def row_of(heap: Heap, size: int) -> OutRow:
    """Return a new array (size,)."""
    found: OutRow = view(heap.words, taken(heap, size), 1, size)[0]
    return found


@compiled(inside=True)
def zeros_of(heap: Heap, size: int) -> OutRow:
    """Return a new array (size,) of zeros."""
    found = row_of(heap, size)
    found[:] = 0.0
    return found


@compiled(inside=True)
def whole_of(heap: Heap, size: int) -> OutPlaces:
    """Return a new array (size,) of whole numbers."""
    found: OutPlaces = view(heap.whole, taken(heap, size), 1, size)[0]
    return found


@compiled(inside=True)
def table_of(heap: Heap, rows: int, columns: int) -> OutDense:
    """Return a new array (rows, columns)."""
    found: OutDense = view(heap.words, taken(heap, rows * columns), rows, columns)
    return found


@compiled(inside=True)
def row_copy(heap: Heap, given: Row) -> OutRow:
    """Return a new array (n,) with the entries of another one."""
    found = row_of(heap, len(given))
    copy_to(given, found)
    return found


@compiled(inside=True)
def table_copy(heap: Heap, given: Dense) -> OutDense:
    """Return a new array (r, n) with the entries of another one."""
    found = table_of(heap, given.shape[0], given.shape[1])
    for i in range(len(given)):
        copy_to(given[i], found[i])
    return found
