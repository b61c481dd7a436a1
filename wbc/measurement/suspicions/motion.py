"""Units, sides and signs of time, position and velocity that contradict each other in a log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import log, pi

import numpy as np
from scipy.special import logsumexp

from wbc.arrays import FloatArray
from wbc.measurement.columns.map_table import Mend
from wbc.measurement.log import Log
from wbc.measurement.motion.velocity_fit import fit_velocity

# Of ln of velocity over d position / d time: (share, standard deviation). Of 136 channels of six
# recorded machines and the practice leg 82 % are within 0.003 of one; filters and delays make more.
_RATIO_SPREADS = ((0.8, 0.002), (0.2, 0.03))
_ODD, _ODD_SPREAD = log(0.02), 2.0  # share and spread of ratios that have another cause
_MISTAKE = log(0.02)  # each: a judgement, a few in a hundred sets of logs
_CORRELATION = 0.95
_CHECKED_ROWS = 200_000
# What is usual, as logarithms with standard deviations. Judgements: sample times of 0.5 to 50 ms,
# logs of 0.5 s to half an hour, the fastest joint at 0.15 to 60 rad/s (m/s). Up to twelve logs of
# each of ten recorded machines have 0.2 to 10 ms, 0.6 to 51 s and 0.07 to 18 rad/s (m/s).
_USUAL_STEP, _STEP_SPREAD = log(0.005), 1.2
_USUAL_LENGTH, _LENGTH_SPREAD = log(30.0), 2.0
_USUAL_SPEED, _SPEED_SPREAD = log(3.0), 1.5
_SPEED_ROWS = 200
_CLOCKS = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}  # units of time stamps, in seconds


@dataclass(frozen=True)
class Ratio:
    """A known mistake by the ratio of velocity to d position / d time that it makes.

    Attributes:
        factor: the ratio.
        text: what is wrong; `{joint}` stands for the joint.
        mend: entries of [columns] by quantity, or the section [time].
    """

    factor: float
    kind: str
    text: str
    mend: Mapping[str, Mapping[str, object]]


_RATIOS = (
    Ratio(pi / 180.0, "degrees", "the position is in degrees", {"position": {"unit": "deg"}}),
    Ratio(180.0 / pi, "degrees", "the velocity is in deg/s", {"velocity": {"unit": "deg/s"}}),
    Ratio(30.0 / pi, "velocity_unit", "the velocity is in rpm", {"velocity": {"unit": "rpm"}}),
    Ratio(
        0.5 / pi, "velocity_unit", "the velocity is in turns/s", {"velocity": {"unit": "turn/s"}}
    ),
    Ratio(2.0 * pi, "degrees", "the position is in turns", {"position": {"unit": "turn"}}),
    Ratio(1e3, "time_unit", "the time is in ms", {"time": {"unit": "ms"}}),
    Ratio(1e6, "time_unit", "the time is in us", {"time": {"unit": "us"}}),
    Ratio(1e9, "time_unit", "the time is in ns", {"time": {"unit": "ns"}}),
    Ratio(
        1e-3,
        "velocity_unit",
        "the position is in thousandths of the velocity's unit",
        {"position": {"scale": 0.001}},
    ),
    Ratio(
        -1.0,
        "velocity_sign",
        "position and velocity have opposite signs",
        {"velocity": {"sign": -1}},
    ),
)


def with_gear(ratio: float) -> tuple[Ratio, ...]:
    """Return the mistakes of a joint behind a gear: those of every joint, and its two sides."""
    if abs(ratio) == 1.0 or not np.isfinite(ratio):
        return _RATIOS
    side = {"side": "rotor", "gear_ratio": ratio}
    rotor = Ratio(ratio, "gear_side", "the velocity is that of the rotor", {"velocity": side})
    both = {"velocity": {**side, "unit": "rpm"}}
    return (
        *_RATIOS,
        rotor,
        Ratio(1.0 / ratio, "gear_side", "the position is that of the rotor", {"position": side}),
        Ratio(ratio * 30.0 / pi, "gear_side", "the velocity is that of the rotor, in rpm", both),
    )


@dataclass(frozen=True)
class MotionMistake:
    """A mistake of one joint, or of the clock.

    Attributes:
        ratio: which mistake.
        joint: whose; empty for the clock.
        scale: what was seen.
        probability: of the mistake.
    """

    ratio: Ratio
    joint: str
    scale: float
    probability: float

    @property
    def mend(self) -> Mend:
        """What a column map says about it."""
        if "time" in self.ratio.mend:
            return dict(self.ratio.mend)
        return {"columns": {f"{self.joint}.{name}": dict(e) for name, e in self.ratio.mend.items()}}


def motion_mistakes(log: Log, ratios: Mapping[str, float]) -> list[MotionMistake]:
    """Return the likely mistakes of every joint of a log that has position and velocity.

    Args:
        log: the log.
        ratios: gear ratio N of joints that one motor drives alone; may be empty.
    """
    found = []
    for joint in log.with_quantity("position"):
        scale = velocity_scale(log, joint)
        if scale is None:
            continue
        known = with_gear(ratios.get(joint, 1.0))
        odds = np.array([_log_odds(scale, one.factor) for one in known])
        stands = np.logaddexp(_log_odds(scale, 1.0) - _MISTAKE, _odd(scale) - _MISTAKE)
        best = int(np.argmax(odds))
        probability = float(np.exp(odds[best] - logsumexp([*odds, stands])))
        if probability >= 0.9:
            found.append(MotionMistake(known[best], joint, scale, probability))
    return found


def together_likely(probabilities: Sequence[float]) -> float:
    """Return the probability of one mistake that several joints show, each with its own.

    It was made once, so its prior counts once; what the joints show adds up.
    """
    shown = np.array([min(p, 1.0 - 1e-15) for p in probabilities])
    odds = np.sum(np.log(shown / (1.0 - shown)) - _MISTAKE) + _MISTAKE
    return float(1.0 / (1.0 + np.exp(-odds)))


def slow_clock(log: Log) -> tuple[float, str]:
    """Return the probability that the time stamps are no seconds, and the unit that they have.

    From their distance, the length of the log and the speed of its fastest joint. Each alone leaves
    it open: a controller may run at 5 kHz, a log may be long, and a joint may creep.
    """
    odds = np.array([_usual(log, unit) for unit in (1.0, *_CLOCKS.values())])
    odds[1:] += _MISTAKE
    likely = int(odds[1:].argmax())
    wrong = np.logaddexp.reduce(odds[1:])
    return float(np.exp(wrong - np.logaddexp(odds[0], wrong))), tuple(_CLOCKS)[likely]


def _usual(log: Log, unit: float) -> float:
    """Return how usual a log's clock, length and speed are, if its time is in a unit [s]."""
    step = (np.log(unit * log.sample_time) - _USUAL_STEP) / _STEP_SPREAD
    length = (np.log(unit * log.duration) - _USUAL_LENGTH) / _LENGTH_SPREAD
    speed = _fastest(log)
    fast = (np.log(speed / unit) - _USUAL_SPEED) / _SPEED_SPREAD if speed > 0.0 else 0.0
    return float(-0.5 * (step**2 + length**2 + fast**2))


