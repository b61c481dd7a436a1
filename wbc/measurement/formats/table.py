"""A file of columns, read in pieces of bounded size."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeAlias

from numpy.typing import NDArray

CHUNK_ROWS = 65_536
"""Rows held in memory at once for every column asked for."""

Chunk: TypeAlias = Mapping[str, NDArray[Any]]
"""Columns of equally many rows: float64 (NaN where a cell is empty), or text for key columns."""


class Table(ABC):
    """Columns by name, whatever the format of the file.

    Attributes:
        path: the file or folder.
        units: column -> unit that the file itself states, where it does.
        notes: what the reader passed over at the head of the file.
    """

    path: Path
    units: Mapping[str, str] = MappingProxyType({})
    notes: tuple[str, ...] = ()

    @property
    @abstractmethod
    def names(self) -> tuple[str, ...]:
        """Names of the columns, in file order."""

    @property
    @abstractmethod
    def rows(self) -> int:
        """Number of rows (an upper bound where counting exactly means parsing the file)."""

    @abstractmethod
    def chunks(self, numbers: Sequence[str], keys: Sequence[str]) -> Iterator[Chunk]:
        """Yield the rows in order, in pieces of at most about `CHUNK_ROWS`.

        Args:
            numbers: columns wanted as float64.
            keys: columns wanted as text.

        Raises:
            LogError: a column whose cells are not what is wanted, or a damaged file.
        """
