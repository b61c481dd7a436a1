"""Columns by name, and text files of them: what stands between and above the numbers is found.

Commas, semicolons, tabs, bars or blanks between columns; decimal points or commas; a header line,
comment lines (`#`, `%`) and a line of units or none; UTF-8, UTF-16 or Latin-1; gzip. `notes` of the
table say what was found. pyarrow parses the rows.
"""

from __future__ import annotations

import gzip
import os
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from csv import reader
from dataclasses import dataclass, field
from datetime import datetime
from functools import cached_property
from itertools import islice, zip_longest
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc.arrays import FloatArray
from wbc.errors import LogError
from wbc.extras import needs
from wbc.measurement.findings import say_so
from wbc.measurement.names import guess_name
from wbc.measurement.schema import TIME, is_column, named_unit

_DAYS = ("%d.%m.%Y ", "%d/%m/%Y ", "%m/%d/%Y ", "%Y/%m/%d ", "")
_HOURS = ("%H:%M:%S.%f", "%H:%M:%S", "%I:%M:%S.%f %p", "%I:%M:%S %p")
_COPIES = 6  # of a file that reading holds in memory: bytes, text, and the parsed columns


@dataclass(frozen=True, eq=False)
class Table:
    """Columns by name.

    Attributes:
        path: the file or folder.
        columns: name -> values, NumPy arrays or what NumPy makes an array of; equally many rows.
        units: column -> unit that the file itself states, where it does.
        notes: what the reader passed over or took for granted.
    """

    path: Path
    columns: Mapping[str, Any]
    units: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns, in file order."""
        return tuple(self.columns)

    @property
    def clocks(self) -> list[str]:
        """Names of the columns that look like a clock; dates are one, whatever they are called."""
        named = [name for name in self.names if name == TIME or guess_name(name).quantity == TIME]
        return named or [name for name in self.names if self.holds_dates(name)]

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(next(iter(self.columns.values()))) if self.columns else 0

    def numbers(self, name: str) -> FloatArray:
        """Return a column (N,) as numbers, NaN where a cell is empty; of dates the seconds.

        Raises:
            LogError: a cell is no number; the message names the column, the row and the cell.
        """
        values = np.asarray(self.columns[name])
        if values.dtype.kind in "fiub":
            return values.astype(np.float64)
        if values.dtype.kind == "M":
            return np.asarray((values - values[0]) / np.timedelta64(1, "ns") * 1e-9)
        cells = [None if cell is None else str(cell).strip() for cell in values]
        row = 0
        try:
            numbers = np.full(len(cells), np.nan)
            for row, cell in enumerate(cells):
                if cell:
                    numbers[row] = float(cell)
        except ValueError:
            seconds = _seconds(cells)
            if seconds is not None:
                return seconds
            raise LogError(
                f"'{self.path}': column '{name}' holds '{cells[row]}' at row {row} instead of "
                "numbers. Repair these cells, or leave the column out."
            ) from None
        return numbers

    def texts(self, name: str) -> NDArray[Any]:
        """Return a column (N,) as text."""
        return np.asarray([str(cell) for cell in np.asarray(self.columns[name])], dtype=np.str_)

    def holds_dates(self, name: str) -> bool:
        """Whether the cells of a column are dates."""
        values = np.asarray(self.columns[name])
        return bool(values.dtype.kind == "M" or (values.dtype.kind in "OU" and _dates(values)))

    def holds_numbers(self, name: str) -> bool:
        """Whether a column can be read as numbers."""
        try:
            self.numbers(name)
        except LogError:
            return False
        return True


def columns_of(arrays: Mapping[str, Any], path: Path) -> dict[str, Any]:
    """Return columns by name; what holds a list in each row becomes `NAME_0`, `NAME_1`, ...

    Args:
        arrays: name -> (N,) or (N, n) array, or Arrow column of numbers, text or lists.
        path: of the file, for messages.

    Raises:
        LogError: lists of different lengths, or a column of our names with two axes.
    """
    columns: dict[str, Any] = {}
    for name, values in arrays.items():
        parts = _parts(name, values, path)
        if parts is None:
            columns[name] = values
        elif is_column(name):
            raise LogError(f"'{path}': '{name}' has shape {parts.shape}, expected (rows,).")
        else:
            columns |= {f"{name}_{k}": parts[:, k] for k in range(parts.shape[1])}
    return _with_stamps(columns)


def _with_stamps(columns: dict[str, Any]) -> dict[str, Any]:
    """Return columns in which the seconds and nanoseconds of a stamp are one column of seconds."""
    for name in list(columns):
        whole = re.fullmatch(r"(.*\W|.*_|)(secs?)", name)
        parts = [f"{whole[1]}nano{whole[2]}", f"{whole[1]}n{whole[2]}"] if whole else []
        rest = next((part for part in parts if part in columns), "")
        if whole and rest:
            seconds, nanos = (np.asarray(columns[n], dtype=np.float64) for n in (name, rest))
            stamp = seconds + 1e-9 * nanos
            called = name if whole[1] else "stamp"
            columns = {called if n == name else n: v for n, v in columns.items() if n != rest}
            columns[called] = stamp
    return columns


def _dates(values: NDArray[Any]) -> bool:
    cells = [str(cell).strip() for cell in values[:2] if cell is not None]
    return any(any(mark in cell for mark in ":-/") for cell in cells) and (
        _seconds(cells) is not None
    )


def _parts(name: str, values: Any, path: Path) -> NDArray[Any] | None:
    """Return the lists of a column as (N, n), None for a column without lists."""
    if isinstance(values, np.ndarray) and values.dtype != object:
        return values if values.ndim == 2 else None
    first = next((cell for cell in _cells(values, 1)), None)
    if not isinstance(first, list) and not (isinstance(first, str) and first[:1] in "[("):
        return None
    try:
        rows = [_numbers_in(cell) for cell in _cells(values, len(values))]
    except ValueError:
        return None
    size = len(rows[0])
    odd = next((k for k, row in enumerate(rows) if len(row) != size), None)
    if odd is not None:
        raise LogError(
            f"'{path}': column '{name}' holds {size} numbers in row 0 and {len(rows[odd])} in row "
            f"{odd}. Drop such rows."
        )
    return np.asarray(rows, dtype=np.float64)


def _cells(values: Any, count: int) -> Iterator[Any]:
    held = values[:count]
    yield from held.to_pylist() if hasattr(held, "to_pylist") else held.tolist()


def _numbers_in(cell: Any) -> list[float]:
    if isinstance(cell, str):
        cell = cell.strip(" []()").replace(",", " ").replace(";", " ").split()
    return [float(number) for number in cell or ()]


def _seconds(cells: Sequence[str | None]) -> FloatArray | None:
    """Return the seconds (N,) since the first of some dates, None if a cell is none."""
    first = next((cell for cell in cells if cell), "")
    for date in (datetime.fromisoformat, *(_dated(f"{d}{h}") for d in _DAYS for h in _HOURS)):
        try:
            start = date(first)
            return np.array(
                [(date(cell) - start).total_seconds() if cell else np.nan for cell in cells]
            )
        except ValueError:
            continue
    return None


def _dated(pattern: str) -> Any:
    return lambda cell: datetime.strptime(cell.replace(",", "."), pattern)


def kept_rows(size: int) -> tuple[int, tuple[str, ...]]:
    """Return N such that every N-th row of a file of so many bytes fits the memory, and a note."""
    every = max(1, -(-size * _COPIES // memory()))
    return every, (f"larger than memory: one row of {every} was read.",) if every > 1 else ()


def memory() -> int:
    """Return the memory of this machine [bytes], 8 GB where it does not say."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return 8 << 30


