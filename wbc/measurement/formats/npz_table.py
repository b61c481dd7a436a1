"""NPZ archives: one array per column, streamed, never unpickled."""

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

_SUFFIX = ".npy"
_DAMAGE = (OSError, BadZipFile, ValueError, EOFError, ZlibError)


class NpzTable(Table):
    """An NPZ archive whose arrays all have one axis of the same length."""

    def __init__(self, path: Path) -> None:
        """Read the shape and type of every array.

        Raises:
            LogError: the file is missing or damaged, or the arrays differ in length.
        """
        self.path = path
        self._headers: dict[str, tuple[int, np.dtype[Any]]] = {}
        try:
            with ZipFile(path) as archive:
                for member in archive.namelist():
                    with archive.open(member) as file:
                        shape, dtype = _header(file)
                    self._headers[member.removesuffix(_SUFFIX)] = (
                        _rows(shape, member, path),
                        dtype,
                    )
        except _DAMAGE as cause:
            raise LogError(f"cannot read '{path}' as NPZ: {cause}.") from cause
        lengths = {name: rows for name, (rows, _) in self._headers.items()}
        if len(set(lengths.values())) > 1:
            listed = ", ".join(f"{name} {rows}" for name, rows in lengths.items())
            raise LogError(f"'{path}': the arrays differ in length: {listed}.")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the arrays."""
        return tuple(self._headers)

    @property
    def rows(self) -> int:
        """Length of the arrays."""
        return next((rows for rows, _ in self._headers.values()), 0)

    def chunks(self, numbers: Sequence[str], keys: Sequence[str]) -> Iterator[Chunk]:
        """Yield pieces of the rows (see `Table.chunks`)."""
        for name in numbers:
            dtype = self._headers[name][1]
            if dtype.kind not in "fiub":
                raise LogError(f"{self.path}: column '{name}' holds {dtype} instead of numbers.")
        wanted = list(dict.fromkeys([*numbers, *keys]))
        try:
            with ExitStack() as stack:
                archive = stack.enter_context(ZipFile(self.path))
                files = {n: stack.enter_context(archive.open(n + _SUFFIX)) for n in wanted}
                for file in files.values():
                    _header(file)
                for start in range(0, self.rows, CHUNK_ROWS):
                    count = min(CHUNK_ROWS, self.rows - start)
                    columns = {n: self._piece(files[n], n, count) for n in wanted}
                    yield {
                        n: c.astype(np.str_ if n in keys else np.float64)
                        for n, c in columns.items()
                    }
        except _DAMAGE as cause:
            raise LogError(f"cannot read '{self.path}' as NPZ: {cause}.") from cause

    def _piece(self, file: IO[bytes], name: str, count: int) -> NDArray[Any]:
        dtype = self._headers[name][1]
        raw = file.read(count * dtype.itemsize)
        return np.frombuffer(raw, dtype=dtype, count=count)


def _header(file: IO[bytes]) -> tuple[tuple[int, ...], np.dtype[Any]]:
    version = npy.read_magic(file)
    read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, _, dtype = read(file)
    if dtype.hasobject:
        raise ValueError("it holds Python objects; only arrays of numbers are read")
    return shape, dtype


def _rows(shape: tuple[int, ...], member: str, path: Path) -> int:
    if len(shape) != 1:
        name = member.removesuffix(_SUFFIX)
        raise LogError(f"'{path}': array '{name}' has shape {shape}, expected one axis.")
    return shape[0]
