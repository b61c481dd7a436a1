"""What changes from day to day in logs of machines, and which changes are no chance.

Every session has its interval. Sessions also differ by more than that, through temperature or
mounting. This scatter is taken to be the same for the machines given, and is estimated from all of
them together (Paule & Mandel, 1982). A slope is judged by Student's t. Of many slopes that are
judged at once, one in twenty may be wrong altogether (Holm, 1979).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.stats import t as student

from wbc.arrays import FloatArray
from wbc.errors import IdentificationError, LogError
from wbc.files import as_json
from wbc.identification.answer.diagnosis import Estimate
from wbc.identification.answer.findings import estimates_of
from wbc.identification.answer.shown import plain, with_deviation
from wbc.identification.model.estimation_problem import TAIL, EstimationProblem
from wbc.identification.records.record import output_names, output_units
from wbc.measurement import load_logs
from wbc.parallel import Watch, run_jobs
from wbc.robot import Robot
from wbc.robot.effect import spoken
from wbc.tables import TextTable

WRONG = 0.05
"""Chance that any of the slopes called a drift is none."""
_EXACT = 1e-6  # of the largest value: an interval without width is not without error
_ERROR = "rms error at "
_DATE = re.compile(
    r"(?<!\d)(20\d\d)[-_]?(0[1-9]|1[0-2])[-_]?(0[1-9]|[12]\d|3[01])"
    r"(?:[T_ -]([01]\d|2[0-3])[-:h]?([0-5]\d)(?:[-:m]?([0-5]\d))?)?(?!\d)"
)


@dataclass(frozen=True, eq=False)
class Session:
    """All logs of one machine with one date, and what they say.

    Attributes:
        machine: whose logs they are.
        date: when they were recorded, ISO 8601.
        logs: their paths.
        values: quantity in words -> estimate with its 90 % interval.
        failure: why there are none, empty otherwise.
    """

    machine: str
    date: str
    logs: tuple[str, ...]
    values: Mapping[str, Estimate] = field(default_factory=dict)
    failure: str = ""


def find_sessions(paths: Iterable[str | Path]) -> tuple[Session, ...]:
    """Return the sessions of logs, in order of machine and date.

    The date stands in the name of the file or of a folder above it (2026-03-01, 20260301,
    2026-03-01T14-30). The machine is the folder where files with a date lie in several folders;
    else what stands in the file's name before the date.

    Raises:
        LogError: no date in a path.
    """
    files, grouped = [Path(path) for path in paths], dict[tuple[str, str], list[str]]()
    several = len({file.parent for file in files if _DATE.search(file.stem)}) > 1
    for file in files:
        named, folder = _DATE.search(file.stem), file.resolve().parent.name
        found = [named, *(_DATE.search(above.name) for above in file.parents)]
        try:
            date = next(datetime(*(int(x or 0) for x in f.groups())) for f in found if f)  # type: ignore[arg-type]
        except (StopIteration, ValueError) as cause:
            raise LogError(
                f"'{file}': no date in the name of the file or of a folder above it, such as "
                "2026-03-01: rename it."
            ) from cause
        before = file.stem[: named.start()].strip("_- .") if named else file.stem
        machine = folder if several and named else before or folder
        grouped.setdefault((machine, date.isoformat()), []).append(str(file))
    return tuple(Session(*key, tuple(logs)) for key, logs in sorted(grouped.items()))


@dataclass(frozen=True)
class Drift:
    """One quantity of one machine over time.

    Attributes:
        machine: which.
        quantity: in words.
        first, last: estimates of the first and the last session.
        days: between them.
        change: by which the line through all sessions rises from the first to the last.
        deviation: standard deviation of the change.
        chance: probability of such a change without any drift; NaN where no machine has three
            sessions.
    """

    machine: str
    quantity: str
    first: Estimate
    last: Estimate
    days: float
    change: float
    deviation: float
    chance: float


@dataclass(frozen=True, eq=False)
class Trend:
    """What sessions of one or many machines say over time.

    Attributes:
        sessions: in order of machine and date.
        drifting: the changes that are no chance, the surest first.
        others: the changes that may be chance.
    """

    sessions: tuple[Session, ...]
    drifting: tuple[Drift, ...]
    others: tuple[Drift, ...]

    @property
    def sentence(self) -> str:
        """Which machine drifts, as a person would say it."""
        machines = [session.machine for session in self.sessions if not session.failure]
        seen = f"sessions: {len(machines)}, machines: {len(set(machines))}"
        if self.drifting:
            names, worst = list(dict.fromkeys(d.machine for d in self.drifting)), self.drifting[0]
            return (
                f"{', '.join(names)} {'drift' if names[1:] else 'drifts'} ({seen}). Surest: "
                f"{worst.quantity} of {worst.machine}, {worst.first.value:.3g} -> "
                f"{worst.last.value:.3g} {worst.first.unit} in {worst.days:.0f} days."
            )
        if all(np.isnan(drift.chance) for drift in self.others):
            return f"Too little to tell: no machine has sessions on three dates ({seen})."
        return f"No machine drifts beyond what its sessions scatter ({seen})."

    def rows(self, sure: bool) -> TextTable:
        """Return the changes that are no chance, or those that may be."""
        cells = []
        for d in self.drifting if sure else self.others:
            ends = plain(d.first.value), plain(d.last.value)
            change = with_deviation(d.change, d.deviation)
            cells.append((d.machine, d.quantity, *ends, change, d.first.unit.removeprefix("1")))
        kind = "drifts" if sure else "no sure drift"
        return TextTable.of(f"{kind}|~|>first|>last|>change|", cells)

    def to_json(self) -> dict[str, Any]:
        """Return plain numbers, texts, lists and dictionaries."""
        return {"sentence": self.sentence, **as_json(self)}


def follow(
    robot: Robot,
    sessions: Sequence[Session],
    columns: str | None = None,
    workers: int = 1,
    watch: Watch = lambda done, total: None,
) -> Trend:
    """Return what changes over time in sessions of machines.

    The effects of the robot are fitted to every session anew, from what was known before they were
    added. The errors are those of the robot as given.

    Args:
        robot: with the effects to follow.
        sessions: from `find_sessions`, or made by hand; one that cannot be measured says why.
        columns: path of a column map.
        workers: processes; -1 takes all cores.
        watch: called with the sessions done and their total.

    Raises:
        IdentificationError: no session can be measured.
        ParallelError: workers is 0.
    """
    measured: list[Session] = []
    for session in run_jobs(partial(_measured, robot, columns), sessions, workers):
        measured.append(session)
        watch(len(measured), len(sessions))
    failures = [session.failure for session in measured if session.failure]
    if len(failures) == len(measured):
        raise IdentificationError(f"no session can be measured. {' '.join(failures[:1])}")
    # An error scatters the more the larger it is: each machine by its own scatter.
    groups: dict[tuple[str, str], dict[str, list[Session]]] = {}
    for session in measured:
        for quantity in session.values:
            alone = session.machine if quantity.startswith(_ERROR) else ""
            machines = groups.setdefault((quantity, alone), {})
            machines.setdefault(session.machine, []).append(session)
    drifts = [drift for (quantity, _), own in groups.items() for drift in _drifts(quantity, own)]
    drifts.sort(key=lambda drift: np.nan_to_num(drift.chance, nan=2.0))
    sure = count_sure([drift.chance for drift in drifts])
    return Trend(tuple(measured), tuple(drifts[:sure]), tuple(drifts[sure:]))


def _measured(robot: Robot, columns: str | None, session: Session) -> Session:
    gears, values = robot.transmission, dict[str, Estimate]()
    ratios = dict(zip(gears.joints, map(float, gears.gear_ratio), strict=True))
    try:
        logs = load_logs(session.logs, columns, gear_ratios=ratios)
        problem = EstimationProblem.from_logs(robot, logs)
        names, units = output_names(problem.robot), output_units(problem.robot)
        for name, unit, square in zip(names, units, problem.residual.T**2, strict=True):
            blocks, mean = problem.block_means(square), float(np.mean(square))
            away = TAIL * float(np.std(blocks, ddof=1) / np.sqrt(blocks.size))
            rms, low, high = np.sqrt([mean, max(mean - away, 0.0), mean + away]).tolist()
            values[_ERROR + name] = Estimate(rms, unit, low, high)
        bare = EstimationProblem.from_logs(robot.without_effects(), logs)
        fit = bare.fit(robot.effects)
        for effect, own in zip(fit.effects, estimates_of(bare, fit), strict=True):
            for name, estimate in own.items():
                values[f"{spoken(f'{name} of {effect.name}')} at {effect.where}"] = estimate
    except Exception as error:  # whatever one log does, the others are measured
        return replace(session, failure=f"{type(error).__name__}: {error}")
    return replace(session, values=values)


def _drifts(quantity: str, machines: Mapping[str, Sequence[Session]]) -> list[Drift]:
    """Return the line of each machine that has two sessions."""
    points, ends = {}, {}
    for machine, sessions in machines.items():
        if len(sessions) < 2:
            continue
        estimates = [session.values[quantity] for session in sessions]
        dates = [datetime.fromisoformat(session.date) for session in sessions]
        days = [(date - dates[0]) / timedelta(days=1) for date in dates]
        deviations = [(e.high - e.low) / (2.0 * TAIL) for e in estimates]
        points[machine] = np.array([days, [e.value for e in estimates], deviations])
        ends[machine] = estimates[0], estimates[-1], days[-1]
    return [
        Drift(name, quantity, *ends[name], slope * ends[name][2], spread * ends[name][2], chance)
        for name, (slope, spread, chance) in fit_lines(points).items()
    ]


def fit_lines(points: Mapping[str, FloatArray]) -> dict[str, tuple[float, float, float]]:
    """Return slope per day, its standard deviation, and the chance of it without drift.

    Args:
        points: machine -> (3, n) times [days], values and their standard deviations, n > 1.

    Returns:
        by machine; the chance is NaN where no machine has three points.
    """
    least = _EXACT * max((float(np.abs(p[1]).max()) for p in points.values()), default=0.0) + 1e-12
    freedom = sum(p.shape[1] - 2 for p in points.values())

    def line(p: FloatArray, scatter: float) -> tuple[float, float, float]:
        """Return slope, its standard deviation, and the squares about the line in deviations."""
        weights = 1.0 / np.hypot(np.maximum(p[2], least), scatter)
        found, covariance = np.polyfit(p[0], p[1], 1, w=weights, cov="unscaled")
        left = weights * (p[1] - np.polyval(found, p[0]))
        return float(found[0]), float(np.sqrt(covariance[0, 0])), float(left @ left)

    def excess(scatter: float) -> float:
        return sum((line(p, scatter)[2] for p in points.values()), -float(freedom))

    scatter = 0.0
    if freedom and excess(0.0) > 0.0:
        most = sum(float(np.ptp(p[1])) * p.shape[1] for p in points.values())
        scatter = float(brentq(excess, 0.0, most, xtol=1e-4 * most))
    lines = {}
    for name, p in points.items():
        slope, deviation, _ = line(p, scatter)
        chance = 2.0 * float(student.sf(abs(slope) / deviation, freedom)) if freedom else np.nan
        lines[name] = slope, deviation, chance
    return lines


def count_sure(chances: Sequence[float]) -> int:
    """Return how many of some probabilities, in rising order, are no chance, at `WRONG` in all."""
    known = np.array(chances)[np.isfinite(chances)]
    return int(np.cumprod(known * np.arange(known.size, 0, -1) <= WRONG).sum())