_MARKS = (",", ";", "\t", "|", " ")
_COMMENT = ("#", "%")
_HEAD_LINES = 200
_SNIFFED = 40  # lines that tell what stands between cells
_EMPTY = ("", "nan", "null", "na", "n/a", "none")
_GZIP, _UTF_16 = b"\x1f\x8b", (b"\xff\xfe", b"\xfe\xff")
_LIST = re.compile(r"\s*[\[(]\s*[-+.\d]")
_DECIMAL_COMMA = re.compile(r"[-+]?\d*,\d+(?:[eE][-+]?\d+)?")
_ZIPPED = 8  # how many times larger a zipped file of numbers becomes


@dataclass(frozen=True)
class _Layout:
    """How a text is laid out: what stands between cells, the decimal sign, cells of its head."""

    mark: str
    decimal: str
    first: list[str]
    below: list[list[str]]

    @cached_property
    def width(self) -> int:
        return Counter(map(len, self.below)).most_common(1)[0][0] if self.below else len(self.first)

    def is_number(self, cell: str) -> bool:
        cell = cell.strip()
        if cell.lower() in _EMPTY:
            return True
        try:
            float(cell.replace(",", ".") if self.decimal == "," else cell)
        except ValueError:
            return False
        return True

    def holds_number(self, cell: str) -> bool:
        return bool(cell.strip()) and (self.is_number(cell) or bool(_LIST.match(cell)))

    @property
    def first_is_a_row(self) -> bool:
        """Whether the first line holds numbers where the next one does."""
        told = [[self.holds_number(cell) for cell in row] for row in (self.first, *self.below[:1])]
        return any(told[0]) and told[0] == told[-1]

    @property
    def score(self) -> float:
        """How much of the head is numbers in columns of equal length."""
        rows = [row for row in self.below if len(row) == self.width]
        cells = [cell for row in rows for cell in row]
        numbers = sum(not c.strip() or self.holds_number(c) for c in cells)
        whole = len(rows) / max(len(self.below), 1) * numbers / max(len(cells), 1)
        likely = (1.0 if self.fits(self.first) else 0.5) * (self.width > 1 or 0.5)
        return (whole + 1e-6 * self.width) * likely

    def fits(self, row: Sequence[str]) -> bool:
        """Whether a line has a cell for each column; a mark may stand at its end."""
        return abs(len(row) - self.width) <= 1


