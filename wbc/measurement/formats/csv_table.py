"""CSV files: one header line, then numbers; comma, semicolon or tab between them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from csv import reader
from pathlib import Path

import pyarrow as pa
import pyarrow.csv as pc

from wbc.errors import LogError
from wbc.measurement.formats.arrow_columns import batch_columns
from wbc.measurement.formats.table import Chunk, Table

_BLOCK_BYTES = 1 << 23


class CsvTable(Table):
    """A CSV file, parsed in blocks."""

    def __init__(self, path: Path) -> None:
        """Read the header line.

        Raises:
            LogError: the file is missing, empty or no text, or names a column twice.
        """
        self.path = path
        try:
            with path.open(encoding="utf-8-sig", newline="") as file:
                header = file.readline()
        except (OSError, UnicodeDecodeError) as cause:
            raise LogError(f"cannot read '{path}' as CSV: {cause}.") from cause
        if not header.strip():
            raise LogError(f"'{path}' is empty; a header line with column names is expected.")
        self._delimiter = max(",;\t", key=header.count)
        self._names = tuple(next(reader([header], delimiter=self._delimiter)))
        repeated = [name for name in self._names if self._names.count(name) > 1]
        if repeated:
            raise LogError(f"'{path}' has more than one column called '{repeated[0]}'.")

    @property
    def names(self) -> tuple[str, ...]:
        """Names in the header line."""
        return self._names

    @property
    def rows(self) -> int:
        """Number of lines after the header (blank ones included)."""
        with self.path.open("rb") as file:
            lines, last = 0, b"\n"
            while block := file.read(_BLOCK_BYTES):
                lines, last = lines + block.count(b"\n"), block[-1:]
        return max(0, lines + (last != b"\n") - 1)

    def chunks(self, numbers: Sequence[str], keys: Sequence[str]) -> Iterator[Chunk]:
        """Yield pieces of the rows (see `Table.chunks`)."""
        types = {**{n: pa.string() for n in keys}, **{n: pa.float64() for n in numbers}}
        read = pc.ReadOptions(
            use_threads=False,
            block_size=_BLOCK_BYTES,
            column_names=list(self._names),
            skip_rows=1,
        )
        convert = pc.ConvertOptions(
            column_types=types,
            include_columns=list(types),
            null_values=["", "nan", "NaN", "NAN", "null", "NULL", "NA", "n/a"],
        )
        parse = pc.ParseOptions(delimiter=self._delimiter)
        try:
            with pc.open_csv(self.path, read, parse, convert) as stream:
                for batch in stream:
                    yield batch_columns(batch, numbers, keys, str(self.path))
        except pa.ArrowException as cause:
            if "Empty CSV" in str(cause):
                return
            told = _decimal_commas(str(cause)) or f"{cause}."
            raise LogError(f"cannot read '{self.path}' as CSV: {told}") from cause


def _decimal_commas(cause: str) -> str:
    """Return what to say if a cell that is no number is one with a decimal comma, else ''."""
    number = re.search(r"invalid value '([-+]?\d*,\d+(?:[eE][-+]?\d+)?)'", cause)
    if number is None:
        return ""
    return (
        f"it has decimal commas ('{number[1]}'). Write numbers with decimal points; commas, "
        "semicolons and tabs only between columns."
    )
