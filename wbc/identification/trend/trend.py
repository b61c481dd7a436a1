"""Sessions of machines measured one by one, and what changes from day to day."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from wbc.errors import IdentificationError
from wbc.identification.answer.diagnosis.diagnosis import Estimate
from wbc.identification.answer.shown import data_frame
from wbc.identification.trend.drift import Line, Points, fit_lines, no_chance
from wbc.identification.trend.measure import (
    DEVIATIONS,
    Quantity,
    Run,
    Session,
    SessionResult,
)
from wbc.identification.trend.stored import (
    SESSION_COLUMNS,
    measured_rows,
    stored_sessions,
    work_key,
    work_names,
)
from wbc.progress import Watch
from wbc.results import ResultTable, fill_table, read_results
from wbc.robot.effect import spoken


@dataclass(frozen=True)
class Drift:
    """One quantity of one machine over time.

    Attributes:
        machine: which.
        quantity: (effect, place, parameter); the effect is empty for the error of an output.
        unit: of the values.
        first: estimate of the first session.
        last: estimate of the last session.
        days: between them.
        change: by which the line through all sessions rises from the first to the last.
        deviation: standard deviation of the change.
        chance: probability of such a change without any drift; NaN for too few sessions.
        drifts: whether the change is no chance, among all that were looked at.
    """

    machine: str
    quantity: Quantity
    unit: str
    first: Estimate
    last: Estimate
    days: float
    change: float
    deviation: float
    chance: float
    drifts: bool

    @property
    def name(self) -> str:
        """The quantity in words."""
        effect, where, parameter = self.quantity
        what = f"{parameter} of {effect}" if effect else parameter
        return f"{spoken(what)} at {where}"


@dataclass(frozen=True, eq=False)
class Trend:
    """What sessions of one or many machines say over time.

    Attributes:
        sessions: in order of machine and date.
        drifts: a line per machine and quantity, the surest drift first.
        scatter: parameter -> standard deviation between sessions beyond their intervals.
    """

    sessions: tuple[SessionResult, ...]
    drifts: tuple[Drift, ...]
    scatter: dict[Quantity, float]

    @property
    def drifting(self) -> tuple[Drift, ...]:
        """The changes that are no chance."""
        return tuple(drift for drift in self.drifts if drift.drifts)

    @property
    def sentence(self) -> str:
        """Which machine drifts, as a person would say it."""
        done = [s for s in self.sessions if not s.failure]
        machines = len({s.machine for s in done})
        seen = f"{len(done)} sessions of {machines} machine{'' if machines == 1 else 's'}"
        names = list(dict.fromkeys(drift.machine for drift in self.drifting))
        if names:
            worst = self.drifting[0]
            return (
                f"{', '.join(names)} {'drifts' if len(names) == 1 else 'drift'} ({seen}). Surest: "
                f"{worst.name} of {worst.machine}, {worst.first.value:.3g} -> "
                f"{worst.last.value:.3g} {worst.unit} in {worst.days:.0f} days."
            )
        if all(np.isnan(drift.chance) for drift in self.drifts):
            return f"Too little to tell: no machine has sessions on three dates ({seen})."
        return f"No machine drifts beyond what its sessions scatter ({seen})."

    def rows(self) -> list[dict[str, Any]]:
        """Return one entry per session and quantity."""
        return [
            {
                "machine": session.machine,
                "date": session.date,
                "effect": effect,
                "where": where,
                "parameter": parameter,
                **asdict(estimate),
            }
            for session in self.sessions
            for (effect, where, parameter), estimate in session.values.items()
        ]

    def to_frame(self) -> Any:
        """Return a pandas frame with a row per session and quantity.

        Raises:
            MissingPackageError: pandas is not installed.
        """
        return data_frame(self.rows())

    def to_json(self) -> dict[str, Any]:
        """Return plain numbers, texts, lists and dictionaries."""
        return {
            "sentence": self.sentence,
            "drifting": list(dict.fromkeys(drift.machine for drift in self.drifting)),
            "drifts": [
                {
                    "machine": d.machine,
                    "effect": d.quantity[0],
                    "where": d.quantity[1],
                    "parameter": d.quantity[2],
                    "unit": d.unit,
                    "first": asdict(d.first),
                    "last": asdict(d.last),
                    "days": d.days,
                    "change": d.change,
                    "deviation": _plain(d.deviation),
                    "chance": _plain(d.chance),
                    "drifts": d.drifts,
                }
                for d in self.drifts
            ],
            "values": self.rows(),
            "failures": [
                {"machine": s.machine, "date": s.date, "logs": list(s.paths), "why": s.failure}
                for s in self.sessions
                if s.failure
            ],
        }


def follow(
    robot: str,
    runs: Sequence[Run],
    *,
    columns: str | None = None,
    lossless: bool = False,
    workers: int = 1,
    cluster: str | None = None,
    watch: Watch | None = None,
    out: str | Path | None = None,
) -> Trend:
    """Measure every session of every machine, and return what changes over time.

    A session is all logs of one machine with one date. The effects of the robot are fitted to it
    anew, from what was known before they were added; the errors are those of the robot as given.

    Args:
        robot: name or path of the robot, usually a fitted.toml.
        runs: the logs with machine and date.
        columns: path of a column map.
        lossless: start from perfect gears.
        workers: processes; -1 takes all cores.
        cluster: address of a Dask scheduler instead.
        watch: called with the sessions done and their total.
        out: Parquet file for a row per session and quantity. Sessions that it holds already, or
            that a killed run left beside it, are not measured again; new ones are added.

    Raises:
        IdentificationError: no run, or no session that can be measured.
        ResultsError: the file holds sessions that are not given, or those of another robot.
        ParallelError: workers is 0, or no cluster at the address.
    """
    sessions = sessions_of(robot, runs, columns, lossless)
    if not sessions:
        raise IdentificationError("no log was given.")
    with TemporaryDirectory() as folder:
        path = Path(out) if out else Path(folder) / "sessions.parquet"
        table = ResultTable(
            path,
            work_key("trend", sessions),
            SESSION_COLUMNS,
            len(sessions),
            work_names(sessions),
        )
        fill_table(
            table,
            measured_rows,
            sessions,
            workers=workers,
            cluster=cluster,
            watch=watch,
        )
        results = stored_sessions(read_results(path), sessions)
    if all(result.failure for result in results):
        raise IdentificationError(f"no session can be measured; the first: {results[0].failure}")
    drifts, scatter = _drifts(results)
    return Trend(tuple(results), drifts, scatter)


def sessions_of(
    robot: str, runs: Sequence[Run], columns: str | None, lossless: bool
) -> list[Session]:
    """Return the sessions of logs, in order of machine and date."""
    grouped: dict[tuple[str, datetime], list[str]] = {}
    for run in runs:
        grouped.setdefault((run.machine, run.date), []).append(run.path)
    return [
        Session(robot, lossless, columns, machine, date.isoformat(), tuple(paths))
        for (machine, date), paths in sorted(grouped.items())
    ]


def _drifts(results: Sequence[SessionResult]) -> tuple[tuple[Drift, ...], dict[Quantity, float]]:
    quantities = dict.fromkeys(q for result in results for q in result.values)
    rows: list[tuple[str, Quantity, Line, list[SessionResult]]] = []
    scatter: dict[Quantity, float] = {}
    for quantity in quantities:
        machines: dict[str, list[SessionResult]] = {}
        for result in results:
            if quantity in result.values:
                machines.setdefault(result.machine, []).append(result)
        points = {name: _points(own, quantity) for name, own in machines.items()}
        if quantity[0]:
            lines, scatter[quantity] = fit_lines(points)
        else:
            # An error scatters the more the larger it is: each machine by its own scatter.
            lines = {name: fit_lines({name: own})[0][name] for name, own in points.items()}
        rows += [(name, quantity, line, machines[name]) for name, line in lines.items()]
    certain = no_chance([line.chance for _, _, line, _ in rows])
    drifts = [
        _drift(name, quantity, line, own, sure)
        for (name, quantity, line, own), sure in zip(rows, certain, strict=True)
    ]
    drifts.sort(key=lambda d: (not d.drifts, d.chance if np.isfinite(d.chance) else 2.0))
    return tuple(drifts), scatter


def days_of(results: Sequence[SessionResult]) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return the times (n,) of sessions in days since 1 January 2000."""
    start = datetime(2000, 1, 1)
    return np.array([(datetime.fromisoformat(r.date) - start).total_seconds() for r in results]) / (
        24.0 * 3600.0
    )


def _points(results: Sequence[SessionResult], quantity: Quantity) -> Points:
    estimates = [result.values[quantity] for result in results]
    return Points(
        days_of(results),
        np.array([e.value for e in estimates]),
        np.array([(e.high - e.low) / (2.0 * DEVIATIONS) for e in estimates]),
    )


def _drift(
    machine: str, quantity: Quantity, line: Line, own: Sequence[SessionResult], sure: bool
) -> Drift:
    times = days_of(own)
    days = float(times[-1] - times[0])
    first, last = own[0].values[quantity], own[-1].values[quantity]
    return Drift(
        machine=machine,
        quantity=quantity,
        unit=first.unit,
        first=first,
        last=last,
        days=days,
        change=line.slope * days,
        deviation=line.deviation * days if days > 0.0 else np.inf,
        chance=line.chance,
        drifts=sure,
    )


def _plain(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
