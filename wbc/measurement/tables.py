"""Columns by name, and text files of them: what stands between and above the numbers is found.

Commas, semicolons, tabs, bars or blanks between columns; decimal points or commas; a header line,
comment lines (`#`, `%`) and a line of units or none; UTF-8, UTF-16 or Latin-1; gzip. `notes` of the
table say what was found. pyarrow parses the rows.
"""

from __future__ import annotations

import gzip
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from csv import reader
from dataclasses import dataclass, field
from datetime import datetime
from functools import cached_property
from itertools import compress, product, zip_longest
from pathlib import Path
from typing import Any
from zlib import error as ZlibError  # noqa: N812

import numpy as np
from numpy.typing import NDArray

from wbc.arrays import FloatArray
from wbc.errors import LogError, needs
from wbc.measurement.column_map import say_so
from wbc.measurement.names import guess_name
from wbc.measurement.schema import TIME, is_column, named_unit

_DAYS = ("%d.%m.%Y ", "%d/%m/%Y ", "%m/%d/%Y ", "%Y/%m/%d ", "")
_HOURS = ("%H:%M:%S.%f", "%H:%M:%S", "%I:%M:%S.%f %p", "%I:%M:%S %p")


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
        cells = ["" if cell is None else str(cell).strip() for cell in values]
        with suppress(ValueError):
            return np.array([float(cell or "nan") for cell in cells])
        if (seconds := _seconds(cells)) is not None:
            return seconds
        row = next(row for row, cell in enumerate(cells) if not _is_number(cell or "nan"))
        held = f"'{self.path}': column '{name}' holds '{cells[row]}' at row {row}"
        raise LogError(f"{held} instead of numbers. Repair these cells, or leave the column out.")

    def texts(self, name: str) -> NDArray[Any]:
        """Return a column (N,) as text."""
        return np.asarray([str(cell) for cell in np.asarray(self.columns[name])], dtype=np.str_)

    def holds_dates(self, name: str) -> bool:
        """Whether the cells of a column are dates."""
        values = np.asarray(self.columns[name])
        cells = [str(cell).strip() for cell in values[:2] if values.dtype.kind in "OU"]
        return values.dtype.kind == "M" or _seconds(cells) is not None

    def holds_numbers(self, name: str) -> bool:
        """Whether a column can be read as numbers."""
        with suppress(LogError):
            return self.numbers(name) is not None
        return False


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
        if parts is not None and is_column(name):
            raise LogError(f"'{path}': '{name}' has shape {parts.shape}, expected (rows,).")
        own = {name: values} if parts is None else {f"{name}_{k}": c for k, c in enumerate(parts.T)}
        columns |= own
    for rest in list(columns):  # the seconds and nanoseconds of a stamp are one column of seconds
        part = re.fullmatch(r"(.*\W|.*_|)n(?:ano)?(secs?)", rest)
        if part and (whole := part[1] + part[2]) in columns:
            seconds, nanos = (np.asarray(columns[n], dtype=np.float64) for n in (whole, rest))
            called = whole if part[1] else "stamp"
            columns = {called if n == whole else n: v for n, v in columns.items() if n != rest}
            columns[called] = seconds + 1e-9 * nanos
    return columns


def _parts(name: str, values: Any, path: Path) -> NDArray[Any] | None:
    """Return the lists of a column as (N, n), None for a column without lists."""
    if isinstance(values, np.ndarray) and values.dtype != object:
        return values if values.ndim == 2 else None
    first = next(iter(_cells(values[:1])), None)
    if not isinstance(first, list) and not (isinstance(first, str) and first[:1] in "[("):
        return None
    try:
        rows = [_numbers_in(cell) for cell in _cells(values)]
    except ValueError:
        return None
    for k in (k for k, row in enumerate(rows) if len(row) != len(rows[0])):
        counts = f"{len(rows[0])} numbers in row 0 and {len(rows[k])} in row {k}"
        raise LogError(f"'{path}': column '{name}' holds {counts}. Drop such rows.")
    return np.asarray(rows, dtype=np.float64)


def _cells(values: Any) -> list[Any]:
    return list(values.to_pylist() if hasattr(values, "to_pylist") else values.tolist())


def _numbers_in(cell: Any) -> list[float]:
    if isinstance(cell, str):
        cell = re.split(r"[\s,;]+", cell.strip(" []()"))
    return [float(number) for number in cell or ()]


def _seconds(cells: Sequence[str]) -> FloatArray | None:
    """Return the seconds (N,) since the first of some dates, None if a cell is none."""
    patterns = ["", *(day + hour for day in _DAYS for hour in _HOURS)]
    for pattern in patterns if re.search("[:/-]", next(filter(None, cells), "")) else ():
        with suppress(ValueError):
            dates = [_date(cell, pattern) if cell else None for cell in cells]
            start = next(filter(None, dates))
            return np.array([(date - start).total_seconds() if date else np.nan for date in dates])
    return None


