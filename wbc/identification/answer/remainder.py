"""What is left: where it is large, what any model could still explain, what to record next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.identification.answer.shown import plain
from wbc.identification.choice.evidence import Key
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.fit import Fit
from wbc.identification.model.residual import condensed_residual
from wbc.identification.records.record import (
    Record,
    bins_of,
    block_means,
    explained_by,
    output_gear,
    output_names,
    output_row,
    output_units,
)
from wbc.robot.coordinates import unit_at
from wbc.tables import FEW

_BINS = 12
_MATTERS = 2.0  # floors above which an output is mentioned
_DEPENDS = 0.15  # share of variance above which a dependence is mentioned
_MANY = 100.0  # floors from which on they are not counted: a recorded slide keeps 82
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
_FOLDS = 5  # of interleaved blocks, each predicted from the others
_RIDGES = (1e-4, 1e-3, 1e-2, 1e-1, 1.0)  # shares of the mean square of a column
_SLOW = (0.05, 0.3)  # of the rms speed, over which a direction turns round
_KNOTS = 8  # of bent lines over speed, acceleration and load
_WAVES = 4  # periods over the travel, and ...
_TURNS = 2  # ... of a turn of the rotor


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
    robot, stacked = records[0].robot, np.concatenate(residuals)
    found = []
    for column, output in enumerate(output_names(robot)):
        each = [quantities(record, column) for record in records]
        for variable, (unit, _) in each[0].items():
            if any(variable not in own for own in each):
                continue
            pairs = zip(records, each, strict=True)
            values = np.concatenate([record.thinned(own[variable][1]) for record, own in pairs])
            if np.ptp(values) > 0.0:
                stated = unit_at(robot, output, unit)
                found.append(binned(output, variable, stated, values, stacked[:, column]))
    return sorted(found, key=lambda b: -b.share)


def binned(
    output: str, variable: str, unit: str, values: FloatArray, residual: FloatArray
) -> Breakdown:
    """Return the residual (rows,) of an output over a variable (rows,), in bins of equal count."""
    index = bins_of(values, _BINS)
    center, mean, power = (block_means(x, index) for x in (values, residual, residual**2))
    share = explained_by(index, residual)
    return Breakdown(output, variable, unit, center, mean, np.sqrt(power), share)


def quantities(record: Record, column: int) -> dict[str, tuple[str, FloatArray]]:
    """Return unit and values (N,) of what the torque at one output may depend on, by name."""
    robot, motion = record.robot, record.motion
    row, gear = output_row(robot, column), output_gear(robot, column)
    speed, load = motion.velocity[:, row], record.load[:, row]
    time = np.arange(len(speed)) / record.rate
    seen = {
        "speed": ("rad/s", speed),
        "acceleration": ("rad/s^2", np.asarray(motion.acceleration)[:, row]),
        "load": ("N m", load),
        "time": ("s", time),
    }
    if gear is not None:
        position = motion.position[:, robot.actuated_position[gear]]
        turned = np.mod(position * float(robot.transmission.gear_ratio[gear]), 2.0 * np.pi)
        way = np.sign(speed)
        # When the joint last changed direction.
        changed = np.where(np.diff(way, prepend=way[:1]) != 0.0, time, 0.0)
        seen |= {
            "position": ("rad", position),
            "rotor angle": ("rad", turned),
            "mesh power": ("W", load * speed),
            "direction": ("1", way),
            "load against direction": ("N m", np.abs(load) * way),
            "time since reversal": ("s", time - np.maximum.accumulate(changed)),
        }
        if motion.temperature is not None:
            seen["temperature"] = ("deg C", motion.temperature[:, gear])
    for name, force in record.forces.items():
        seen[f"force at {name}"] = ("N", np.linalg.norm(force, axis=1))
    return seen


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
        memory: whether it builds up after every reversal.
        driven: whether a motor moves it.
    """

    output: str
    size: float
    unit: str
    floors: float
    clues: tuple[tuple[str, float], ...]
    elsewhere: str
    memory: bool = False
    driven: bool = True

    @property
    def text(self) -> str:
        """One sentence."""
        many = "more than 100" if self.floors > _MANY else plain(self.floors, 2)
        text = f"{self.output}: {self.size:.2g} {self.unit} left, {many} times the noise floor, "
        memory = ", builds up after every reversal (memory)" if self.memory else ""
        return f"{text}{_follows(self.clues)}{memory}."

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
    given = np.split(problem.residual, np.cumsum([record.rows for record in records])[:-1])
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
        clues = [(b.variable, b.share) for b in (*own, *([other] if other else []))]
        row = output_row(records[0].robot, column)
        speeds = [record.thinned(record.motion.velocity[:, row]) for record in records]
        result.append(
            Remainder(
                output=name,
                size=size,
                unit=units[column],
                floors=size / floor,
                clues=tuple(sorted(clues, key=lambda clue: -clue[1])[:FEW]),
                elsewhere=other.variable.rpartition(" of ")[2] if other else "",
                # Partial explanations blur the trace of a memory: the robot as given shows it, too.
                memory=_memory(values, speeds)
                or _memory([part[:, column] for part in given], speeds),
                driven=output_gear(records[0].robot, column) is not None,
            )
        )
    return tuple(result)