def _fastest(log: Log) -> float:
    """Return the highest speed of any joint between rows far apart: no noise, no resolution."""
    places = np.unique(np.linspace(0, len(log) - 1, _SPEED_ROWS).astype(int))
    steps = np.diff(log.time[places])
    moved = [
        np.abs(np.diff(log.column(f"{joint}.position")[places])) / steps
        for joint in log.with_quantity("position")
    ]
    return float(np.max(moved)) if moved and steps.size else 0.0


def velocity_scale(log: Log, joint: str) -> float | None:
    """Return velocity / (d position / d time) of a joint, None where that cannot be told."""
    if not log.has(f"{joint}.position", f"{joint}.velocity"):
        return None
    rows = slice(0, _CHECKED_ROWS)
    time, position = log.time[rows], log.column(f"{joint}.position")[rows]
    velocity = log.column(f"{joint}.velocity")[rows]
    if time.size < 20 or np.ptp(position) < _resolution(position):
        return None
    fit = fit_velocity(time, position, velocity)
    return fit.scale if fit.moves and abs(fit.correlation) > _CORRELATION else None


def _log_odds(scale: float, factor: float) -> float:
    """Return the log density of a ratio if a factor is what makes it, times its prior."""
    if scale * factor <= 0.0:
        return -np.inf
    away = np.log(scale / factor)
    parts = [np.log(share / s) - 0.5 * (away / s) ** 2 for share, s in _RATIO_SPREADS]
    return float(_MISTAKE + logsumexp(parts))


def _odd(scale: float) -> float:
    """Return the log density of a ratio that something else makes."""
    away = np.log(abs(scale)) / _ODD_SPREAD
    return float(_MISTAKE + _ODD - 0.5 * away**2 - np.log(2.0 * _ODD_SPREAD))


def _resolution(values: FloatArray) -> float:
    """Return a range below which a channel may be noise: 20 times the median step."""
    return float(20.0 * np.median(np.abs(np.diff(values))) + 1e-9)