def _date(cell: str, pattern: str) -> datetime:
    """Return the date of a cell, by the ISO where there is no pattern."""
    known = datetime.fromisoformat(cell) if not pattern else None
    return known or datetime.strptime(cell.replace(",", "."), pattern)


def _is_number(cell: str) -> bool:
    with suppress(ValueError):
        return float(cell) is not None
    return False


_MARKS = (",", ";", "\t", "|", " ")
_COMMENT = ("#", "%")
_HEAD_LINES = 200
_SNIFFED = 40  # lines that tell what stands between cells
_EMPTY = ["", "nan", "NaN", "NAN", "null", "NULL", "NA", "n/a", "None"]
_GZIP, _UTF_16 = b"\x1f\x8b", (b"\xff\xfe", b"\xfe\xff")
_LIST = re.compile(r"\s*[\[(]\s*[-+.\d]")
_PASSED_OVER = r"(?m)^(?:[#%].*|[ \t\r]*)(?:\n|\Z)"  # comments and blank lines


@dataclass(frozen=True)
class _Layout:
    """How a text is laid out: what stands between cells, the decimal sign, its first lines."""

    mark: str
    decimal: str
    rows: list[list[str]]

    @cached_property
    def width(self) -> int:
        return Counter(map(len, self.rows[1:] or self.rows)).most_common(1)[0][0]

    def is_number(self, cell: str) -> bool:
        return cell in _EMPTY or _is_number(cell.replace(self.decimal, "."))

    def numbers(self, row: Sequence[str]) -> list[bool]:
        """Return which cells of a line hold numbers, or lists of them."""
        return [bool(c) and (self.is_number(c) or bool(_LIST.match(c))) for c in row]

    @property
    def score(self) -> float:
        """How much of the lines below the first is numbers in columns of equal length."""
        rows = [row for row in self.rows[1:] if len(row) == self.width]
        fine = [n or not c for row in rows for c, n in zip(row, self.numbers(row), strict=True)]
        whole = len(rows) / max(len(self.rows) - 1, 1) * sum(fine) / max(len(fine), 1)
        likely = (1.0 if self.fits(self.rows[0]) else 0.5) * (self.width > 1 or 0.5)
        return (whole + 1e-6 * self.width) * likely

    def fits(self, row: Sequence[str]) -> bool:
        """Whether a line has a cell for each column; a mark may stand at its end."""
        return abs(len(row) - self.width) <= 1

    @cached_property
    def head(self) -> list[list[str]]:
        """The lines above the first row, which has numbers where the next one does."""
        told = [self.numbers(row) for row in self.rows]
        if all(map(self.is_number, self.rows[0])) or (any(told[0]) and told[0] == told[:2][-1]):
            return []
        below = range(1, len(self.rows))
        return self.rows[: next((k for k in below if self.fits(self.rows[k]) and any(told[k])), 1)]

    @cached_property
    def units(self) -> list[str]:
        """Cells of the last line of the head where it names units: half of them known."""
        given = [cell for cell in self.head[-1] if cell] if len(self.head) > 1 else []
        known = sum(bool(named_unit(cell)) for cell in given)
        none = not given or any(map(self.is_number, given)) or 2 * known < len(given)
        return [] if none else self.head[-1]


def read_text_file(path: Path, header: Sequence[str]) -> Table:
    """Read a text file of columns.

    Args:
        path: the file.
        header: names of the columns of a file without a header line.

    Raises:
        LogError: the file is missing, empty or no text, has no header line, names a column twice,
            or has rows of other lengths.
    """
    text, notes = _text(path)
    text = re.sub(r"\Asep=.\r?\n", "", text)  # a line that spreadsheets write
    lines = text[: 1 << 20].splitlines()[:_HEAD_LINES]
    says = [bool(line.strip()) and not line.startswith(_COMMENT) for line in lines]
    if not any(says):
        raise LogError(f"'{path}' is empty; a header line with column names is expected.")
    above, told = lines[: says.index(True)], [*compress(lines, says)][:_SNIFFED]
    layout = max((_split(told, *way) for way in product(_MARKS, ".,")), key=lambda one: one.score)
    names, units = _names(path, layout, above, tuple(header)), layout.units
    heads = len(layout.head) - bool(units)
    said = {
        f"the line above the rows gives units ({', '.join(filter(None, units))}).": bool(units),
        f"names stand in {heads} lines, one above the other.": heads > 1,
        "blanks stand between the columns.": layout.mark == " ",
        "numbers have decimal commas.": layout.decimal == ",",
        f"{len(above)} comment lines above the header were passed over.": "".join(above).strip(),
    }
    notes += [note for note, holds in said.items() if holds]
    table = _parsed(path, text, layout, names, notes)
    columns = columns_of(dict(zip(names, table.columns, strict=True)), path)
    known = {n: u for n, u in zip(names, map(named_unit, units), strict=False) if u}
    return Table(path, columns, known, tuple(notes))


