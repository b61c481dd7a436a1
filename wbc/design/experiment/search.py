"""Searching the motion that decides best; random and D-optimal ones to set beside it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from scipy.special import ndtr

from wbc.arrays import FloatArray
from wbc.design.experiment.motions import ROOM, FourierPath, MotionLimits, fitted, predicted
from wbc.design.experiment.rivals import Pair, Predictions, Rivals
from wbc.errors import DesignError
from wbc.files import as_json
from wbc.identification.answer.ranking import effect_entry
from wbc.parallel import Watch

RANDOM, CLASSIC, DESIGNED = "random, median", "D-optimal", "designed"
_RANDOM = 21  # random motions of which the median one is shown
HARMONICS = 3  # of the first one; 5 and 10 leave intervals of an arm 12 and 20 % wider
_BASES = (1.0 / 6.0, 1.0 / 3.0, 2.0 / 3.0)  # [Hz] first harmonics; with three, up to 2 Hz
_DRAWN = 40  # random motions, of which the best are improved
_KEPT = 4
_FIRST, _FINEST, _WIDEST = 0.3, 0.01, 0.6  # size of a change, over that of the motion
# Changes keep their size where about one in seven helps (Rechenberg 1973: one in five).
_GROWN, _SHRUNK = 1.6, 0.93
_MOVED = 0.3  # share of the joints that one change moves: all at once are 4 % worse on an arm
ROUNDS = 2400  # changes tried
_SURE = 3.0  # [nats] beyond which a diagnosis names one cause alone
_MIMICKED = 1e-5  # of a cause's squared torque: what another one leaves of it when it is the same


Aim = Callable[[Predictions, Sequence[Pair]], float]
"""What a motion is to make large, given its predictions and the pairs that a motion can tell."""


def deciding(found: Predictions, pairs: Sequence[Pair]) -> float:
    """Return the smallest expected log-odds, for the experiment that decides.

    `shrinking` for one cause alone.
    """
    if not pairs:
        return shrinking(found, pairs)
    return min(found.near_distance(pair) for pair in pairs)


def informing(found: Predictions, pairs: Sequence[Pair]) -> float:
    """Return what a D-optimal experiment makes large."""
    return found.information()


def shrinking(found: Predictions, pairs: Sequence[Pair]) -> float:
    """Return minus the mean logarithm of the widths of all intervals.

    The motion with the smallest geometric mean of relative widths, whatever widths they are
    relative to and whatever the units: halving any of them is worth the same.
    """
    widths = [found.widths(number) for number in range(len(found.rivals.causes))]
    return -float(np.mean(np.log(np.concatenate(widths))))


@dataclass(frozen=True, eq=False)
class Designed:
    """A motion and what it is expected to say.

    Attributes:
        path: the motion.
        odds: (i, j) -> expected natural logarithm of the odds of cause i, if true, over cause j;
            `Predictions.near_distance` says how it is averaged over values that are open.
        chance: (i, j) -> probability that the log then speaks for cause i, if true, by odds of
            more than 20 to 1 over cause j, which names it alone. Below 0.99 it is too high: of 15
            ties with 0.5 to 0.9, 3 were decided where 11 were promised.
        widths: per cause the half widths (p,) of the 90 % intervals of its parameters.
        used: the largest share of a limit that it uses.
        alike: pairs (i, j) of which j does what i does, on any motion: i is a special case of it.
    """

    path: FourierPath
    odds: dict[Pair, float]
    chance: dict[Pair, float]
    widths: tuple[FloatArray, ...]
    used: float
    alike: tuple[Pair, ...] = ()

    @property
    def worst(self) -> float:
        """The smallest of the expected log-odds of pairs that a motion can tell apart."""
        told = [value for pair, value in self.odds.items() if pair not in self.alike]
        return min(told, default=0.0)

    @property
    def width(self) -> float:
        """The geometric mean of all half widths, which `shrinking` makes small.

        Its unit is a mixture: only its ratio to that of another motion means something.
        """
        return float(np.exp(np.mean(np.log(np.concatenate(self.widths)))))


def experiment_json(rivals: Rivals, found: Mapping[str, Designed]) -> dict[str, Any]:
    """Return plain numbers, texts and lists of what motions are expected to say.

    Args:
        found: motions by name; the one called `DESIGNED` among them.
    """

    def listed(values: Mapping[Pair, float], scale: float = 1.0) -> list[dict[str, float]]:
        return [{"true": i, "over": j, "value": x / scale} for (i, j), x in values.items()]

    designed, ten = found[DESIGNED], float(np.log(10.0))
    told = {
        "causes": [[effect_entry(effect) for effect in cause] for cause in rivals.causes],
        "half_widths": {name: one.widths for name, one in found.items()},
        "alike": [{"true": i, "over": j} for i, j in designed.alike],
        "log10_odds": {name: listed(one.odds, ten) for name, one in found.items()},
        "chance": {name: listed(one.chance) for name, one in found.items()},
        "used": designed.used,
    }
    return dict(as_json(told))


def random_paths(
    rivals: Rivals, limits: MotionLimits, duration: float, seed: int, count: int
) -> Iterator[FourierPath]:
    """Yield random paths that use the limits as far as they go.

    Raises:
        DesignError: a duration that is not positive, motors that cannot hold the robot still.
    """
    _require_limits(rivals, limits, duration)
    random = np.random.default_rng(seed)
    for _ in range(count):
        yield fitted(rivals, limits, _drawn(limits, duration, random))[0]


def design_experiment(
    rivals: Rivals,
    limits: MotionLimits,
    duration: float,
    *,
    rate: float = 100.0,
    rounds: int = ROUNDS,
    seed: int = 0,
    aim: Aim = deciding,
    starts: Sequence[FourierPath] = (),
    watch: Watch = lambda done, total: None,
) -> Designed:
    """Return the best motion found for an aim; the same for the same seed.

    Random motions first; then the best of them change at random, by steps that grow where they
    help and shrink where they do not, a few joints at a time.

    Args:
        rivals: what is to be told apart.
        limits: what the motion stays inside, to four fifths.
        duration: [s].
        rate: of the log that will be recorded [Hz], at which the odds are given.
        rounds: changes tried.
        seed: of draws and changes.
        aim: `deciding`, `informing`, `shrinking` or one of your own.
        starts: motions to improve beside the random ones, for example a D-optimal one.
        watch: called with the motions tried and their total.

    Raises:
        DesignError: a duration that is not positive, a rate below what the diagnosis reads, motors
            that cannot hold the robot still, causes of which no motion tells one from another.
    """
    if np.isfinite(rivals.band) and not rate >= 2.0 * rivals.band:
        raise DesignError(
            f"a diagnosis that reads torques up to {rivals.band:g} Hz needs {2.0 * rivals.band:g} "
            f"rows per second or more; the rate is {rate:g}."
        )
    if not 0.0 < rate < np.inf:
        raise DesignError(f"the rate of an experiment must be > 0 and finite, got {rate:g}.")
    _require_limits(rivals, limits, duration)
    random, total = np.random.default_rng(seed), _DRAWN + rounds
    fit = partial(fitted, rivals, limits)
    drawn: list[tuple[FourierPath, Predictions]] = []
    for i in range(_DRAWN):
        drawn.append(fit(_drawn(limits, duration, random)))
        watch(i + 1, total)
    alike: tuple[Pair, ...] = ()
    if aim is deciding:  # judged on the motions that say most about all parameters
        alike = _alike(sorted((f for _, f in drawn), key=lambda f: -f.information())[:2])
    pairs = [pair for pair in rivals.pairs if pair not in alike]
    if rivals.pairs and not pairs:
        raise DesignError(
            "no motion of this robot tells these causes apart: whatever one of them does, the "
            "others do as well. Mount the robot otherwise, or measure one of them off the robot."
        )
    drawn += map(fit, starts)
    tried = [(aim(found, pairs), path, _FIRST) for path, found in drawn]
    best = sorted(tried, key=lambda one: -one[0])[:_KEPT]
    for i in range(rounds):
        # Each of the best has its turn at first, then whichever is the best.
        k = i % len(best) if i < rounds // 4 else int(np.argmax([one[0] for one in best]))
        value, path, size = best[k]
        changed, found = fit(limits.each_within(_changed(path, random, size)))
        new = aim(found, pairs)
        if new > value:
            best[k] = (new, changed, min(_GROWN * size, _WIDEST))
        else:
            best[k] = (value, path, max(_SHRUNK * size, _FINEST))
        watch(_DRAWN + i + 1, total)
    path = max(best, key=lambda one: one[0])[1]
    # The rate of the log is denser than the search.
    while predicted(rivals, limits, path, rate)[1] > ROOM:
        path = path.scaled(0.995)
    return expected(rivals, limits, path, rate)


def compare_motions(
    rivals: Rivals,
    limits: MotionLimits,
    duration: float,
    *,
    rate: float = 100.0,
    rounds: int = ROUNDS,
    seed: int = 0,
    watch: Watch = lambda done, total: None,
) -> dict[str, Designed]:
    """Return the designed motion beside the median of random ones and a D-optimal one.

    The designed one starts from the D-optimal one, too.

    Args:
        rivals, limits, duration, rate, rounds, seed, watch: as in `design_experiment`.
    """
    given = rivals, limits, duration
    drawn = random_paths(*given, seed + 1, _RANDOM)
    chance = [expected(rivals, limits, path, rate) for path in drawn]
    chance.sort(key=lambda one: one.worst if one.odds else -one.width)
    plan = partial(design_experiment, *given, rate=rate, rounds=rounds, seed=seed, watch=watch)
    classic = plan(aim=informing)
    designed = plan(starts=[classic.path])
    return {RANDOM: chance[_RANDOM // 2], CLASSIC: classic, DESIGNED: designed}


def _require_limits(rivals: Rivals, limits: MotionLimits, duration: float) -> None:
    """Check that something limits motions, and that the motors hold the robot where they start."""
    if not 0.0 < duration < np.inf:
        raise DesignError(f"an experiment's duration must be > 0 and finite, got {duration:g}.")
    if np.isinf(np.minimum(np.minimum(limits.speed, limits.acceleration), limits.torque)).any():
        raise DesignError(
            "nothing limits how fast the robot moves; give --speed, --acceleration, or motors "
            "with a torque_limit."
        )
    nothing = np.zeros((len(limits.center), 1))
    still = FourierPath(limits.center, nothing, nothing, 1.0, 0.1)
    peak = predicted(rivals, limits, still)[0].peak()
    share = peak.max(axis=0) / limits.torque
    if share.max() >= ROOM:
        joint = rivals.robot.transmission.joints[int(share.argmax())]
        raise DesignError(
            f"in the pose where motions start, holding still takes {100.0 * share.max():.0f} % "
            f"of the torque limit of '{joint}'; a planned motion may use {100.0 * ROOM:.0f} %. "
            "Name another pose first in robot.toml, or check torque_limit and gear_ratio."
        )


def _alike(along: Sequence[Predictions]) -> tuple[Pair, ...]:
    """Return the pairs of which the second cause does what the first does, along all motions.

    A special case is never told from the general one by what it leaves unexplained: load friction
    is a gear with two efficiencies.
    """
    return tuple(
        pair
        for pair in along[0].rivals.pairs
        if all(found.distance(pair) <= _MIMICKED * found.signal(pair[0]) for found in along)
    )


def expected(
    rivals: Rivals, limits: MotionLimits, path: FourierPath, rate: float = 100.0
) -> Designed:
    """Return what a path is expected to say, logged at `rate` [Hz]."""
    found, used = predicted(rivals, limits, path, rate)
    widths = tuple(map(found.widths, range(len(rivals.causes))))
    apart = {pair: found.distances(pair) for pair in rivals.pairs}
    odds = {pair: _softened(d) for pair, d in apart.items()}
    chance = {pair: _decided(d) for pair, d in apart.items()}
    return Designed(path, odds, chance, widths, used, _alike([found]))


def _softened(distances: FloatArray) -> float:
    """Return -4 ln of the mean of exp(-d / 4): the distance with the same bound of errors."""
    least = float(distances.min())
    return least - 4.0 * float(np.log(np.mean(np.exp(0.25 * (least - distances)))))


def _decided(distances: FloatArray) -> float:
    """Return the probability of more than `_SURE` nats: noise makes them normal, variance 2 d."""
    spread = np.sqrt(2.0 * np.maximum(distances, 1e-12))
    return float(np.mean(ndtr((distances - _SURE) / spread)))


def _drawn(limits: MotionLimits, duration: float, random: np.random.Generator) -> FourierPath:
    m = len(limits.center)
    weight = 1.0 / np.arange(1, HARMONICS + 1)
    # One size per joint: what tells two causes apart may need another joint to move little.
    size = random.uniform(0.2, 1.0, (m, 1))
    sine, cosine = random.normal(size=(2, m, HARMONICS)) * weight * size
    # A short run holds a whole period of the first harmonic, as far as the last one allows.
    base = float(np.clip(random.choice(_BASES), min(1.0 / duration, _BASES[-1]), None))
    return FourierPath(limits.center, sine, cosine, base, duration)


def _changed(path: FourierPath, random: np.random.Generator, size: float) -> FourierPath:
    """Return a path with a few joints changed, each in proportion to itself."""
    scale = np.sqrt(np.mean(path.sine**2 + path.cosine**2, axis=1, keepdims=True))
    joints = random.random(scale.shape) < _MOVED
    if not joints.any():
        joints[random.integers(len(joints))] = True
    grown = np.exp(size * joints * random.normal(size=scale.shape))
    some = joints * (random.random(path.sine.shape) < 0.5) * size * scale
    sine = grown * (path.sine + some * random.normal(size=path.sine.shape))
    cosine = grown * (path.cosine + some * random.normal(size=path.sine.shape))
    slower = 0.5 * size * random.normal() * (random.random() < _MOVED)
    base = path.frequency * float(np.exp(slower))
    return FourierPath(path.center, sine, cosine, base, path.duration)
