"""Which rows of a file make a log."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from fnmatch import translate
from math import inf
from typing import Any

import numpy as np

from wbc.arrays import BoolArray
from wbc.errors import LogError, unknown_name

ROW_KEYS = ("split", "where", "between", "topic", "header")


@dataclass(frozen=True)
class RowChoice:
    """Selection and partition of the rows of one file.

    Attributes:
        split: column whose values tell the logs of one file apart, empty if it holds one log; a
            value that comes back later begins a log of its own.
        where: column -> shell pattern (`*`, `?`) that its values must match.
        between: first and last time [s] of a log, on its own clock.
        topic: JointState topic of a bag, empty for the only one.
        header: names of the columns of a CSV file that has no header line.
    """

    split: str = ""
    where: Mapping[str, str] = field(default_factory=dict)
    between: tuple[float, float] = (-inf, inf)
    topic: str = ""
    header: tuple[str, ...] = ()

    @property
    def keys(self) -> tuple[str, ...]:
        """The columns, read as text, that decide about a row."""
        return tuple(dict.fromkeys([*([self.split] if self.split else []), *self.where]))

    def keeps(self, keys: Mapping[str, Any], rows: int) -> BoolArray:
        """Return which of some rows match `where`, (rows,) bool; `keys` holds text columns."""
        kept = np.ones(rows, dtype=bool)
        for column, pattern in self.where.items():
            matches = re.compile(translate(pattern)).match
            values, inverse = np.unique(keys[column], return_inverse=True)
            kept &= np.array([matches(str(value)) is not None for value in values])[inverse]
        return kept


def parse_rows(table: Any, place: str) -> RowChoice:
    """Return the choice that the section [rows] of a map states.

    Raises:
        LogError: a key or value that does not fit.
    """
    if not isinstance(table, Mapping):
        raise LogError(f'{place}: a table is expected, such as rows.split = "log".')
    for key in table:
        if key not in ROW_KEYS:
            raise LogError(f"{place}: " + unknown_name("key", key, ROW_KEYS))
    where = table.get("where", {})
    if not isinstance(where, Mapping):
        raise LogError(f"{place}.where: a table of column = pattern is expected.")
    between = table.get("between", [-inf, inf])
    numbers = isinstance(between, list) and all(isinstance(b, int | float) for b in between)
    if not numbers or len(between) != 2 or not between[0] < between[1]:
        raise LogError(f"{place}.between: [first, last] in seconds is expected, got {between!r}.")
    header = table.get("header", [])
    if not isinstance(header, list) or not all(isinstance(name, str) for name in header):
        raise LogError(f"{place}.header: a list of column names is expected, got {header!r}.")
    return RowChoice(
        split=str(table.get("split", "")),
        where={str(column): str(pattern) for column, pattern in where.items()},
        between=(float(between[0]), float(between[1])),
        topic=str(table.get("topic", "")),
        header=tuple(header),
    )
