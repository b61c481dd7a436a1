"""Reference motions of the driven joints, from poor to rich."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from benchmarks.corpus.machine import Machine

KINDS = ("multisine", "slow", "fast", "shake", "sweep", "speeds", "holds", "stops", "one_joint")
_KNOTS = 100.0  # [Hz]


@dataclass(frozen=True)
class Excitation:
    """One run.

    Attributes:
        kind: see `KINDS`.
        seed: of its phases and sizes; equal seeds repeat one another.
        duration: [s].
        noise: seed of the sensors.
        lead: how much earlier the clock of the log starts [s]; no run repeats another to the tick
            of its encoders.
    """

    kind: str
    seed: int
    duration: float
    noise: int
    lead: float = 0.0


@dataclass(frozen=True, eq=False)
class PlannedExcitation(Excitation):
    """A run along a motion that was planned, in place of a drawn one.

    Attributes:
        positions: (T, m) of the driven joints [rad], 100 a second from 0.5 s before the start
            to 0.5 s after the end.
    """

    positions: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))

    @staticmethod
    def times(duration: float) -> np.ndarray:
        """Return the times (T,) [s] of the positions."""
        return np.arange(-0.5, duration + 0.5, 1.0 / _KNOTS)


def reference(machine: Machine, excitation: Excitation) -> BSpline:
    """Return the joints' motion as a spline (m,) of the time, four times differentiable."""
    time = PlannedExcitation.times(excitation.duration)
    if isinstance(excitation, PlannedExcitation):
        return make_interp_spline(time - excitation.lead, excitation.positions, k=5)
    random = np.random.default_rng([77, excitation.seed])
    count = len(machine.driven)
    reach = 0.5 if machine.family == "biped" else 1.0
    wave = np.stack([_wave(random, excitation.kind, time) for _ in range(count)], axis=1)
    if excitation.kind == "one_joint":
        moved = int(random.integers(count))
        wave[:, [k for k in range(count) if k != moved]] = 0.0
    return make_interp_spline(time - excitation.lead, machine.center + reach * wave, k=5)


def _wave(random: np.random.Generator, kind: str, time: np.ndarray) -> np.ndarray:
    if kind in ("sweep", "speeds"):
        return _sweeps(random, kind, time)
    if kind in ("holds", "stops"):
        return _poses(random, kind, time)
    lowest, highest, size = {
        "multisine": (0.1, 1.2, 0.55),
        "one_joint": (0.1, 1.2, 0.55),
        "slow": (0.05, 0.3, 0.6),
        "fast": (0.3, 2.2, 0.45),
        "shake": (1.5, 4.0, 0.06),
    }[kind]
    frequency = random.uniform(lowest, highest, 5)
    phase = random.uniform(0.0, 2.0 * np.pi, 5)
    weight = random.uniform(0.4, 1.0, 5) / (0.3 + frequency)
    weight *= size / np.sqrt(0.5 * np.sum(weight**2))
    angle = 2.0 * np.pi * frequency * time[:, None] + phase
    return np.sin(angle) @ weight


def _sweeps(random: np.random.Generator, kind: str, time: np.ndarray) -> np.ndarray:
    """Return strokes of constant speed over the range with rounded corners."""
    rate = random.uniform(0.08, 0.15) if kind == "sweep" else random.uniform(0.15, 0.2)
    turns = rate * time
    if kind == "speeds":  # ever faster
        turns = turns + 0.5 * rate * np.maximum(time, 0.0) ** 2 / 4.0
    angle = 2.0 * np.pi * turns + random.uniform(0.0, 2.0 * np.pi)
    return random.uniform(0.7, 1.0) * np.arcsin(0.97 * np.sin(angle)) / np.arcsin(0.97)


def _poses(random: np.random.Generator, kind: str, time: np.ndarray) -> np.ndarray:
    """Return minimum-jerk moves between random poses, long holds or abrupt stops between them."""
    travel, rest = (0.5, 0.5) if kind == "holds" else (0.25, 0.35)
    period = travel + rest
    number = np.floor((time + 0.5) / period).astype(int)
    share = np.clip(((time + 0.5) - number * period) / travel, 0.0, 1.0)
    blend = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    pose = random.uniform(-1.0, 1.0, int(number[-1]) + 2) * (1.0 if kind == "holds" else 0.6)
    return pose[number] + (pose[number + 1] - pose[number]) * blend
