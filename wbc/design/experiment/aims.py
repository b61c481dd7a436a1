"""What a motion is to make large, and the slopes of it in the motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.design.experiment.rivals import Cause, Pair, Predictions, Rivals
from wbc.dynamics import rotor_torque
from wbc.robot import Motion, Robot

_SOFT = 10.0
"""Power of the mean that stands for the smallest of several odds where slopes are needed: the
smallest itself has none where two are equal."""


@dataclass(eq=False)
class Pulls:
    """Slopes of an aim in what is read of the torques of rivals, over noise.

    Attributes:
        torque: number of a cause -> (N m,), in its torque at the values expected.
        sensitivity: number of a cause -> (N m, p), in `Predictions.sensitivity`.
    """

    torque: dict[int, FloatArray] = field(default_factory=dict)
    sensitivity: dict[int, FloatArray] = field(default_factory=dict)

    def add(self, other: Pulls, weight: float) -> None:
        """Add the slopes of another aim times a weight."""
        for mine, theirs in ((self.torque, other.torque), (self.sensitivity, other.sensitivity)):
            for number, slope in theirs.items():
                mine[number] = mine.get(number, 0.0) + weight * slope


Climbed = Callable[[Predictions, Sequence[Pair]], tuple[float, Pulls]]
"""A number that a motion is to make large, with its slopes."""


@dataclass(frozen=True)
class Aim:
    """A number that a motion is to make large, given the pairs that a motion can tell apart.

    Attributes:
        value: of a motion's predictions.
        climbed: what is climbed instead, with its slopes; None where only changes at random help.
            It grows where `value` does, but may be a smooth function of it.
    """

    value: Callable[[Predictions, Sequence[Pair]], float]
    climbed: Climbed | None = None

    def __call__(self, found: Predictions, pairs: Sequence[Pair]) -> float:
        """Return the number."""
        return self.value(found, pairs)


def _least_odds(found: Predictions, pairs: Sequence[Pair]) -> float:
    if not pairs:
        return _narrowness(found, pairs)
    return min(found.near_distance(pair) for pair in pairs)


def _soft_least_odds(found: Predictions, pairs: Sequence[Pair]) -> tuple[float, Pulls]:
    """Return the logarithm of a mean of the odds that is near the smallest, and its slopes."""
    if not pairs:
        return _narrowness_slopes(found, pairs)
    parts = [distance_pulls(found, pair) for pair in pairs]
    size = np.log(np.maximum([value for value, _ in parts], 1e-12))
    share = np.exp(_SOFT * (size.min() - size))
    soft = size.min() - np.log(np.sum(share)) / _SOFT
    pulls = Pulls()
    for (_, one), weight in zip(parts, share / np.sum(share) / np.exp(size), strict=True):
        pulls.add(one, float(weight))
    return float(soft), pulls


def distance_pulls(found: Predictions, pair: Pair) -> tuple[float, Pulls]:
    """Return `Predictions.near_distance` and its slopes.

    With values z of the true cause and y of the rival, the distance is the least of
    1/2 |r + A z - B y|^2 + 2 |z|^2 beside a determinant. Where a least is taken, the slopes are
    those at fixed z and y.
    """
    true, other = pair
    apart = found.apart(pair)
    count = len(apart)
    held, root = _held(found, other)
    whole = np.concatenate([apart, np.zeros(len(held) - count)])
    pulls, spread = Pulls(), found.rivals.open_part(true)
    if spread is None:
        fit = np.linalg.lstsq(held, whole)[0]
        left = (whole - held @ fit)[:count]
        value = float(0.5 * np.sum((whole - held @ fit) ** 2))
    else:
        moves = np.zeros((len(held), spread.shape[1]))
        moves[:count] = found.sensitivity(true) @ spread
        both = np.column_stack([whole, moves])
        fits = np.linalg.lstsq(held, both)[0]
        rest = both - held @ fits
        gram, lever = rest[:, 1:].T @ rest[:, 1:], rest[:, 1:].T @ rest[:, 0]
        one = np.eye(len(gram))
        z = np.linalg.solve(4.0 * one + gram, lever)
        end = rest[:, 0] - rest[:, 1:] @ z
        fit, left = fits[:, 0] - fits[:, 1:] @ z, end[:count]
        grown = float(np.linalg.slogdet(one + 0.25 * gram)[1])
        value = float(0.5 * end @ end + 2.0 * z @ z + 2.0 * grown)
        # The determinant: d log det(1 + G/4) = 1/2 tr[(1 + G/4)^-1 M' dM].
        wide = rest[:, 1:] @ np.linalg.inv(one + 0.25 * gram)
        slope = (wide[:count] - np.outer(left, z)) @ spread.T
        pulls.add(Pulls({}, {true: slope}), 1.0)
        pulls.add(Pulls({}, {other: -(wide @ fits[:, 1:].T)[:count] @ root.T}), 1.0)
    pulls.add(Pulls({true: left}, {other: -np.outer(left, fit) @ root.T}), 1.0)
    pulls.add(Pulls({other: -left}), 1.0)
    return value, pulls


def _held(found: Predictions, number: int) -> tuple[FloatArray, FloatArray]:
    """Return what a rival can do (N m [+ p], p), and how its columns come from sensitivities."""
    spread, slopes = found.rivals.open_part(number), found.sensitivity(number)
    if spread is None:
        return slopes, np.eye(slopes.shape[1])
    return np.concatenate([slopes @ spread, np.eye(len(spread))]), spread


def _information(found: Predictions, pairs: Sequence[Pair]) -> float:
    return found.information()


def _information_slopes(found: Predictions, pairs: Sequence[Pair]) -> tuple[float, Pulls]:
    parts = [found.sensitivity(number) for number in range(len(found.rivals.causes))]
    columns = np.concatenate(parts, axis=1)
    known = np.eye(columns.shape[1]) + columns.T @ columns
    slope = 2.0 * np.linalg.solve(known, columns.T).T
    ends = np.cumsum([0, *(part.shape[1] for part in parts)])
    shares = {k: np.asarray(slope[:, ends[k] : ends[k + 1]]) for k in range(len(parts))}
    return found.information(), Pulls({}, shares)


def _narrowness(found: Predictions, pairs: Sequence[Pair]) -> float:
    widths = [found.widths(number) for number in range(len(found.rivals.causes))]
    return -float(np.mean(np.log(np.concatenate(widths))))


def _narrowness_slopes(found: Predictions, pairs: Sequence[Pair]) -> tuple[float, Pulls]:
    """d(-log width_i) = (C e_i)' S' dS (C e_i) / C_ii, with C the inverse of 1 + S' S."""
    shares: dict[int, FloatArray] = {}
    for number in range(len(found.rivals.causes)):
        slopes = found.sensitivity(number)
        spread = np.linalg.inv(np.eye(slopes.shape[1]) + slopes.T @ slopes)
        shares[number] = slopes @ (spread / np.diag(spread)) @ spread
    count = sum(slope.shape[1] for slope in shares.values())
    even: dict[int, FloatArray] = {k: np.asarray(slope / count) for k, slope in shares.items()}
    return _narrowness(found, pairs), Pulls({}, even)


