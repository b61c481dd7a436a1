"""Which log is of which machine, and of what day."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from wbc.errors import LogError

_DATE = re.compile(
    r"(?<!\d)(20\d\d)[-_]?(0[1-9]|1[0-2])[-_]?(0[1-9]|[12]\d|3[01])"
    r"(?:[T_ -]([01]\d|2[0-3])[-:h]?([0-5]\d)(?:[-:m]?([0-5]\d))?)?(?!\d)"
)
_INDEX = ("log", "machine", "date")


@dataclass(frozen=True)
class Run:
    """A log with its machine and its day.

    Attributes:
        path: of the file.
        machine: whose log it is.
        date: when it was recorded.
    """

    path: str
    machine: str
    date: datetime


def find_runs(paths: Sequence[str | Path]) -> tuple[Run, ...]:
    """Return machine and date of files by their names.

    The date stands in the name of the file or of a folder above it (2026-03-01, 20260301,
    2026-03-01T14-30). The machine is the folder where files lie in several folders; else what
    stands in the file's name before the date.

    Raises:
        LogError: no date in a path.
    """
    folders = {Path(path).parent for path in paths if _DATE.search(Path(path).stem)}
    return tuple(_run(Path(path), len(folders) > 1) for path in paths)


def _run(path: Path, by_folder: bool) -> Run:
    for part in (path.stem, *(folder.name for folder in path.parents)):
        found = _DATE.search(part)
        if found is None:
            continue
        numbers = [int(text or 0) for text in found.groups()]
        try:
            date = datetime(*numbers)  # type: ignore[arg-type]
        except ValueError:
            continue
        before = path.stem[: found.start()].strip("_- .") if part == path.stem else path.stem
        folder = path.resolve().parent.name
        named = before or folder
        return Run(str(path), folder if by_folder and part == path.stem else named, date)
    raise LogError(
        f"'{path}': no date in the name of the file or of a folder above it, such as 2026-03-01; "
        "rename it, or give --index FILE.csv with the columns log, machine, date."
    )


def read_index(path: str | Path) -> tuple[Run, ...]:
    """Return the runs that a CSV file lists: columns log, machine, date (ISO 8601).

    Paths of logs are relative to the file.

    Raises:
        LogError: a file that cannot be read, a missing column, or a date of another form.
    """
    place = Path(path)
    try:
        with place.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(file)
            missing = [name for name in _INDEX if name not in (reader.fieldnames or ())]
            if missing:
                raise LogError(f"'{path}' lacks the column {', '.join(missing)}.")
            return tuple(_listed(row, place, line) for line, row in enumerate(reader, 2))
    except (OSError, UnicodeError, csv.Error) as cause:
        raise LogError(f"cannot read '{path}': {cause}.") from cause


def _listed(row: dict[str, str], place: Path, line: int) -> Run:
    if any(row[name] is None for name in _INDEX):
        raise LogError(f"'{place}' line {line}: fewer cells than columns.")
    try:
        date = datetime.fromisoformat(row["date"].strip()).replace(tzinfo=None)
    except ValueError as cause:
        raise LogError(
            f"'{place}' line {line}: '{row['date']}' is no date such as 2026-03-01 or "
            "2026-03-01T14:30."
        ) from cause
    return Run(str(place.parent / row["log"].strip()), row["machine"].strip(), date)