def _follows(clues: Sequence[tuple[str, float]]) -> str:
    """Return on which variables a torque depends, in words."""
    said = [f"{name} ({100.0 * share:.0f} %)" for name, share in clues]
    return f"follows {', '.join(said)}" if said else "follows no single variable"


def describe(left: Sequence[Remainder]) -> str:
    """Return a sentence per output: how much is left, and on what it depends."""
    return " ".join(one.text for one in left)


def common_trait(problem: EstimationProblem, fit: Fit, causes: Sequence[Key]) -> str:
    """Return how much torque some causes of a fit add together, and on what it depends, in words.

    Several small causes may stand for one that is in no list: what they share tells more of it than
    each of them does.

    Args:
        problem: the logs.
        fit: with these causes and others.
        causes: names and places of some of them.
    """
    without = problem.robot.with_effects(*(e for e in fit.effects if e.key not in causes))
    records, robot = problem.records, problem.robot
    parts = [
        condensed_residual(without, [record]) - condensed_residual(fit.robot, [record])
        for record in records
    ]
    sizes = np.sqrt(np.mean(np.concatenate(parts) ** 2, axis=0))
    floors = sizes / problem.floor.values
    floors[list(problem.floor.aside)] = 0.0
    worst = int(np.argmax(floors))
    name = output_names(robot)[worst]
    own = [b for b in breakdowns(records, parts) if b.output == name and b.share > _DEPENDS]
    follows = _follows([(b.variable, b.share) for b in own[:FEW]])
    return (
        f"{plain(float(sizes[worst]), 2)} {output_units(robot)[worst]} at {name}, which {follows}"
    )


def _elsewhere(
    records: Sequence[Record], values: Sequence[FloatArray], column: int, own: Sequence[Breakdown]
) -> Breakdown | None:
    """Return the motion of another joint that what is left follows more than its own, if any."""
    robot, residual = records[0].robot, np.concatenate(values)
    output, each = output_names(robot)[column], []
    for other, row in enumerate(robot.actuated.tolist()):
        speed = np.concatenate([r.thinned(r.motion.velocity[:, row]) for r in records])
        if other != output_gear(robot, column) and np.ptp(speed) > 0.0:
            name = f"speed of {robot.transmission.joints[other]}"
            each.append(binned(output, name, "rad/s", speed, residual))
    least = max([_DEPENDS, *(b.share for b in own)])
    return max((b for b in each if b.share > least), key=lambda b: b.share, default=None)


def _memory(values: Sequence[FloatArray], speeds: Sequence[FloatArray]) -> bool:
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
    return bool(difference.size * np.mean(difference) ** 2 > 4.0**2 * np.var(difference))


@dataclass(frozen=True, eq=False)
class Attainable:
    """The mean squares (outputs,) in floors that a robot leaves, and that any model would leave.

    Attributes:
        left: of the robot.
        attainable: with a flexible regression of what is left on motion, load and time, held out;
            or the noise floor, where runs repeat one another.
        excess: what of it, above the floor, is left unexplained.
    """

    left: FloatArray
    attainable: FloatArray
    excess: FloatArray


def attainable(problem: EstimationProblem, fit: Fit) -> Attainable:
    """Return what a robot leaves on its logs beside what any model would.

    What forgets itself as fast as noise is noise but for the share that the regression explains,
    or that so few samples could hide from its many numbers: then the floor of the sensors was too
    low. The rest of it is unexplained.

    Args:
        problem: the logs.
        fit: of the robot.
    """
    left = np.mean(fit.residual**2, axis=0)
    above = np.maximum(left - 1.0, 0.0)
    if problem.floor.repeats:
        # The floor is known: whatever is above it is no noise.
        return Attainable(left, np.minimum(left, 1.0), above)
    features = _features_of(problem)
    folds = np.unique(problem.blocks, return_inverse=True)[1] % _FOLDS  # interleaved
    pairs = zip(features, fit.residual.T, strict=True)
    held_out = np.array([_held_out(own, residual, folds) for own, residual in pairs])
    reached, numbers = np.minimum(held_out, left), max(own.shape[1] for own in features)
    per_row = problem.independent_samples(fit.residual)
    whiteness = np.minimum(per_row / problem.white_samples, 1.0)
    samples = per_row * len(fit.residual)
    nats = 0.5 * samples * np.log(left / np.maximum(reached, 1e-300))
    hidden = 1.0 - np.exp(-2.0 * (nats + 0.5 * numbers) / samples)
    return Attainable(left, reached, (1.0 - whiteness * (1.0 - hidden)) * above)


