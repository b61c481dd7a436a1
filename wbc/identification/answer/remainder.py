"""What is left: where it is large, what any model could still explain, what to record next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.identification.answer.shown import plain
from wbc.identification.choice.constancy import Variables, quantities
from wbc.identification.choice.evidence import Key
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.fit import Fit
from wbc.identification.model.residual import condensed_residual
from wbc.identification.records import record as rows
from wbc.identification.records.record import Record
from wbc.robot.coordinates import unit_at
from wbc.tables import FEW

_BINS = 12
_MATTERS = 2.0  # floors above which an output is mentioned
_DEPENDS = 0.15  # share of variance above which a dependence is mentioned
_MANY = 100.0  # floors from which on they are not counted: a recorded slide keeps 82
# Variable on which a remainder depends -> what to record next.
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


def dependences(
    records: Sequence[Record],
    residual: FloatArray,
    column: int,
    each: Sequence[Variables] | None = None,
) -> list[Breakdown]:
    """Return one output's residual over every variable, strongest share first.

    Args:
        records: the logs.
        residual: (rows,) of the output.
        column: number of the output.
        each: variables of every log; all that its torque may depend on when left out.
    """
    robot, found = records[0].robot, []
    output = rows.output_names(robot)[column]
    each = [quantities(record, column) for record in records] if each is None else each
    for variable, (unit, _) in each[0].items():
        if any(variable not in own for own in each):
            continue
        pairs = zip(records, each, strict=True)
        values = np.concatenate([record.thinned(own[variable][1]) for record, own in pairs])
        if np.ptp(values) > 0.0:
            index = rows.bins_of(values, _BINS)
            power = rows.block_means(residual**2, index)
            center, mean = (rows.block_means(x, index) for x in (values, residual))
            share, stated = rows.explained_by(index, residual), unit_at(robot, output, unit)
            found.append(Breakdown(output, variable, stated, center, mean, np.sqrt(power), share))
    return sorted(found, key=lambda b: -b.share)


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
    records, robot, found = problem.records, problem.records[0].robot, []
    after = condensed_residual(fit.robot, records)
    sizes, names, units = rows.rms(after), rows.output_names(robot), rows.output_units(robot)
    floors = sizes / problem.floor.values
    for column in problem.floor.judged[floors[problem.floor.judged] >= _MATTERS].tolist():
        left = after[:, column]
        own = [b for b in dependences(records, left, column) if b.share > _DEPENDS]
        other = _elsewhere(records, left, column, own)
        clues = [(b.variable, b.share) for b in (*own, *other)]
        remainder = Remainder(
            output=names[column],
            size=float(sizes[column]),
            unit=units[column],
            floors=float(floors[column]),
            clues=tuple(sorted(clues, key=lambda clue: -clue[1])[:FEW]),
            elsewhere=other[0].variable.rpartition(" of ")[2] if other else "",
            # Partial explanations blur the trace of a memory: the robot as given shows it, too.
            memory=any(_memory(records, r[:, column], column) for r in (after, problem.residual)),
            driven=rows.output_gear(robot, column) is not None,
        )
        found.append(remainder)
    return tuple(found)


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
    added = condensed_residual(without, records) - condensed_residual(fit.robot, records)
    sizes = rows.rms(added)
    floors = sizes / problem.floor.values
    floors[list(problem.floor.aside)] = 0.0
    worst = int(np.argmax(floors))
    size = f"{plain(float(sizes[worst]), 2)} {rows.output_units(robot)[worst]}"
    own = [b for b in dependences(records, added[:, worst], worst) if b.share > _DEPENDS]
    follows = _follows([(b.variable, b.share) for b in own[:FEW]])
    return f"{size} at {rows.output_names(robot)[worst]}, which {follows}"


def _elsewhere(
    records: Sequence[Record], residual: FloatArray, column: int, own: Sequence[Breakdown]
) -> list[Breakdown]:
    """Return the motion of another joint that what is left follows more than its own, if any."""
    robot = records[0].robot
    gear, joints = rows.output_gear(robot, column), robot.transmission.joints
    others = {f"speed of {joint}": k for k, joint in enumerate(joints) if k != gear}
    each: list[Variables] = [
        {name: ("rad/s", r.motion.velocity[:, robot.actuated[k]]) for name, k in others.items()}
        for r in records
    ]
    least = max([_DEPENDS, *(b.share for b in own)])
    return [b for b in dependences(records, residual, column, each) if b.share > least][:1]


def _memory(records: Sequence[Record], values: FloatArray, column: int) -> bool:
    """Whether the residual (rows,) changes gradually after reversals, as hysteresis does."""
    early, late = [], []
    for residual, record in zip(rows.by_log(records, values), records, strict=True):
        row = rows.output_row(record.robot, column)
        sign = np.sign(record.thinned(record.motion.velocity[:, row]))
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
    spread = rows.rms(features)
    a = features[:, spread > 1e-9 * spread.max(initial=1e-300)]
    a = a / rows.rms(a)
    inside = [folds == fold for fold in np.unique(folds)]
    grams = np.array([a[own].T @ a[own] for own in inside])
    moments = np.array([a[own].T @ residual[own] for own in inside])
    known, along = grams.sum(axis=0) - grams, moments.sum(axis=0) - moments
    best = float(np.mean(residual**2))
    for ridge in _RIDGES:
        weak = ridge * len(residual) * np.eye(a.shape[1])
        solutions = np.linalg.solve(known + weak, along[:, :, None])[:, :, 0]
        pairs = zip(inside, solutions, strict=True)
        left = sum(float(np.sum((residual[own] - a[own] @ x) ** 2)) for own, x in pairs)
        best = min(best, left / len(residual))
    return best


def _features(record: Record, output: int) -> FloatArray:
    """Return (rows, F) what the torque at one output may depend on, in the residual's band."""
    from wbc.mechanics.series import memories  # it loads the compiler

    robot, seen = record.robot, quantities(record, output)
    row, gear = rows.output_row(robot, output), rows.output_gear(robot, output)
    velocity, a = record.motion.velocity, np.asarray(record.motion.acceleration)
    time = np.linspace(-1.0, 1.0, len(velocity))
    own = [_scaled(x) for x in (*(seen[n][1] for n in ("speed", "acceleration", "load")), time)]
    columns: list[FloatArray] = [np.ones(len(time)), *own]
    columns += [x * y for k, x in enumerate(own) for y in own[k:]]
    shares = np.linspace(0.0, 1.0, _KNOTS + 2)[1:-1]  # any bent line over x
    columns += [np.maximum(x - knot, 0.0) for x in own[:3] for knot in np.quantile(x, shares)]
    ways = [np.tanh(own[0] / slow) for slow in _SLOW]
    if gear is not None:
        position, ratio = seen["position"][1], float(robot.transmission.gear_ratio[gear])
        travel = float(np.ptp(position)) or 1.0  # it may stand still in one log of several
        share = (position - position.min()) / travel
        slow = [np.pi * k * share for k in range(1, 2 * _WAVES + 1, 2)]
        waves = [f(angle) for angle in slow for f in (np.sin, np.cos)]
        turns = [f(k * ratio * position) for k in range(1, _TURNS + 1) for f in (np.sin, np.cos)]
        there = _scaled(share - share.mean())
        columns += [*waves, *turns, *memories(position), *(wave * ways[-1] for wave in waves)]
        columns += [there * own[0], there**2, there**3]
    speed, load = np.sqrt(np.abs(own[0])), np.abs(own[2])
    columns += [
        x for way in ways for x in (way, *(way * x for x in own[1:]), load * way, speed * way)
    ]
    others = [k for k in range(velocity.shape[1]) if k != row]
    columns += [_scaled(x[:, k]) for k in others for x in (velocity, a)]
    columns += [np.tanh(_scaled(velocity[:, k]) / _SLOW[1]) for k in others]
    columns += [_scaled(record.motion.position[:, k]) for k in robot.actuated_position]
    return record.condensed_at(np.stack(columns, axis=1), output)


def _scaled(values: FloatArray) -> FloatArray:
    size = float(np.sqrt(np.mean(values**2)))
    return np.asarray(values / size if size > 0.0 else values)
