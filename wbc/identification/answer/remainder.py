"""Where a residual is large, what an unexplained one looks like, and what to record next."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from wbc.arrays import FloatArray
from wbc.identification.answer.numbers import plain
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.fit import Fit
from wbc.identification.model.residual import condensed_residual
from wbc.identification.records.outputs import (
    output_gear,
    output_names,
    output_row,
    output_units,
)
from wbc.identification.records.record import Record
from wbc.robot.coordinates import unit_at

_BINS = 12
_MATTERS = 2.0  # floors above which an output is mentioned
_DEPENDS = 0.15  # share of variance above which a dependence is mentioned
# Floors from which on the floor is doubted: a recorded slide keeps 82, low-passed logs kept 58383.
_FILTERED = 100.0
_CLUES = 3  # dependences that are mentioned
_EXPERIMENTS = {
    "acceleration": "move {} fast with small strokes in several poses, with and without a known "
    "weight: the inertia of a link or rotor may be wrong",
    "load": "hold {} still in many poses: the mass or the centre of mass of a link may be wrong",
    "position": "move {} very slowly over its whole range, both ways",
    "rotor angle": "turn {} very slowly and evenly over several turns of its rotor",
    "speed": "turn {} at several constant speeds, both ways",
    "direction": "turn {} at several constant speeds, both ways",
    "mesh power": "lift and lower a known weight with {} slowly",
    "load against direction": "lift and lower known weights with {} slowly",
    "time since reversal": "turn {} back and forth slowly with strokes of several sizes",
    "time": "repeat one motion of {} for several minutes and record the temperature",
    "temperature": "repeat one motion of {} cold and warm",
}
"""Variable on which a remainder depends -> what to record next."""
_ELSEWHERE = "move {0} alone while {1} holds still: what is left at {1} follows the motion of {0}"
_NOT_DRIVEN = "move {0} alone: what is left at {1} follows the motion of {0}"


@dataclass(frozen=True, eq=False)
class Breakdown:
    """The residual of one output over one variable, in bins of equal count.

    Attributes:
        output: joint or coordinate.
        variable: for example `speed`, `load`, `position`.
        unit: of the variable.
        center: (k,) mean of the variable in each bin.
        mean: (k,) mean residual [N m, N].
        rms: (k,) root mean square residual.
        share: how much of the residual's variance the bin means explain, 0 to 1.
    """

    output: str
    variable: str
    unit: str
    center: FloatArray
    mean: FloatArray
    rms: FloatArray
    share: float


def breakdowns(records: Sequence[Record], residuals: Sequence[FloatArray]) -> list[Breakdown]:
    """Return every output's residual over every variable known, strongest share first.

    Args:
        records: the logs.
        residuals: (rows, m + b) condensed residual of each.
    """
    found = []
    robot = records[0].robot
    outputs = output_names(robot)
    stacked = np.concatenate(residuals)
    for column, output in enumerate(outputs):
        for variable, unit, values in _variables(records, column):
            if np.ptp(values) > 0.0:
                stated = unit_at(robot, output, unit)
                found.append(binned(output, variable, stated, values, stacked[:, column]))
    return sorted(found, key=lambda b: -b.share)


def binned(
    output: str, variable: str, unit: str, values: FloatArray, residual: FloatArray
) -> Breakdown:
    """Return the residual (rows,) of an output over a variable (rows,), in bins of equal count."""
    edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, _BINS + 1)))
    index = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
    count = np.maximum(np.bincount(index, minlength=len(edges) - 1), 1)
    mean = np.bincount(index, residual, minlength=len(edges) - 1) / count
    power = np.bincount(index, residual**2, minlength=len(edges) - 1) / count
    center = np.bincount(index, values, minlength=len(edges) - 1) / count
    total = float(np.mean(residual**2))
    share = float(np.sum(count * mean**2) / count.sum() / total) if total > 0.0 else 0.0
    return Breakdown(output, variable, unit, center, mean, np.sqrt(power), share)


def _variables(records: Sequence[Record], column: int) -> list[tuple[str, str, FloatArray]]:
    """Return (name, unit, values (rows,)) for one output."""
    robot = records[0].robot
    row, gear = output_row(robot, column), output_gear(robot, column)
    speed = _rows(records, lambda r: r.motion.velocity[:, row])
    acceleration = _rows(records, lambda r: _accelerations(r)[:, row])
    load = _rows(records, lambda r: r.load[:, row])
    found = [
        ("speed", "rad/s", speed),
        ("acceleration", "rad/s^2", acceleration),
        ("load", "N m", load),
        ("time", "s", np.concatenate([record.time for record in records])),
    ]
    if gear is not None:
        position = _rows(records, lambda r: r.motion.position[:, robot.actuated_position[gear]])
        ratio = float(robot.transmission.gear_ratio[gear])
        found += [
            ("position", "rad", position),
            ("rotor angle", "rad", np.mod(position * ratio, 2.0 * np.pi)),
            ("mesh power", "W", load * speed),
            ("direction", "1", np.sign(speed)),
            ("load against direction", "N m", np.abs(load) * np.sign(speed)),
            ("time since reversal", "s", np.concatenate([_since(r, row) for r in records])),
        ]
        if all(record.motion.temperature is not None for record in records):
            found.append(
                ("temperature", "deg C", _rows(records, lambda r: _temperatures(r)[:, gear]))
            )
    for name in records[0].forces:
        force = [record.thinned(np.linalg.norm(record.forces[name], axis=1)) for record in records]
        found.append((f"force at {name}", "N", np.concatenate(force)))
    return found


def _rows(records: Sequence[Record], read: Callable[[Record], FloatArray]) -> FloatArray:
    return np.concatenate([record.thinned(read(record)) for record in records])


def _accelerations(record: Record) -> FloatArray:
    values = record.motion.acceleration
    return np.zeros_like(record.motion.velocity) if values is None else values


def _temperatures(record: Record) -> FloatArray:
    values = record.motion.temperature
    return np.zeros_like(record.torque) if values is None else values


def _since(record: Record, row: int) -> FloatArray:
    """Return the time since the joint last changed direction, (rows,) [s]."""
    sign = np.sign(record.motion.velocity[:, row])
    changed = np.flatnonzero(np.diff(sign) != 0.0) + 1
    index = np.arange(len(sign))
    last = np.zeros(len(sign))
    last[changed] = changed
    return record.thinned((index - np.maximum.accumulate(last)) / record.rate)


@dataclass(frozen=True)
class Remainder:
    """What is left unexplained at one output.

    Attributes:
        output: joint or coordinate.
        size: root mean square, in `unit`.
        unit: N m or N.
        floors: the same in noise floors.
        clues: variables on which it depends, with shares of its variance, strongest first.
        elsewhere: the other joint whose motion it follows more than its own; empty if none.
        growth: its size in the last third of the logs over that in the first.
        memory: whether it builds up after every reversal.
        driven: whether a motor moves it.
    """

    output: str
    size: float
    unit: str
    floors: float
    clues: tuple[tuple[str, float], ...]
    elsewhere: str
    growth: float
    memory: bool
    driven: bool = True

    @property
    def text(self) -> str:
        """One sentence."""
        said = [f"{name} ({100.0 * share:.0f} %)" for name, share in self.clues]
        text = f"{self.output}: {self.size:.2g} {self.unit} left, "
        if self.floors > _FILTERED:
            text += "far above the noise floor (low-passed logs hide noise: their floor is too low)"
        else:
            text += f"{plain(self.floors, 2)} times the noise floor"
        text += f", follows {', '.join(said)}" if said else ", follows no single variable"
        if self.growth > 1.5:
            text += f", grows {self.growth:.1f}-fold during a log"
        if self.memory:
            text += ", builds up after every reversal (memory)"
        return text + "."

    @property
    def experiment(self) -> str:
        """What to record to learn more of it; empty where nothing is known of it."""
        name = self.output
        if self.elsewhere:
            text = _ELSEWHERE if self.driven else _NOT_DRIVEN
            return text.format(self.elsewhere, name)
        if not self.driven:
            return ""  # nobody holds it still, or turns it
        if self.memory:
            return _EXPERIMENTS["time since reversal"].format(name)
        known = [_EXPERIMENTS[clue] for clue, _ in self.clues if clue in _EXPERIMENTS]
        return known[0].format(name) if known else ""


def remainders(problem: EstimationProblem, fit: Fit) -> tuple[Remainder, ...]:
    """Return what is left at every output with an unexplained residual.

    Args:
        problem: the logs.
        fit: the model whose residual is described.
    """
    records = problem.records
    parts = [condensed_residual(fit.robot, [record]) for record in records]
    given = [condensed_residual(problem.robot, [record]) for record in records]
    found = breakdowns(records, parts)
    result = []
    units = output_units(records[0].robot)
    for column, name in enumerate(output_names(records[0].robot)):
        values = [part[:, column] for part in parts]
        size = float(np.sqrt(np.mean(np.concatenate(values) ** 2)))
        floor = float(problem.floor.values[column])
        if size < _MATTERS * floor or column in problem.floor.aside:
            continue
        own = [b for b in found if b.output == name and b.share > _DEPENDS]
        other = _elsewhere(records, values, column, own)
        clues = [(b.variable, b.share) for b in own]
        clues += [(other.variable, other.share)] if other else []
        speeds = [_speed(record, column) for record in records]
        result.append(
            Remainder(
                output=name,
                size=size,
                unit=units[column],
                floors=size / floor,
                clues=tuple(sorted(clues, key=lambda clue: -clue[1])[:_CLUES]),
                elsewhere=other.variable.rpartition(" of ")[2] if other else "",
                growth=_growth(values),
                # Partial explanations blur the trace of a memory: the robot as given shows it, too.
                memory=_memory(values, speeds)
                or _memory([part[:, column] for part in given], speeds),
                driven=output_gear(records[0].robot, column) is not None,
            )
        )
    return tuple(result)


def describe(left: Sequence[Remainder]) -> str:
    """Return a sentence per output: how much is left, and on what it depends."""
    return " ".join(one.text for one in left)


def _elsewhere(
    records: Sequence[Record],
    values: Sequence[FloatArray],
    column: int,
    own: Sequence[Breakdown],
) -> Breakdown | None:
    """Return the motion of another joint that what is left follows more than its own, if any."""
    robot = records[0].robot
    names = output_names(records[0].robot)
    residual = np.concatenate(list(values))
    best: Breakdown | None = None
    for other in range(robot.transmission.size):
        if other == output_gear(robot, column):
            continue
        row = int(robot.actuated[other])
        speed = np.concatenate([r.thinned(r.motion.velocity[:, row]) for r in records])
        if np.ptp(speed) > 0.0:
            name = f"speed of {names[other]}"
            one = binned(names[column], name, "rad/s", speed, residual)
            best = one if best is None or one.share > best.share else best
    least = max([_DEPENDS, *(b.share for b in own)])
    return best if best is not None and best.share > least else None


def _growth(values: list[FloatArray]) -> float:
    """Return the size in the last third of the logs over that in the first."""
    first = np.concatenate([v[: len(v) // 3] for v in values])
    last = np.concatenate([v[-(len(v) // 3) :] for v in values])
    return float(np.sqrt(np.mean(last**2) / max(float(np.mean(first**2)), 1e-300)))


def _speed(record: Record, column: int) -> FloatArray:
    """Return the speed (rows,) of the coordinate behind an output."""
    return record.thinned(record.motion.velocity[:, output_row(record.robot, column)])


def _memory(values: list[FloatArray], speeds: list[FloatArray]) -> bool:
    """Whether the residual changes gradually after reversals, as hysteresis does."""
    early, late = [], []
    for residual, speed in zip(values, speeds, strict=True):
        sign = np.sign(speed)
        toward = residual * sign
        changed = np.flatnonzero(np.diff(sign) != 0.0) + 1
        for start, stop in pairwise(changed):
            third = (stop - start) // 3
            if third >= 2:
                early.append(float(np.mean(toward[start : start + third])))
                late.append(float(np.mean(toward[stop - third : stop])))
    if len(early) < 6:
        return False
    difference = np.array(late) - np.array(early)
    score = float(np.mean(difference) / (np.std(difference) / np.sqrt(difference.size)))
    return abs(score) > 4.0