@lru_cache(maxsize=1)
def _features_of(problem: EstimationProblem) -> list[FloatArray]:
    """Return the features of each output that is judged: an answer asks for them three times."""
    judged = problem.floor.judged.tolist()
    return [np.concatenate([_features(r, output) for r in problem.records]) for output in judged]


def _held_out(features: FloatArray, residual: FloatArray, folds: IntArray) -> float:
    """Return the mean square that a ridge regression leaves on folds it has not seen."""
    spread = np.sqrt(np.mean(features**2, axis=0))
    a = features[:, spread > 1e-9 * spread.max(initial=1e-300)]
    a = a / np.sqrt(np.mean(a**2, axis=0))
    names = np.unique(folds)
    grams = np.array([a[folds == f].T @ a[folds == f] for f in names])
    moments = np.array([a[folds == f].T @ residual[folds == f] for f in names])
    total, moment = grams.sum(axis=0), moments.sum(axis=0)
    best = float(np.mean(residual**2))
    for ridge in _RIDGES:
        left = 0.0
        for k, fold in enumerate(names):
            rest = total - grams[k]
            weak = ridge * len(residual) * np.eye(len(rest))
            solution = np.linalg.solve(rest + weak, moment - moments[k])
            inside = folds == fold
            left += float(np.sum((residual[inside] - a[inside] @ solution) ** 2))
        best = min(best, left / len(residual))
    return best


def _features(record: Record, output: int) -> FloatArray:
    """Return (rows, F) what the torque at one output may depend on, in the residual's band."""
    robot, seen = record.robot, quantities(record, output)
    row, gear = output_row(robot, output), output_gear(robot, output)
    velocity, a = record.motion.velocity, np.asarray(record.motion.acceleration)
    time = np.linspace(-1.0, 1.0, len(velocity))
    own = [_scaled(seen[name][1]) for name in ("speed", "acceleration", "load")] + [_scaled(time)]
    columns: list[FloatArray] = [np.ones(len(time)), *own]
    columns += [x * y for k, x in enumerate(own) for y in own[k:]]
    columns += [bend for x in own[:3] for bend in _bends(x)]
    ways = [np.tanh(own[0] / slow) for slow in _SLOW]
    if gear is not None:
        ratio = float(robot.transmission.gear_ratio[gear])
        columns += _over_travel(seen["position"][1], own[0], ways, ratio)
    for way in ways:
        columns += [
            way,
            *(way * x for x in own[1:]),
            np.abs(own[2]) * way,
            np.sqrt(np.abs(own[0])) * way,
        ]
    others = [k for k in range(velocity.shape[1]) if k != row]
    columns += [_scaled(x[:, k]) for k in others for x in (velocity, a)]
    columns += [np.tanh(_scaled(velocity[:, k]) / _SLOW[1]) for k in others]
    columns += [_scaled(record.motion.position[:, k]) for k in robot.actuated_position]
    return record.condensed_at(np.stack(columns, axis=1), output)


def _over_travel(
    position: FloatArray, speed: FloatArray, ways: Sequence[FloatArray], ratio: float
) -> list[FloatArray]:
    """Return waves over the travel and the rotor's turn, and memories of the direction."""
    from wbc.mechanics.series import memories  # it loads the compiler

    travel = float(np.ptp(position)) or 1.0  # a joint may stand still in one log of several
    share = (position - position.min()) / travel
    waves = [f(np.pi * k * share) for k in range(1, 2 * _WAVES + 1, 2) for f in (np.sin, np.cos)]
    turns = [f(k * ratio * position) for k in range(1, _TURNS + 1) for f in (np.sin, np.cos)]
    scaled = _scaled(share - share.mean())
    return [
        *waves, *turns, *memories(position), *(wave * ways[-1] for wave in waves), scaled * speed,
        scaled**2, scaled**3,
    ]  # fmt: skip


def _bends(values: FloatArray) -> list[FloatArray]:
    """Return max(x - k, 0) for knots k at even shares of the values: any bent line over x."""
    knots = np.quantile(values, np.linspace(0.0, 1.0, _KNOTS + 2)[1:-1])
    return [np.maximum(values - knot, 0.0) for knot in knots]


def _scaled(values: FloatArray) -> FloatArray:
    size = float(np.sqrt(np.mean(values**2)))
    return np.asarray(values / size if size > 0.0 else values)