deciding = Aim(_least_odds, _soft_least_odds)
"""The experiment that decides: the smallest expected log-odds; `shrinking` for one cause alone."""

informing = Aim(_information, _information_slopes)
"""A D-optimal experiment."""

shrinking = Aim(_narrowness, _narrowness_slopes)
"""Narrow intervals: minus the mean logarithm of their widths.

The motion with the smallest geometric mean of relative widths, whatever widths they are relative to
and whatever the units: each number counts, and halving any of them is worth the same. A median of
relative widths would let the wider half of the numbers go: climbing it for the shin of the sample
leg takes the middle one of three from 0.52 to 0.47 of a random motion's width, and the mass from
0.62 to 0.81."""


_MOVES = (1e-6, 1e-6, 1e-4)
"""Steps of position [rad, m], velocity and acceleration. Torques have 15 digits and differences
over parameters, of 1e-4 typical sizes, 11: slopes keep five or more."""

Kinematics = tuple[FloatArray, FloatArray, FloatArray]
"""Of positions, velocities and accelerations of the driven joints, each (N, m)."""


def slopes_are_exact(rivals: Rivals, motion: Motion) -> bool:
    """Whether each row of the torques of all rivals follows from that row of the motion alone.

    Not so where an effect remembers (a delay, friction with memory), and where rotors turn with
    links: each evaluation then walks over the rows, which is too slow for slopes.
    """
    if rivals.robot.rotors_turn_with_links:
        return False
    fields = {"velocity": motion.velocity, "acceleration": motion.acceleration, "time": motion.time}
    some = motion.replace(
        position=motion.position[::2],
        **{name: None if rows is None else rows[::2] for name, rows in fields.items()},
    )
    whole, half = rivals.predictions(motion), rivals.predictions(some)
    return all(
        np.allclose(whole.torque(cause)[::2], half.torque(cause), rtol=1e-9, atol=1e-12)
        for cause in rivals.causes
    )


def motion_slopes(found: Predictions, pulls: Pulls, loads: dict[int, FloatArray]) -> Kinematics:
    """Return the slopes of an aim in positions, velocities and accelerations, each (N, m).

    Args:
        found: predictions along the motion, of rivals for which `slopes_are_exact`.
        pulls: slopes of the aim in what is read of the torques.
        loads: more slopes (N, m), in the torques themselves [1/(N m)], of causes by number; -1
            stands for the robot without any.
    """
    sums: FloatArray = np.zeros((3, len(found.motion.position), found.rivals.noise.size))
    near = _Nearby.of(found)
    for cause, slope in _torque_slopes(found, pulls, loads, sums):
        sums += near.pull(cause, slope)
    return sums[0], sums[1], sums[2]