def read_text_file(path: Path, header: Sequence[str] = ()) -> Table:
    """Read a text file of columns.

    Args:
        path: the file.
        header: names of the columns of a file without a header line.

    Raises:
        LogError: the file is missing, empty or no text, has no header line, names a column twice,
            or has rows of other lengths.
    """
    text, notes, every = _text(path)
    text = re.sub(r"\Asep=.\r?\n", "", text)  # a line that spreadsheets write
    lines = text[: 1 << 20].splitlines()[:_HEAD_LINES]
    first = next((k for k, line in enumerate(lines) if _says(line)), len(lines))
    if first == len(lines):
        raise LogError(f"'{path}' is empty; a header line with column names is expected.")
    layout = _layout([line for line in lines[first:] if _says(line)][:_SNIFFED])
    names, skipped = _names(path, layout, lines[:first], tuple(header))
    units: dict[str, str] = {}
    if _units_line(layout, skipped):
        cells = [cell.strip() for cell in layout.below[skipped - 2]]
        units = {n: u for n, u in zip(names, map(named_unit, cells), strict=False) if u}
        line = [k for k in range(first, len(lines)) if _says(lines[k])][skipped - 1]
        notes.append(f"line {line + 1} gives units ({', '.join(c for c in cells if c)}).")
    if skipped > 1 + bool(units):
        notes.append(f"names stand in {skipped - bool(units)} lines, one above the other.")
    if layout.mark == " ":
        notes.append("blanks stand between the columns.")
    if layout.decimal == ",":
        notes.append("numbers have decimal commas.")
    if first and any(line.strip() for line in lines[:first]):
        notes.append(f"{first} comment lines above the header were passed over.")
    table = _parsed(path, text, layout, names, skipped, notes)
    if every > 1:
        head = sum(map(_says, lines)) - skipped  # rows that were read one by one
        table = table.take([*range(0, head, every), *range(head, table.num_rows)])
    columns = columns_of(dict(zip(names, table.columns, strict=True)), path)
    return Table(path, columns, units, tuple(notes))


