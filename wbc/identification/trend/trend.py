"""What changes from day to day in sessions of machines, and which slopes are no chance.

Every session has its interval; sessions also differ by more than that (temperature, mounting).
This scatter is taken to be the same for the machines given and is estimated from all of them
together (Paule and Mandel): the more machines, the surer it is. A slope is judged by Student's t;
of many slopes judged at once one in twenty may be wrong altogether (Holm).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import datetime
from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.stats import t as student

from wbc.arrays import FloatArray
from wbc.errors import IdentificationError
from wbc.files import as_json
from wbc.identification.answer.diagnosis import Estimate
from wbc.identification.model.intervals import TAIL
from wbc.identification.trend.sessions import (
    Quantity,
    Run,
    SessionResult,
    measure_session,
    sessions_of,
)
from wbc.parallel import run_jobs
from wbc.progress import Watch
from wbc.robot.effect import spoken

WRONG = 0.05
"""Chance that any of the slopes called a drift is none."""
_QUANTITY = ("effect", "where", "parameter")
_EXACT = 1e-6  # of the largest value: an interval without width is not without error


@dataclass(frozen=True, eq=False)
class Points:
    """One quantity of one machine.

    Attributes:
        time: (n,) [days].
        value: (n,).
        deviation: (n,) standard deviation of each value.
    """

    time: FloatArray
    value: FloatArray
    deviation: FloatArray


@dataclass(frozen=True)
class Line:
    """A straight line through points.

    Attributes:
        middle: mean time, weighted [days].
        level: value there.
        slope: per day.
        deviation: standard deviation of the slope; infinite for points at one time.
        chance: probability of so steep a slope without any drift; NaN where no machine has three
            sessions.
    """

    middle: float
    level: float
    slope: float
    deviation: float
    chance: float


def fit_lines(points: Mapping[str, Points]) -> tuple[dict[str, Line], float]:
    """Return a line per machine, and the scatter between sessions beyond their intervals.

    Args:
        points: machine -> one quantity of it.
    """
    sizes = np.concatenate([np.abs(p.value) for p in points.values()])
    least = _EXACT * float(sizes.max(initial=0.0)) + 1e-300
    freedom = sum(max(_times(p) - 2, 0) for p in points.values())

    def excess(scatter: float) -> float:
        return sum(_misfit(p, scatter, least) for p in points.values()) - freedom

    scatter = 0.0
    if freedom > 0 and excess(0.0) > 0.0:
        most = max(float(np.ptp(p.value)) for p in points.values()) + least
        while excess(most) > 0.0:
            most *= 2.0
        scatter = float(brentq(excess, 0.0, most, xtol=1e-4 * most))
    return {name: _line(p, scatter, least, freedom) for name, p in points.items()}, scatter


def no_chance(chances: Sequence[float]) -> list[bool]:
    """Return which of many probabilities are too small for chance, at `WRONG` altogether."""
    order = sorted((k for k, p in enumerate(chances) if np.isfinite(p)), key=lambda k: chances[k])
    found = [False] * len(chances)
    for rank, k in enumerate(order):
        if chances[k] * (len(order) - rank) > WRONG:
            break
        found[k] = True
    return found


def _times(points: Points) -> int:
    return int(np.unique(points.time).size)


def _weights(points: Points, scatter: float, least: float) -> FloatArray:
    return np.asarray(1.0 / (np.maximum(points.deviation, least) ** 2 + scatter**2))


def _misfit(points: Points, scatter: float, least: float) -> float:
    """Return the sum of squares about the line in standard deviations; 0 through two points."""
    if _times(points) < 3:
        return 0.0
    line = _line(points, scatter, least, 1)
    away = points.value - line.level - line.slope * (points.time - line.middle)
    return float(np.sum(_weights(points, scatter, least) * away**2))


def _line(points: Points, scatter: float, least: float, freedom: int) -> Line:
    weight = _weights(points, scatter, least)
    middle = float(np.average(points.time, weights=weight))
    level = float(np.average(points.value, weights=weight))
    away = points.time - middle
    lever = float(np.sum(weight * away**2))
    if _times(points) < 2:
        return Line(middle, level, 0.0, np.inf, np.nan)
    slope = float(np.sum(weight * away * points.value)) / lever
    deviation = 1.0 / np.sqrt(lever)
    chance = 2.0 * float(student.sf(abs(slope) / deviation, freedom)) if freedom else np.nan
    return Line(middle, level, slope, float(deviation), chance)


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
            {"machine": session.machine, "date": session.date}
            | dict(zip(_QUANTITY, quantity, strict=True))
            | asdict(estimate)
            for session in self.sessions
            for quantity, estimate in session.values.items()
        ]

    def to_json(self) -> dict[str, Any]:
        """Return plain numbers, texts, lists and dictionaries."""
        return {
            "sentence": self.sentence,
            "drifting": list(dict.fromkeys(drift.machine for drift in self.drifting)),
            "drifts": [
                dict(zip(_QUANTITY, d.quantity, strict=True)) | as_json(d) for d in self.drifts
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
    watch: Watch | None = None,
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
        watch: called with the sessions done and their total.

    Raises:
        IdentificationError: no run, or no session that can be measured.
        ParallelError: workers is 0.
    """
    sessions = sessions_of(robot, runs, columns, lossless)
    results: list[SessionResult] = []
    for result in run_jobs(measure_session, sessions, workers):
        results.append(result)
        if watch:
            watch(len(results), len(sessions))
    if all(result.failure for result in results):
        raise IdentificationError(f"no session can be measured; the first: {results[0].failure}")
    drifts, scatter = _drifts(results)
    return Trend(tuple(results), drifts, scatter)


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
        np.array([(e.high - e.low) / (2.0 * TAIL) for e in estimates]),
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