def _torque_slopes(
    found: Predictions, pulls: Pulls, loads: dict[int, FloatArray], sums: FloatArray
) -> list[tuple[Cause, FloatArray]]:
    """Return slopes (N, m) in every torque that is predicted; those of the weights join `sums`."""
    noise, own = found.rivals.noise, dict(loads)
    shape = (len(found.motion.position), noise.size)
    every: list[tuple[Cause, FloatArray]] = []
    for number, flat in pulls.torque.items():
        slope: FloatArray = flat.reshape(shape)
        _add_weights(found, found.expected_torque(number), slope, sums)
        own[number] = own.get(number, 0.0) + found.readable.pull(slope) / noise
    for number, flat in pulls.sensitivity.items():
        here, slope = found.expected_torque(number), flat.reshape(*shape, -1)
        near = found.rivals.neighbours(number)
        columns = np.stack([lever * (found.torque(c) - here) for c, lever in near], axis=2)
        _add_weights(found, columns, slope, sums)
        pulled = found.readable.pull(slope) / noise[:, None]
        for k, (cause, lever) in enumerate(near):
            every.append((cause, lever * pulled[:, :, k]))
            own[number] = own.get(number, 0.0) - lever * pulled[:, :, k]
    causes = found.rivals.causes
    return every + [(causes[n] if n >= 0 else (), slope) for n, slope in own.items()]


def _add_weights(
    found: Predictions, torque: FloatArray, slope: FloatArray, sums: FloatArray
) -> None:
    noise = found.rivals.noise.reshape(-1, *(1,) * (torque.ndim - 2))
    velocity, acceleration = found.readable.weight_pull(torque / noise, slope)
    sums[1] += velocity
    sums[2] += acceleration


@dataclass(frozen=True, eq=False)
class _Nearby:
    """A motion with each joint moved a little in all rows: rows do not know of one another."""

    robot: Robot
    motion: Motion
    moved: tuple[tuple[int, int, FloatArray, Motion], ...]  # kind, joint, steps (N,), motion
    links: tuple[FloatArray, FloatArray]  # of the robot without any cause, as `_links`

    @classmethod
    def of(cls, found: Predictions) -> _Nearby:
        robot, motion, moved = found.rivals.robot, found.motion, []
        names = ("position", "velocity", "acceleration")
        for kind, (name, size) in enumerate(zip(names, _MOVES, strict=True)):
            rows = robot.actuated_position if kind == 0 else robot.actuated
            for joint, row in enumerate(rows):
                # Away from zero, so that no velocity changes its sign.
                sign = np.where(motion.velocity[:, robot.actuated[joint]] < 0.0, -1.0, 1.0)
                values = np.array(getattr(motion, name))
                values[:, row] += size * sign
                moved.append((kind, joint, size * sign, motion.replace(**{name: values})))
        return cls(robot, motion, tuple(moved), _links(robot, motion))

    def pull(self, cause: Cause, slope: FloatArray) -> FloatArray:
        """Return slopes (3, N, m) in the motion, given those (N, m) in the torque with a cause."""
        robot = self.robot.with_effects(*cause)
        here = _true(robot, cause, self.motion)
        shared = robot.model is self.robot.model and here is self.motion
        links, turned = self.links if shared else _links(robot, here)
        base = rotor_torque(robot, here, links)[0]
        result = np.zeros((3, *slope.shape))
        for kind, joint, steps, measured in self.moved:
            there = _true(robot, cause, measured)
            if there is measured:
                near = links + steps[:, None] * turned[kind][:, :, joint]
            else:
                near = links + _change(robot, here, there, turned)
            change = rotor_torque(robot, there, near)[0] - base
            result[kind, :, joint] = np.sum(slope * change, axis=1) / steps
        return result


def _links(robot: Robot, motion: Motion) -> tuple[FloatArray, FloatArray]:
    """Return the torque (N, nv) of the links, and its slopes (3, N, nv, m) in the motion."""
    model, data = robot.model, robot.model.createData()
    torque = np.zeros((len(motion.position), model.nv))
    turned = np.zeros((3, len(torque), model.nv, robot.actuated.size))
    rows = zip(motion.position, motion.velocity, np.asarray(motion.acceleration), strict=True)
    for i, (q, v, a) in enumerate(rows):
        parts = pin.computeRNEADerivatives(model, data, q, v, a)
        torque[i] = data.tau
        for kind, part in enumerate(parts):
            turned[kind, i] = part[:, robot.actuated]
    return torque, turned


def _true(robot: Robot, cause: Cause, motion: Motion) -> Motion:
    for effect in reversed(cause):
        motion = effect.true(robot, motion)
    return motion


def _change(robot: Robot, here: Motion, there: Motion, turned: FloatArray) -> FloatArray:
    """Return how the torque of the links changes between two motions close by, (N, nv)."""
    moves = (
        (there.position - here.position)[:, robot.actuated_position],
        (there.velocity - here.velocity)[:, robot.actuated],
        (np.asarray(there.acceleration) - np.asarray(here.acceleration))[:, robot.actuated],
    )
    return np.asarray(
        sum(np.einsum("nij,nj->ni", t, m) for t, m in zip(turned, moves, strict=True))
    )