def _text(path: Path) -> tuple[str, list[str]]:
    """Return the text of a file, and notes."""
    try:
        raw = path.read_bytes()
        raw = gzip.decompress(raw) if raw.startswith(_GZIP) else raw
        if raw.startswith(_UTF_16):
            return raw.decode("utf-16"), ["the file is UTF-16."]
        if b"\0" in raw[:4096]:
            raise LogError(f"cannot read '{path}' as CSV: it is no text.")
        try:
            return raw.decode("utf-8-sig"), []
        except UnicodeDecodeError:
            return raw.decode("latin-1"), ["the file is no UTF-8 and was read as Latin-1."]
    except (OSError, EOFError, UnicodeError, ZlibError) as cause:
        raise LogError(f"cannot read '{path}' as CSV: {cause}.") from cause


def _split(lines: Sequence[str], mark: str, decimal: str = ".") -> _Layout:
    """Return the layout that lines have if a mark stands between their cells."""
    if mark == " ":
        return _Layout(mark, decimal, [line.split() for line in lines])
    cells = (next(reader([line], delimiter=mark, skipinitialspace=True), []) for line in lines)
    return _Layout(mark, decimal, [[cell.strip() for cell in row] for row in cells])


def _names(
    path: Path, layout: _Layout, above: Sequence[str], given: tuple[str, ...]
) -> tuple[str, ...]:
    """Return the names of the columns: given, in a comment above the rows, or in the head."""
    first = layout.rows[0]
    if given and len(given) != len(first):
        named = f"rows.header of the column map names {len(given)}"
        raise LogError(f"'{path}' has {len(first)} columns, {named}.")
    if given:
        return given
    if not layout.head:
        said = above[-1].lstrip("".join(_COMMENT)).strip() if above else ""
        for mark in (layout.mark, *_MARKS):
            (words,) = _split([said], mark).rows
            if len({*words}) == len(words) == len(first):
                return tuple(words)
        wanted = [f"column_{k}" for k in range(1, len(first) + 1)]
        way = say_so({"rows": {"header": wanted}}, "give their true names (time of a clock)")
        raise LogError(
            f"'{path}' has no header line: its first line is a row ({', '.join(first)}). "
            f"Write the names of the {len(first)} columns above it, or {way}"
        )
    # What is not as wide as the rows, tells of the file and not of its columns.
    head = layout.head[: len(layout.head) - bool(layout.units)]
    fitting = [*filter(layout.fits, head)] or [first]
    cells, *more = [row for row in fitting if len(row) == len(fitting[-1])]
    for row in more:
        if any(row[1:]):
            cells = [" ".join(filter(None, two)) for two in zip_longest(cells, row, fillvalue="")]
        else:  # of a table with an index, its name alone
            cells = [row[0], *cells[1:]]
    if layout.width == len(cells) + 1 and not any(row[-1] for row in layout.rows[1:]):
        cells.append("")
    names = [cell or f"column_{k}" for k, cell in enumerate(cells, 1)]
    if twice := [name for name in names if names.count(name) > 1]:
        apart = [f"{n}_{k}" if n in twice else n for k, n in enumerate(names, 1)]
        way = say_so({"rows": {"header": apart}}, "Give each a name of its own")
        raise LogError(f"'{path}' has more than one column called '{twice[0]}'. {way}")
    return tuple(names)


def _parsed(
    path: Path, text: str, layout: _Layout, names: tuple[str, ...], notes: list[str]
) -> Any:
    """Return the Arrow table below the head; a last row that was cut off is passed over."""
    with needs("logs", "reading CSV files"):  # pyarrow is no part of a bare installation
        import pyarrow as pa
        import pyarrow.csv as pc
    text = re.sub(_PASSED_OVER, "", text)
    if layout.mark == " ":
        text = re.sub(r"[ \t]+", "\t", re.sub(r"(?m)^[ \t]+|[ \t]+$", "", text))
    last = text.rstrip().rpartition("\n")[2]

    def odd(row: Any) -> str:
        if row.text.strip() != last.strip():
            return "error"
        notes.append(f"the last row was cut off and passed over: '{row.text[:40]}'.")
        return "skip"

    try:
        return pc.read_csv(
            pa.BufferReader(text.encode()),
            pc.ReadOptions(use_threads=False, column_names=list(names), skip_rows=len(layout.head)),
            pc.ParseOptions(delimiter=layout.mark.replace(" ", "\t"), invalid_row_handler=odd),
            pc.ConvertOptions(
                null_values=_EMPTY, strings_can_be_null=True, decimal_point=layout.decimal
            ),
        )
    except pa.ArrowException as cause:
        if "Empty CSV" in str(cause):
            raise LogError(f"'{path}' is empty: it has columns but no rows.") from cause
        why = "Repair that row, or export the file again."
        if layout.mark == "," and layout.width == 2 * len(names):
            why = "Rows have twice as many cells as the header: decimal commas between commas? Use "
            why += "semicolons between the columns, or decimal points."
        raise LogError(f"cannot read '{path}' as CSV: {cause}. {why}") from cause
