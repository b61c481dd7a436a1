"""Sessions of one machine and what each says: errors, and parameters that are fitted anew."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

import numpy as np

from wbc.effects import load_robot
from wbc.errors import IdentificationError, LogError, failure_text
from wbc.identification.answer.diagnosis import Estimate
from wbc.identification.answer.findings import estimates_of
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.intervals import TAIL
from wbc.identification.records.record import output_names, output_units
from wbc.measurement import Log, load_logs
from wbc.robot import Robot

Quantity = tuple[str, str, str]
"""(effect, place, parameter); the effect is empty for the error of an output."""


@dataclass(frozen=True)
class Session:
    """What one worker measures.

    Attributes:
        robot: name or path of the robot, loaded anew by every worker.
        lossless: whether its gears are made perfect.
        columns: path of a column map.
        machine: whose logs they are.
        date: ISO 8601.
        paths: of the logs.
    """

    robot: str
    lossless: bool
    columns: str | None
    machine: str
    date: str
    paths: tuple[str, ...]


@dataclass(frozen=True)
class SessionResult:
    """What one session says.

    Attributes:
        machine: whose logs they are.
        date: ISO 8601.
        paths: of the logs.
        values: quantity -> estimate with its 90 % interval.
        failure: why there are none, empty otherwise.
        warnings: about the logs.
    """

    machine: str
    date: str
    paths: tuple[str, ...]
    values: Mapping[Quantity, Estimate] = field(default_factory=dict)
    failure: str = ""
    warnings: tuple[str, ...] = ()


def sessions_of(
    robot: str, runs: Sequence[Run], columns: str | None, lossless: bool
) -> list[Session]:
    """Return the sessions of logs, in order of machine and date.

    Raises:
        IdentificationError: no log.
    """
    if not runs:
        raise IdentificationError("no log was given.")
    grouped: dict[tuple[str, datetime], list[str]] = {}
    for run in runs:
        grouped.setdefault((run.machine, run.date), []).append(run.path)
    return [
        Session(robot, lossless, columns, machine, date.isoformat(), tuple(paths))
        for (machine, date), paths in sorted(grouped.items())
    ]


def measure_session(session: Session) -> SessionResult:
    """Return errors and parameters of one session; any error is a failure of it alone."""
    machine, date, paths = session.machine, session.date, session.paths
    try:
        values, warnings = _measured(*robot_and_logs(session))
    except Exception as error:  # whatever one log does, the others are measured
        return SessionResult(machine, date, paths, failure=failure_text(error))
    return SessionResult(machine, date, paths, values, warnings=warnings)


def robot_and_logs(session: Session) -> tuple[Robot, tuple[Log, ...]]:
    """Return the robot of a session and its logs, read with the robot's gear ratios."""
    robot = load_robot(session.robot)
    robot = robot.lossless() if session.lossless else robot
    gears = robot.transmission
    ratios = dict(zip(gears.joints, map(float, gears.gear_ratio), strict=True))
    return robot, load_logs(session.paths, session.columns, gear_ratios=ratios)


def _measured(
    robot: Robot, logs: tuple[Log, ...]
) -> tuple[dict[Quantity, Estimate], tuple[str, ...]]:
    problem = EstimationProblem.from_logs(robot, logs)
    values = _errors(problem)
    if robot.effects:
        bare = EstimationProblem.from_logs(robot.without_effects(), logs)
        fit = bare.fit(robot.effects)
        for effect, own in zip(fit.effects, estimates_of(bare, fit), strict=True):
            values |= {(effect.name, effect.where, name): e for name, e in own.items()}
    return values, problem.warnings


def _errors(problem: EstimationProblem) -> dict[Quantity, Estimate]:
    """Return the rms of every output with its interval, blocks of the logs being samples."""
    units, found = output_units(problem.robot), {}
    for column, name in enumerate(output_names(problem.robot)):
        blocks = problem.block_means(problem.residual[:, column] ** 2)
        mean = float(np.mean(blocks))
        spread = TAIL * float(np.std(blocks, ddof=1) / np.sqrt(blocks.size))
        low, high = np.sqrt(max(mean - spread, 0.0)), np.sqrt(mean + spread)
        rms = float(np.sqrt(np.mean(problem.residual[:, column] ** 2)))
        found[("", name, "rms error")] = Estimate(rms, units[column], float(low), float(high))
    return found


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
        "rename it, or list it in a file for read_index: columns log, machine, date."
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
