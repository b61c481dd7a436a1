"""Searching the motion that decides best; random and D-optimal ones to set beside it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.design.experiment.fourier import FourierPath
from wbc.design.experiment.limits import MotionLimits
from wbc.design.experiment.rivals import Predictions, Rivals
from wbc.errors import DesignError
from wbc.robot import Motion

HARMONICS = 5  # of the first one: Swevers' choice for robot identification
_BASE = 0.1  # [Hz] first harmonic, so that a run of 10 s holds one period
_DRAWN = 40  # random motions, of which the best are improved
_KEPT = 4
_ROOM = 0.8  # share of the limits that a motion may use: room for what the rivals do not know
_SEARCH_RATE = 50.0  # [Hz] at which motions are compared; odds are given at the rate of the log


@dataclass(frozen=True, eq=False)
class Designed:
    """A motion and what it is expected to say.

    Attributes:
        path: the motion.
        odds: (i, j) -> expected natural logarithm of the odds of rival i, if true, over rival j.
        used: the largest share of a limit that it uses.
    """

    path: FourierPath
    odds: dict[tuple[int, int], float]
    used: float

    @property
    def worst(self) -> float:
        """The smallest of the expected log-odds."""
        return min(self.odds.values())


@dataclass(frozen=True, eq=False)
class _Site:
    """What every motion of a search shares."""

    rivals: Rivals
    limits: MotionLimits
    centre: FloatArray
    duration: float

    def motion(self, path: FourierPath, rate: float) -> Motion:
        """Return the path as a motion of the whole robot, sampled at `rate` [Hz]."""
        robot = self.rivals.robot
        q, v, a = path.at(path.times(rate))
        position = np.tile(robot.neutral(), (len(q), 1))
        position[:, robot.actuated_position] = q
        velocity, acceleration = np.zeros((2, len(q), robot.model.nv))
        velocity[:, robot.actuated], acceleration[:, robot.actuated] = v, a
        return Motion(position, velocity, acceleration)

    def fitted(self, path: FourierPath) -> tuple[FourierPath, Predictions, float]:
        """Return the path made as large as the limits allow, and its predictions.

        Torque does not grow in proportion to the size: the scale is found in a few rounds, and a
        path that breaks a limit is made smaller.
        """
        for _ in range(6):
            found = self.rivals.predictions(self.motion(path, _SEARCH_RATE))
            motion = path.at(path.times(_SEARCH_RATE))
            used = self.limits.used(motion, found.peak(), self.centre)
            if 0.9 * _ROOM <= used <= _ROOM:
                break
            path = path.scaled(0.97 * _ROOM / used)
        while used > _ROOM:
            path = path.scaled(0.9)
            found = self.rivals.predictions(self.motion(path, _SEARCH_RATE))
            used = self.limits.used(path.at(path.times(_SEARCH_RATE)), found.peak(), self.centre)
        return path, found, used


Aim = Callable[[Predictions], float]


def deciding(found: Predictions) -> float:
    """Return the aim of the experiment that decides: the smallest expected log-odds."""
    return min(found.odds().values())


def informing(found: Predictions) -> float:
    """Return the aim of a D-optimal experiment."""
    return found.information()


def random_paths(
    rivals: Rivals, limits: MotionLimits, duration: float, seed: int, count: int
) -> Iterator[FourierPath]:
    """Yield random paths that use the limits as far as they go."""
    site = _site(rivals, limits, duration)
    random = np.random.default_rng(seed)
    for _ in range(count):
        yield site.fitted(_drawn(site, random))[0]


def design_experiment(
    rivals: Rivals,
    limits: MotionLimits,
    duration: float,
    *,
    rate: float = 100.0,
    rounds: int = 300,
    seed: int = 0,
    aim: Aim = deciding,
    starts: Sequence[FourierPath] = (),
    watch: Callable[[int, int], None] | None = None,
) -> Designed:
    """Return the best motion found for an aim; the same for the same seed.

    Random motions first; then the best of them change at random, ever less, and keep what helps.

    Args:
        rivals: what is to be told apart.
        limits: what the motion stays inside, to four fifths.
        duration: [s].
        rate: of the log that will be recorded [Hz], at which the odds are given.
        rounds: changes tried.
        seed: of draws and changes.
        aim: `deciding` or `informing`.
        starts: motions to improve beside the random ones, for example a D-optimal one.
        watch: called with the motions tried and their total.

    Raises:
        DesignError: a duration or rate that is not positive, limits that leave no room.
    """
    if not (duration > 0.0 and rate > 0.0):
        raise DesignError("duration and rate of an experiment must be > 0.")
    site, random = _site(rivals, limits, duration), np.random.default_rng(seed)
    tried: list[tuple[float, FourierPath]] = []
    for i in range(_DRAWN):
        path, found, _ = site.fitted(_drawn(site, random))
        tried.append((aim(found), path))
        if watch:
            watch(i + 1, _DRAWN + rounds)
    for start in starts:
        path, found, _ = site.fitted(start)
        tried.append((aim(found), path))
    best = sorted(tried, key=lambda one: -one[0])[:_KEPT]
    for i in range(rounds):
        value, path = best[i % len(best)]
        size = 0.5 * (1.0 - i / rounds) + 0.05
        changed, found, _ = site.fitted(_changed(path, random, size))
        new = aim(found)
        if new > value:
            best[i % len(best)] = (new, changed)
        if watch:
            watch(_DRAWN + i + 1, _DRAWN + rounds)
    return expected(rivals, limits, max(best, key=lambda one: one[0])[1], rate)


def expected(
    rivals: Rivals, limits: MotionLimits, path: FourierPath, rate: float = 100.0
) -> Designed:
    """Return what a path is expected to say, logged at `rate` [Hz]."""
    site = _site(rivals, limits, path.duration)
    found = rivals.predictions(site.motion(path, rate))
    used = limits.used(path.at(path.times(rate)), found.peak(), site.centre)
    return Designed(path, found.odds(), used)


def _site(rivals: Rivals, limits: MotionLimits, duration: float) -> _Site:
    usual = rivals.robot.poses
    pose = rivals.robot.pose() if usual else rivals.robot.neutral()
    centre = pose[rivals.robot.actuated_position]
    # Where the usual pose touches a limit the motion is about the middle.
    bounded = np.isfinite(limits.low) & np.isfinite(limits.high)
    middle = np.where(bounded, 0.5 * (limits.low + limits.high), centre)
    inside = (centre > limits.low) & (centre < limits.high)
    centre = np.where(inside, centre, middle)
    if not np.all((limits.low < centre) & (centre < limits.high)):
        raise DesignError("the position limits leave no room to move.")
    return _Site(rivals, limits, centre, duration)


def _drawn(site: _Site, random: np.random.Generator) -> FourierPath:
    m = len(site.centre)
    weight = 1.0 / np.arange(1, HARMONICS + 1)
    # One size per joint: what tells two causes apart may need another joint to move little.
    size = random.uniform(0.2, 1.0, (m, 1))
    sine, cosine = random.normal(size=(2, m, HARMONICS)) * weight * size
    base = _BASE * random.choice([1.0, 2.0, 4.0])
    return FourierPath(site.centre, sine, cosine, base, site.duration)


def _changed(path: FourierPath, random: np.random.Generator, size: float) -> FourierPath:
    scale = np.sqrt(np.mean(path.sine**2 + path.cosine**2))
    some = random.random(path.sine.shape) < 0.5
    sine = path.sine + some * size * scale * random.normal(size=path.sine.shape)
    cosine = path.cosine + some * size * scale * random.normal(size=path.sine.shape)
    base = path.frequency * float(np.exp(0.5 * size * random.normal()))
    return FourierPath(path.centre, sine, cosine, base, path.duration)
