"""Logs that repeat one another, and copies of one log."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np

from wbc.arrays import FloatArray
from wbc.measurement.filters import residual_noise
from wbc.measurement.log import Log

_REPEATS = 0.05  # largest rms distance of two positions, relative to their motion, of repeats
_NOISE_ALLOWANCE = 3.0


def find_repeats(logs: Sequence[Log]) -> tuple[tuple[int, ...], ...]:
    """Return groups of logs of the same excitation, as indices into `logs`.

    Two logs belong together when they have the same joints, the same length and rate within 1 %,
    and every joint's position (without one, its velocity) agrees within 5 % of its motion
    (rms, time counted from the start). The response may thus differ a little, as a closed loop
    makes it; identical copies are no repeats and stay out (the first of them counts).

    Args:
        logs: of one robot.

    Returns:
        Groups of two or more indices, in order of their first member.
    """
    copies = {k for group in find_duplicates(logs) for k in group[1:]}
    groups: list[list[int]] = []
    for k, log in enumerate(logs):
        if k in copies:
            continue
        home = next((g for g in groups if _same_excitation(logs[g[0]], log)), None)
        if home is None:
            groups.append([k])
        else:
            home.append(k)
    return tuple(tuple(group) for group in groups if len(group) > 1)


def find_duplicates(logs: Sequence[Log]) -> tuple[tuple[int, ...], ...]:
    """Return groups of logs that hold the same data, as indices into `logs`.

    The same file counts, and so does the same data in other files (time counted from the start).
    """
    seen: dict[str, list[int]] = {}
    for k, log in enumerate(logs):
        seen.setdefault(_fingerprint(log), []).append(k)
    return tuple(tuple(group) for group in seen.values() if len(group) > 1)


def _fingerprint(log: Log) -> str:
    """Return a digest of the data: nine decimals, so that another file format changes nothing."""
    total = hashlib.sha256()
    for name in sorted(log.names):
        total.update(name.encode("utf-8"))
        total.update(np.round(log.column(name), 9).tobytes())
    total.update(np.round(log.time - log.time[0], 6).tobytes())
    return total.hexdigest()


def _same_excitation(a: Log, b: Log) -> bool:
    names = _motions(a)
    rates = [a.duration / b.duration, a.sample_time / b.sample_time]
    if names != _motions(b) or max(abs(ratio - 1.0) for ratio in rates) > 0.01:
        return False
    moved = 0
    for name in names:
        first, second = a.column(name), on_clock(b, name, a.time - a.time[0])
        motion, noise = float(np.std(first)), residual_noise(a.time, first)
        # A joint that stands still repeats its place within the noise of its sensor.
        most = _REPEATS * motion + _NOISE_ALLOWANCE * noise
        if float(np.sqrt(np.mean((first - second) ** 2))) > most:
            return False
        moved += motion > _NOISE_ALLOWANCE * noise
    return moved > 0


def _motions(log: Log) -> list[str]:
    """Return the column that shows how each joint moves: its position, else its velocity."""
    ways = [[f"{joint}.{q}" for q in ("position", "velocity")] for joint in log.joints]
    return sorted(next(filter(log.has, names)) for names in ways if any(map(log.has, names)))


def on_clock(log: Log, name: str, elapsed: FloatArray) -> FloatArray:
    """Return a channel at times [s] since the start of its log (linear interpolation)."""
    own = log.time - log.time[0]
    values = log.column(name)
    if own.size == elapsed.size and np.allclose(own, elapsed, rtol=0.0, atol=1e-9):
        return values
    return np.asarray(np.interp(elapsed, own, values))
