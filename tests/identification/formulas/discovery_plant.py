"""A two-link leg in closed form that follows given motions, with any torque added; no code shared.

Motions are sums of sines, so that positions, speeds and accelerations are exact; the torque is what
Lagrange's equations ask for plus what the added torque takes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tests.recover.plant import RATIO, REFLECTED, Flaws, Lane
from wbc.measurement import Log

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Moving:
    """One run: (N, 2) arrays of hip and knee, and the torque that the links ask of them."""

    time: Array
    q: Array
    v: Array
    a: Array
    load: Array


Torque = Callable[[Moving], tuple[Array | float, Array | float]]


def nothing(run: Moving) -> tuple[float, float]:
    return 0.0, 0.0


def logs(
    torque: Torque,
    seeds: tuple[int, ...] = (1, 2),
    duration: float = 6.0,
    size: float = 1.0,
    noise: float = 1.0,
) -> list[Log]:
    """Return one log per seed of a leg on whose hip and knee `torque` acts."""
    return [_log(torque, seed, duration, size, noise) for seed in seeds]


def _log(torque: Torque, seed: int, duration: float, size: float, noise: float) -> Log:
    run = _motion(seed, duration, size)
    hip, knee = torque(run)
    extra = np.stack([np.broadcast_to(t, run.time.shape) for t in (hip, knee)], axis=1)
    rotor = (run.load + REFLECTED * run.a - extra) / RATIO
    random = np.random.default_rng(500 + seed)
    columns = {}
    for k, joint in enumerate(("hip", "knee")):
        for name, values, sigma in (
            ("position", run.q, 2e-5),
            ("velocity", run.v, 3e-3),
            ("rotor_torque", rotor, 2e-3),
        ):
            error = noise * sigma * random.standard_normal(len(run.time))
            columns[f"{joint}.{name}"] = values[:, k] + error
    return Log(run.time, columns)


def _motion(seed: int, duration: float, size: float) -> Moving:
    random = np.random.default_rng(seed)
    time = np.arange(round(500.0 * duration)) / 500.0
    frequency = 2.0 * np.pi * random.uniform(0.1, 1.5, (2, 5, 1))
    height = size * 0.35 * random.uniform(0.5, 1.0, (2, 5, 1)) / (0.4 + frequency / (2.0 * np.pi))
    angle = frequency * time + random.uniform(0.0, 2.0 * np.pi, (2, 5, 1))
    q = (height * np.sin(angle)).sum(axis=1).T + np.array([0.3, -0.4])
    v = (height * frequency * np.cos(angle)).sum(axis=1).T
    a = -(height * frequency**2 * np.sin(angle)).sum(axis=1).T
    mass, bias = Flaws([Lane()]).links(q, v)
    return Moving(time, q, v, a, np.einsum("nij,nj->ni", mass, a) + bias)


def bouc_wen(run: Moving, joint: int, level: float, rate: float) -> Array:
    """Return the torque of rate-independent hysteresis that saturates at `level` [N m]."""
    state, step, torque = 0.0, run.time[1] - run.time[0], np.empty(len(run.time))
    for k, speed in enumerate(run.v[:, joint]):
        torque[k] = -level * state
        state += step * rate * (speed - abs(speed) * state)
    return torque
