"""What any model could leave on these logs, as far as motion, load and time tell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.fit import Fit
from wbc.identification.records.outputs import output_gear, output_row
from wbc.identification.records.record import Record

_FOLDS = 5  # of interleaved blocks, each predicted from the others
_RIDGES = (1e-4, 1e-3, 1e-2, 1e-1, 1.0)  # shares of the mean square of a column
_SLOW = (0.05, 0.3)  # of the rms speed, over which a direction turns round
_BRISTLES = (0.01, 0.05, 0.2)  # of the travel, over which a memory follows the direction
_KNOTS = 8  # of bent lines over speed, acceleration and load
_WAVES = 4  # periods over the travel, and ...
_TURNS = 2  # ... of a turn of the rotor


@dataclass(frozen=True, eq=False)
class Attainable:
    """The mean squares (outputs,) in floors that a robot leaves, and that any model would leave.

    Attributes:
        left: of the robot.
        attainable: with a flexible regression of what is left on motion, load and time, held out;
            or the noise floor, where runs repeat one another.
        samples: independent samples of what is left.
        whiteness: the same as a share of those of white noise.
        numbers: how many the regression has.
    """

    left: FloatArray
    attainable: FloatArray
    samples: FloatArray
    whiteness: FloatArray
    numbers: int

    @property
    def excess(self) -> FloatArray:
        """(outputs,) mean squares above the floor that are left unexplained.

        What forgets itself as fast as noise is noise but for the share that the regression
        explains, or that so few samples could hide from its many numbers: then the floor of the
        sensors was too low. The rest of it is unexplained.
        """
        nats = 0.5 * self.samples * np.log(self.left / np.maximum(self.attainable, 1e-300))
        hidden = 1.0 - np.exp(-2.0 * (nats + 0.5 * self.numbers) / self.samples)
        share = 1.0 - self.whiteness * (1.0 - hidden)
        return np.asarray(share * np.maximum(self.left - 1.0, 0.0))


def attainable(problem: EstimationProblem, fit: Fit) -> Attainable:
    """Return what a robot leaves on its logs beside what any model would.

    Args:
        problem: the logs.
        fit: of the robot.
    """
    left = np.mean(fit.residual**2, axis=0)
    samples = problem.independent_samples(fit.residual)
    whiteness = np.minimum(samples / problem.white_samples, 1.0)
    count = len(fit.residual)
    if problem.floor.repeats:
        # The floor is known: whatever is above it is no noise.
        return Attainable(left, np.minimum(left, 1.0), samples * count, np.zeros_like(left), 0)
    reached, numbers = _reached(problem, fit)
    return Attainable(left, np.minimum(reached, left), samples * count, whiteness, numbers)


def _reached(problem: EstimationProblem, fit: Fit) -> tuple[FloatArray, int]:
    """Return what regressions leave at each output, and how many numbers one has."""
    folds = _interleaved(problem.blocks)
    kept = [k for k in range(problem.residual.shape[1]) if k not in problem.floor.aside]
    reached, numbers = [], 0
    for column, output in enumerate(kept):
        features = np.concatenate([_features(r, output) for r in problem.records])
        reached.append(_held_out(features, fit.residual[:, column], folds))
        numbers = max(numbers, features.shape[1])
    return np.array(reached), numbers


def _interleaved(blocks: IntArray) -> IntArray:
    _, index = np.unique(blocks, return_inverse=True)
    return np.asarray(index % _FOLDS)


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
    robot = record.robot
    row, gear = output_row(robot, output), output_gear(robot, output)
    velocity = record.motion.velocity
    acceleration = record.motion.acceleration
    a = np.zeros_like(velocity) if acceleration is None else acceleration
    load = record.load[:, row]
    time = np.linspace(-1.0, 1.0, len(load))
    own = [_scaled(x) for x in (velocity[:, row], a[:, row], load, time)]
    columns: list[FloatArray] = [np.ones(len(load)), *own]
    columns += [x * y for k, x in enumerate(own) for y in own[k:]]
    columns += [bend for x in own[:3] for bend in _bends(x)]
    ways = [np.tanh(own[0] / slow) for slow in _SLOW]
    if gear is not None:
        position = record.motion.position[:, robot.actuated_position[gear]]
        columns += _over_travel(position, own[0], ways, robot.transmission.gear_ratio[gear])
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
    weight = record.scale[:, output][:, None]
    return record.condense_driven(np.stack(columns, axis=1) * weight)


def _over_travel(
    position: FloatArray, speed: FloatArray, ways: Sequence[FloatArray], ratio: float
) -> list[FloatArray]:
    """Return waves over the travel and the rotor's turn, and memories of the direction."""
    travel = float(np.ptp(position)) or 1.0  # a joint may stand still in one log of several
    share = (position - position.min()) / travel
    waves = [f(np.pi * k * share) for k in range(1, 2 * _WAVES + 1, 2) for f in (np.sin, np.cos)]
    turns = [f(k * ratio * position) for k in range(1, _TURNS + 1) for f in (np.sin, np.cos)]
    memories = [_bristle(position, length * travel) for length in _BRISTLES]
    scaled = _scaled(share - share.mean())
    return [
        *waves, *turns, *memories, *(wave * ways[-1] for wave in waves), scaled * speed,
        scaled**2, scaled**3,
    ]  # fmt: skip


def _bends(values: FloatArray) -> list[FloatArray]:
    """Return max(x - k, 0) for knots k at even shares of the values: any bent line over x."""
    knots = np.quantile(values, np.linspace(0.0, 1.0, _KNOTS + 2)[1:-1])
    return [np.maximum(values - knot, 0.0) for knot in knots]


def _bristle(position: FloatArray, length: float) -> FloatArray:
    """Return dz/ds = sgn(v) - z over the length, along the path s: a memory of the direction."""
    way = np.diff(position, prepend=position[:1])
    keep = np.exp(-np.abs(way) / length)
    toward = np.sign(way) * (1.0 - keep)
    memory = np.zeros(len(way))
    for k in range(1, len(way)):
        memory[k] = keep[k] * memory[k - 1] + toward[k]
    return memory


def _scaled(values: FloatArray) -> FloatArray:
    size = float(np.sqrt(np.mean(values**2)))
    return np.asarray(values / size if size > 0.0 else values)