def _says(line: str) -> bool:
    return bool(line.strip()) and not line.startswith(_COMMENT)


def _text(path: Path) -> tuple[str, list[str], int]:
    """Return the text of a file, notes, and N: of one larger than memory every N-th line."""
    try:
        with path.open("rb") as file:
            zipped = file.read(2) == _GZIP
        every, said = kept_rows(path.stat().st_size * (_ZIPPED if zipped else 1))
        notes = list(said)
        with gzip.open(path, "rb") if zipped else path.open("rb") as file:
            head = b"".join(islice(file, _HEAD_LINES)) if every > 1 else b""
            raw = head + (b"".join(islice(file, 0, None, every)) if every > 1 else file.read())
        if raw.startswith(_UTF_16):
            return raw.decode("utf-16"), [*notes, "the file is UTF-16."], every
        if b"\0" in raw[:4096]:
            raise LogError(f"cannot read '{path}' as CSV: it is no text.")
        try:
            return raw.decode("utf-8-sig"), notes, every
        except UnicodeDecodeError:
            notes.append("the file is no UTF-8 and was read as Latin-1.")
            return raw.decode("latin-1"), notes, every
    except (OSError, EOFError, UnicodeError) as cause:
        raise LogError(f"cannot read '{path}' as CSV: {cause}.") from cause


def _split(line: str, mark: str) -> list[str]:
    if mark == " ":
        return line.split()
    return next(iter(reader([line], delimiter=mark, skipinitialspace=True)), [])


def _layout(lines: Sequence[str]) -> _Layout:
    """Return the layout whose cells are numbers in columns, of all that a text may have."""
    found = []
    for mark in _MARKS:
        rows = [_split(line, mark) for line in lines]
        cells = [cell.strip() for row in rows[1:] for cell in row]
        commas = sum(bool(_DECIMAL_COMMA.fullmatch(cell)) for cell in cells)
        points = sum(bool(re.fullmatch(r"[-+]?\d*\.\d+\S*", cell)) for cell in cells)
        found.append(_Layout(mark, "," if commas > points else ".", rows[0], rows[1:]))
    return max(found, key=lambda one: one.score)


def _names(
    path: Path, layout: _Layout, above: Sequence[str], given: tuple[str, ...]
) -> tuple[tuple[str, ...], int]:
    """Return the names of the columns, and the lines that hold them.

    They are given, in a comment above the rows, or in the first lines.
    """
    cells = [cell.strip() for cell in layout.first]
    named = not (layout.first_is_a_row or all(map(layout.is_number, cells)))
    if given and len(given) != len(cells):
        raise LogError(
            f"'{path}' has {len(cells)} columns, rows.header of the column map names {len(given)}."
        )
    if given:
        return given, _head_lines(layout) if named else 0
    said = above[-1].lstrip("".join(_COMMENT)).strip() if above else ""
    for mark in dict.fromkeys((layout.mark, *_MARKS)) if layout.first_is_a_row else ():
        words = [word.strip() for word in _split(said, mark)]
        if len(words) == len(cells) and len(set(words)) == len(words):
            return tuple(words), 0
    if not named:
        wanted = ["time", *(f"column_{k}" for k in range(2, len(cells) + 1))]
        way = say_so({"rows": {"header": wanted}}, "give their true names")
        raise LogError(
            f"'{path}' has no header line: its first line is a row ({', '.join(cells)}). "
            f"Write a line with the names of the {len(cells)} columns above them, or {way}"
        )
    count = _head_lines(layout)
    head = [layout.first, *layout.below[: count - 1 - _units_line(layout, count)]]
    # What is not as wide as the rows, tells of the file and not of its columns.
    cells, *more = [[c.strip() for c in row] for row in filter(layout.fits, head)] or [cells]
    for row in more:
        pairs = list(zip_longest(cells, row, fillvalue=""))
        index = not any(below for _, below in pairs[1:])  # of a table with one: its name alone
        cells = [above if index else " ".join(filter(None, (above, x))) for above, x in pairs]
        cells[0] = pairs[0][1] if index else cells[0]
    if layout.width == len(cells) + 1 and not any(row[-1].strip() for row in layout.below):
        cells.append("")
    return _once(path, [cell or f"column_{k}" for k, cell in enumerate(cells, 1)]), count


