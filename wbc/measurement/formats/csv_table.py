"""CSV files: a header line, then numbers; comma, semicolon or tab between them.

Comment lines (`#`, `%`) above the header, a line of units below it, UTF-16 and gzip are read, too;
`notes` says what was found.
"""

from __future__ import annotations

import gzip
import io
import re
from collections.abc import Iterator, Sequence
from csv import reader
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO

from wbc.errors import LogError
from wbc.extras import needs
from wbc.measurement.columns.mend import say_so
from wbc.measurement.columns.units import named_unit
from wbc.measurement.formats.arrow_columns import batch_columns
from wbc.measurement.formats.table import Chunk, Table

with needs("logs", "reading CSV files"):
    import pyarrow as pa
    import pyarrow.csv as pc

_BLOCK_BYTES = 1 << 23
_HEAD_LINES = 200
_COMMENT = ("#", "%")
_GZIP, _UTF_16 = b"\x1f\x8b", (b"\xff\xfe", b"\xfe\xff")
_EMPTY = ("", "nan", "null", "na", "n/a")


class CsvTable(Table):
    """A CSV file, parsed in blocks."""

    def __init__(self, path: Path, header: Sequence[str] = ()) -> None:
        """Read the lines above the numbers.

        Args:
            path: the file.
            header: names of the columns of a file without a header line.

        Raises:
            LogError: the file is missing, empty or no text, has no header line, or names a column
                twice.
        """
        self.path = path
        try:
            self._zipped = path.open("rb").read(2) == _GZIP
            with self._bytes() as file:
                self._encoding = "utf-16" if file.read(2) in _UTF_16 else "utf-8-sig"
            with self._bytes() as file:
                head = [raw for raw in islice(_lines(file, self._encoding), _HEAD_LINES)]
        except (OSError, EOFError, UnicodeError) as cause:
            raise LogError(f"cannot read '{path}' as CSV: {cause}.") from cause
        notes = ["the file is UTF-16."] if self._encoding == "utf-16" else []
        first = next((k for k, line in enumerate(head) if not line.startswith(_COMMENT)), len(head))
        if first == len(head) or not head[first].strip():
            raise LogError(f"'{path}' is empty; a header line with column names is expected.")
        self._delimiter = max(",;\t", key=head[first].count)
        self._skip = first
        self._names = self._header(head, first, tuple(header))
        below = self._cells(head[self._skip]) if self._skip < len(head) else []
        if _are_units(below):
            self._skip += 1
            named = zip(self._names, map(named_unit, below), strict=False)
            self.units = {name: unit for name, unit in named if unit}
            said = ", ".join(cell for cell in below if cell)
            notes.append(f"line {self._skip} gives units ({said}).")
        if first:
            notes.append(f"{first} comment lines above the header were passed over.")
        self.notes = tuple(notes)
        repeated = [name for name in self._names if self._names.count(name) > 1]
        if repeated:
            raise LogError(f"'{path}' has more than one column called '{repeated[0]}'.")

    def _header(self, head: Sequence[str], first: int, given: tuple[str, ...]) -> tuple[str, ...]:
        """Return the names of the columns, and count their line among those to skip."""
        cells = self._cells(head[first])
        if given:
            if len(given) != len(cells):
                raise LogError(
                    f"'{self.path}' has {len(cells)} columns, rows.header of the column map names "
                    f"{len(given)}."
                )
            if not all(map(_is_number, cells)):
                self._skip += 1
            return given
        if not all(map(_is_number, cells)):
            self._skip += 1
            return tuple(cells)
        above = self._cells(head[first - 1].lstrip("".join(_COMMENT)).strip()) if first else []
        if len(above) == len(cells):
            return tuple(name.strip() for name in above)
        names = ["time", *(f"column_{k}" for k in range(2, len(cells) + 1))]
        named = say_so({"rows": {"header": names}}, "give their true names")
        raise LogError(
            f"'{self.path}' has no header line: its first line holds numbers. Write a line with "
            f"the names of the {len(cells)} columns above them, or {named}"
        )

    def _cells(self, line: str) -> list[str]:
        rows = list(reader([line], delimiter=self._delimiter))
        return rows[0] if rows else []

    def _bytes(self) -> BinaryIO:
        return gzip.open(self.path, "rb") if self._zipped else self.path.open("rb")  # type: ignore[return-value]

    def _stream(self) -> Any:
        """Return the file as a stream of UTF-8 for the parser."""
        stream = pa.input_stream(str(self.path), compression="gzip" if self._zipped else None)
        if self._encoding == "utf-16":
            return pa.transcoding_input_stream(stream, "utf-16", "utf-8")
        return stream

    @property
    def names(self) -> tuple[str, ...]:
        """Names in the header line."""
        return self._names

    @property
    def rows(self) -> int:
        """Number of lines of numbers (blank ones included)."""
        lines, last = 0, b"\n"
        newline = b"\n\0" if self._encoding == "utf-16" else b"\n"
        with self._bytes() as file:
            while block := file.read(_BLOCK_BYTES):
                lines, last = lines + block.count(newline), block[-len(newline) :]
        return max(0, lines + (last != newline and last != b"\n") - self._skip)

    def chunks(self, numbers: Sequence[str], keys: Sequence[str]) -> Iterator[Chunk]:
        """Yield pieces of the rows (see `Table.chunks`)."""
        types = {**{n: pa.string() for n in keys}, **{n: pa.float64() for n in numbers}}
        read = pc.ReadOptions(
            use_threads=False,
            block_size=_BLOCK_BYTES,
            column_names=list(self._names),
            skip_rows=self._skip,
        )
        convert = pc.ConvertOptions(
            column_types=types,
            include_columns=list(types),
            null_values=["", "nan", "NaN", "NAN", "null", "NULL", "NA", "n/a"],
        )
        parse = pc.ParseOptions(delimiter=self._delimiter)
        try:
            with pc.open_csv(self._stream(), read, parse, convert) as stream:
                for batch in stream:
                    yield batch_columns(batch, numbers, keys, str(self.path))
        except pa.ArrowException as cause:
            if "Empty CSV" in str(cause):
                return
            told = _decimal_commas(str(cause)) or f"{cause}."
            raise LogError(f"cannot read '{self.path}' as CSV: {told}") from cause


def _lines(file: BinaryIO, encoding: str) -> Iterator[str]:
    """Yield lines of text without their ends."""
    for line in io.TextIOWrapper(file, encoding=encoding, newline=None):
        yield line.rstrip("\r\n")


def _is_number(cell: str) -> bool:
    if cell.strip().lower() in _EMPTY:
        return True
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _are_units(cells: Sequence[str]) -> bool:
    """Whether a line below the header names units: no number, and half of it known."""
    given = [cell for cell in cells if cell]
    known = sum(bool(named_unit(cell)) for cell in given)
    return bool(given) and not any(map(_is_number, given)) and 2 * known >= len(given)


def _decimal_commas(cause: str) -> str:
    """Return what to say if a cell that is no number is one with a decimal comma, else ''."""
    number = re.search(r"invalid value '([-+]?\d*,\d+(?:[eE][-+]?\d+)?)'", cause)
    if number is None:
        return ""
    return (
        f"it has decimal commas ('{number[1]}'). Write numbers with decimal points; commas, "
        "semicolons and tabs only between columns."
    )
