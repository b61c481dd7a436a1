"""NPZ archives: one array per column or per several of them, never unpickled."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import IO, Any
from zipfile import BadZipFile, ZipFile
from zlib import error as ZlibError  # noqa: N812

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from wbc.errors import LogError
from wbc.measurement.formats.table import CHUNK_ROWS, Chunk, Table
from wbc.measurement.schema import is_column

_SUFFIX = ".npy"
_DAMAGE = (OSError, BadZipFile, ValueError, EOFError, ZlibError)


class NpzTable(Table):
    """An NPZ archive whose arrays have equally many rows.

    An array (N,) is a column of its name, streamed; an array `q` (N, n) is the columns `q_0` to
    `q_{n-1}`, read whole.
    """

    def __init__(self, path: Path) -> None:
        """Read the shape and type of every array.

        Raises:
            LogError: the file is missing or damaged, or the arrays differ in length.
        """
        self.path = path
        self._rows: dict[str, int] = {}
        self._types: dict[str, np.dtype[Any]] = {}
        self._places: dict[str, tuple[str, int | None]] = {}
        try:
            with ZipFile(path) as archive:
                for member in archive.namelist():
                    with archive.open(member) as file:
                        shape, dtype = _header(file)
                    self._add(member.removesuffix(_SUFFIX), shape, dtype)
        except _DAMAGE as cause:
            raise LogError(f"cannot read '{path}' as NPZ: {cause}.") from cause
        if len(set(self._rows.values())) > 1:
            listed = ", ".join(f"{name} {rows}" for name, rows in self._rows.items())
            raise LogError(f"'{path}': the arrays differ in length: {listed}.")

    def _add(self, name: str, shape: tuple[int, ...], dtype: np.dtype[Any]) -> None:
        expected = "(rows,)" if is_column(name) else "(rows,) or (rows, columns)"
        if len(shape) != 1 and (len(shape) != 2 or is_column(name)):
            raise LogError(f"'{self.path}': array '{name}' has shape {shape}, expected {expected}.")
        self._rows[name], self._types[name] = shape[0], dtype
        if len(shape) == 1:
            self._places[name] = (name, None)
        else:
            self._places |= {f"{name}_{k}": (name, k) for k in range(shape[1])}

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns."""
        return tuple(self._places)

    @property
    def rows(self) -> int:
        """Length of the arrays."""
        return next(iter(self._rows.values()), 0)

    def chunks(self, numbers: Sequence[str], keys: Sequence[str]) -> Iterator[Chunk]:
        """Yield pieces of the rows (see `Table.chunks`)."""
        for name in numbers:
            dtype = self._types[self._places[name][0]]
            if dtype.kind not in "fiub":
                raise LogError(f"{self.path}: column '{name}' holds {dtype} instead of numbers.")
        wanted = list(dict.fromkeys([*numbers, *keys]))
        try:
            with ExitStack() as stack:
                archive = stack.enter_context(ZipFile(self.path))
                whole = self._whole(archive, wanted)
                files = {
                    name: stack.enter_context(archive.open(name + _SUFFIX))
                    for name in wanted
                    if self._places[name][1] is None
                }
                for file in files.values():
                    _header(file)
                for start in range(0, self.rows, CHUNK_ROWS):
                    count = min(CHUNK_ROWS, self.rows - start)
                    yield {
                        name: (
                            self._piece(files[name], name, count)
                            if name in files
                            else whole[name][start : start + count]
                        ).astype(np.str_ if name in keys else np.float64)
                        for name in wanted
                    }
        except _DAMAGE as cause:
            raise LogError(f"cannot read '{self.path}' as NPZ: {cause}.") from cause

    def _whole(self, archive: ZipFile, wanted: Sequence[str]) -> dict[str, NDArray[Any]]:
        """Return the columns that are part of an array with two axes."""
        arrays: dict[str, NDArray[Any]] = {}
        columns = {}
        for name in wanted:
            array, column = self._places[name]
            if column is None:
                continue
            if array not in arrays:
                with archive.open(array + _SUFFIX) as file:
                    arrays[array] = npy.read_array(file, allow_pickle=False)
            columns[name] = arrays[array][:, column]
        return columns

    def _piece(self, file: IO[bytes], name: str, count: int) -> NDArray[Any]:
        dtype = self._types[name]
        raw = file.read(count * dtype.itemsize)
        return np.frombuffer(raw, dtype=dtype, count=count)


def _header(file: IO[bytes]) -> tuple[tuple[int, ...], np.dtype[Any]]:
    version = npy.read_magic(file)
    read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, _, dtype = read(file)
    if dtype.hasobject:
        raise ValueError("it holds Python objects; only arrays of numbers are read")
    return shape, dtype