def _once(path: Path, names: Sequence[str]) -> tuple[str, ...]:
    """Return names after checking that none stands twice."""
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        apart = [f"{n}_{k}" if n in twice else n for k, n in enumerate(names, 1)]
        way = say_so({"rows": {"header": apart}}, "Give each a name of its own")
        raise LogError(f"'{path}' has more than one column called '{twice[0]}'. {way}")
    return tuple(names)


def _head_lines(layout: _Layout) -> int:
    """Return how many lines stand above the first one with a number."""
    empty = [not any(map(str.strip, row)) for row in layout.below]
    numbers = [layout.fits(row) and any(map(layout.holds_number, row)) for row in layout.below]
    return next((k for k, row in enumerate(zip(empty, numbers, strict=True), 1) if any(row)), 1)


def _units_line(layout: _Layout, count: int) -> bool:
    """Whether the last of the lines above the numbers names units."""
    return count > 1 and _are_units(layout.below[count - 2], layout)


def _are_units(cells: Sequence[str], layout: _Layout) -> bool:
    """Whether a line below the header names units: no number, and half of it known."""
    given = [cell for cell in cells if cell.strip()]
    known = sum(bool(named_unit(cell.strip())) for cell in given)
    return bool(given) and not any(map(layout.is_number, given)) and 2 * known >= len(given)


def _parsed(
    path: Path,
    text: str,
    layout: _Layout,
    names: tuple[str, ...],
    skipped: int,
    notes: list[str],
) -> Any:
    """Return the Arrow table below the header; a last row that was cut off is passed over."""
    with needs("logs", "reading CSV files"):  # pyarrow is no part of a bare installation
        import pyarrow as pa
        import pyarrow.csv as pc
    if re.search(r"(?m)^(?:[#%]|[ \t\r]*\n)", text):  # comments and blank lines
        text = re.sub(r"(?m)^(?:[#%].*|[ \t\r]*)(?:\n|\Z)", "", text)
    if layout.mark == " ":
        text = re.sub(r"[ \t]+", "\t", re.sub(r"(?m)^[ \t]+|[ \t]+$", "", text))
    last = text.rstrip().rpartition("\n")[2]

    def odd(row: Any) -> str:
        if row.text.strip() != last.strip():
            return "error"
        notes.append(f"the last row was cut off and passed over: '{row.text[:40]}'.")
        return "skip"

    mark = "\t" if layout.mark == " " else layout.mark
    try:
        return pc.read_csv(
            pa.BufferReader(text.encode()),
            pc.ReadOptions(use_threads=False, column_names=list(names), skip_rows=skipped),
            pc.ParseOptions(delimiter=mark, invalid_row_handler=odd),
            pc.ConvertOptions(
                null_values=["", "nan", "NaN", "NAN", "null", "NULL", "NA", "n/a", "None"],
                strings_can_be_null=True,
                decimal_point=layout.decimal,
            ),
        )
    except pa.ArrowException as cause:
        if "Empty CSV" in str(cause):
            raise LogError(f"'{path}' is empty: it has columns but no rows.") from cause
        doubled = layout.mark == "," and layout.width == 2 * len(names)
        why = (
            "Rows have twice as many cells as the header: are there decimal commas between commas? "
            "Export with semicolons between the columns, or with decimal points."
            if doubled
            else "Repair that row, or export the file again."
        )
        raise LogError(f"cannot read '{path}' as CSV: {cause}. {why}") from cause
