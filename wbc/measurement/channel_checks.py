"""Findings about single channels: saturation, resolution, dead and held sensors."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from scipy.integrate import cumulative_trapezoid, trapezoid

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.measurement.filters import residual_noise
from wbc.measurement.findings import LogFinding
from wbc.measurement.log import Log
from wbc.measurement.schema import split_column

_SATURATED_SHARE = 0.005
_COARSE_SHARE = 0.1
_FULL_DUTY = 0.995
_ACTUATION = ("rotor_torque", "motor_torque", "current", "duty")
_MOTION = ("position", "velocity", "rotor_position")
_MEASURED = (*_MOTION, *_ACTUATION, "joint_torque")
_SECONDS = 0.1
_SAMPLES = 5
_END_SHARE = 0.2
_MOVES = 5.0  # times the noise, as for the suspicions about columns
_ROUNDING = 1e-6  # of the range: smaller steps come from printed digits
_WALK = 1.0 / 15.0  # mean square of a random walk over its length, its best line taken out


def check_channels(log: Log, resting: Collection[str] = ()) -> list[LogFinding]:
    """Return findings about every measured channel of the joints.

    Args:
        log: the log.
        resting: joints that stand still, whose motion and resolution are not judged.
    """
    findings: list[LogFinding] = []

    def warn(kind: str, name: str, text: str, way: str, severity: str = "warning") -> None:
        findings.append(LogFinding(severity, kind, name, text, way))

    for name, values in log.columns.items():
        joint, quantity = split_column(name) or ("", "")
        if quantity not in _MEASURED or (joint in resting and quantity in _MOTION):
            continue
        if values[0] == values[-1] and np.ptp(values) == 0.0:
            if quantity == "position":
                text = f"{values[0]:g} throughout, while the velocity changes."
                warn("constant_joint", name, text, "The channel is not connected.")
                continue
            text = "zero throughout." if values[0] == 0.0 else f"{values[0]:g} throughout."
            way = "Fine for an unpowered joint; otherwise the channel is not connected."
            idle = quantity in _ACTUATION and values[0] == 0.0
            warn("constant_channel", name, text, way, "info" if idle else "warning")
            continue
        step, spread = resolution(values), float(np.std(values))
        if step > _COARSE_SHARE * spread and joint not in resting:
            text = f"the resolution {step:.4g} is {100.0 * step / spread:.0f} % of the signal's "
            warn("coarse", name, f"{text}spread.", "Excite more, or read it with more bits.")
        # A duty of one is the limit by definition, whether the joint moves or not.
        full = quantity == "duty" and float(np.abs(values).max()) >= _FULL_DUTY
        known = log.has(f"{joint}.position") and not full
        position = log.column(f"{joint}.position") if known else None
        low, high, share, runs = plateau(values, position)
        cut = share >= _SATURATED_SHARE and (runs >= 3 or full)
        if quantity in _ACTUATION and cut:
            text = f"{100.0 * share:.1f} % of the samples sit at an extreme ({low:g} or {high:g})."
            way = "The drive or its sensor is at its limit: what it really did there is unknown. "
            warn("saturation", name, text, f"{way}Leave those times out, or excite less.")
    return findings


def resting_joints(log: Log) -> frozenset[str]:
    """Return the joints that neither their position nor their velocity shows to move.

    A position flickers by its noise and by the count of its encoder; the integral of a velocity
    strays by a constant offset, by the random walk of its noise and by its rounding.
    """
    return frozenset(
        joint
        for joint in log.with_quantity("position")
        if not _position_moves(log.time, log.column(f"{joint}.position"))
        and not (
            log.has(f"{joint}.velocity")
            and _velocity_moves(
                log.time, log.column(f"{joint}.velocity"), log.column(f"{joint}.position")
            )
        )
    )


def check_rest(log: Log, resting: Collection[str]) -> list[LogFinding]:
    """Return a finding for each joint that stands still, in place of those about its channels."""
    way = "This log tells nothing of the joint but a static torque: move it in another log, or "
    way += "lock it in the robot."
    found = []
    for name in sorted(f"{joint}.position" for joint in resting):
        place = log.column(name)
        text = f"the joint stands still (within {np.ptp(place):.2g} of {place.mean():.4g})."
        found.append(LogFinding("warning", "constant_joint", name, text, way))
    return found


def _position_moves(time: FloatArray, position: FloatArray) -> bool:
    if np.ptp(position) == 0.0:
        return False  # the deviation from the mean of one value is what rounding makes of it
    spread, steps = float(np.std(position)), float(np.sqrt(np.mean(np.diff(position) ** 2)))
    # The steps from row to row hold all of the noise: what is far above them needs no filter.
    if spread > 2.0 * _MOVES * np.hypot(steps, _rounding(position)):
        return True
    return bool(spread > _MOVES * _uncertainty(time, position))


def _velocity_moves(time: FloatArray, velocity: FloatArray, position: FloatArray) -> bool:
    if np.ptp(velocity) == 0.0:
        return False
    integral = cumulative_trapezoid(velocity, time, initial=0.0)
    line = np.polynomial.Polynomial.fit(time, integral, 1)
    strays = float(np.std(integral - line(time)))
    step = float(np.median(np.diff(time)))
    walk = residual_noise(time, velocity) * step * np.sqrt(_WALK * time.size)
    # A value that is held is off by the same rounding all the while.
    ends = np.flatnonzero(np.diff(velocity))
    held = np.diff(time[np.concatenate([[0], ends, [time.size - 1]])])
    rounded = _rounding(velocity) * float(np.linalg.norm(held))
    unsure = np.hypot(np.hypot(walk, rounded), _uncertainty(time, position))
    return bool(strays > _MOVES * unsure)


def _uncertainty(time: FloatArray, position: FloatArray) -> float:
    """Return the standard deviation of a position's noise and of its rounding to counts."""
    return float(np.hypot(residual_noise(time, position), _rounding(position)))


def _rounding(position: FloatArray) -> float:
    steps = np.abs(np.diff(position))
    steps = steps[steps > _ROUNDING * max(float(np.ptp(position)), 1e-300)]
    count = float(steps.min(initial=np.inf))
    return count / np.sqrt(12.0) if np.isfinite(count) else 0.0


def check_stuck(log: Log, resting: Collection[str] = ()) -> list[LogFinding]:
    """Return findings about positions and velocities that are held for a while.

    A value that is held and then jumps by what the other sensor saw meanwhile was lost; a joint
    that rests, or a coarse sensor, does not jump. At the end of a log there is no jump to see:
    there the other sensor must show a fifth of the whole motion.

    Args:
        log: the log.
        resting: joints that stand still throughout; nothing of theirs is lost.
    """
    findings: list[LogFinding] = []
    held = [joint for joint in log.with_quantity("position") if log.has(f"{joint}.velocity")]
    for joint in (joint for joint in held if joint not in resting):
        names = [f"{joint}.position", f"{joint}.velocity"]
        position, velocity = map(log.column, names)
        if np.ptp(position) == 0.0 or np.ptp(velocity) == 0.0:
            continue
        for name, values in zip(names, (position, velocity), strict=True):
            starts, ends = true_runs(np.diff(values) == 0.0)
            length = int(np.max(ends - starts, initial=0))
            start = int(starts[np.argmax(ends - starts)]) if length else 0
            seconds = float(log.time[start + length] - log.time[start])
            if length < _SAMPLES or seconds < _SECONDS:
                continue
            # The later half alone: a velocity that lags behind dies out in the first.
            rows, stop = slice(start + length // 2, start + length + 1), start + length + 1
            moved = abs(float(position[stop - 1] - position[rows.start]))
            seen = abs(moved - abs(float(trapezoid(velocity[rows], log.time[rows]))))
            jump = abs(float(values[stop] - values[stop - 1])) if stop < len(log) else 0.0
            least = max(seen if values is position else 0.1 * np.ptp(velocity), 5.0 * _step(values))
            known = values is velocity or seen > 2.0 * _step(position)
            lost = seen > _END_SHARE * np.ptp(position)
            if (seen > 0.0 and known and jump > least) if stop < len(log) else lost:
                text = f"one value for {seconds:.3f} s from {log.time[start]:.3f} s on, while the "
                way = "The sensor or its link dropped out: leave that time out (log.between)."
                findings.append(LogFinding("error", "stuck", name, f"{text}joint moves.", way))
    return findings


def _step(values: FloatArray) -> float:
    steps = np.abs(np.diff(values))
    return float(np.median(steps[steps > 0.0]))


_SAMPLE_ROWS = 200_000


def true_runs(mask: BoolArray) -> tuple[IntArray, IntArray]:
    """Return the first rows of all runs of True, and the rows after their last ones."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return edges[::2], edges[1::2]


def resolution(values: FloatArray) -> float:
    """Return the step of a quantised channel, 0 where none shows.

    The step is the smallest distance of two values that occur, if nearly all distances of
    neighbouring values are multiples of it and values repeat as a grid makes them.
    """
    levels = np.unique(values[:_SAMPLE_ROWS])
    rows = min(values.size, _SAMPLE_ROWS)
    if levels.size < 3 or levels.size > 0.7 * rows:
        return 0.0
    span = float(levels[-1] - levels[0])
    distances = np.diff(levels)
    # Rounding in the file (single precision, printed digits) splits one level into several.
    distances = distances[distances > 1e-6 * span]
    if distances.size < 2:
        return 0.0
    step = float(np.quantile(distances, 0.05))
    multiples = distances / step
    on_grid = np.abs(multiples - np.round(multiples)) < 0.1
    if np.mean(on_grid & (multiples < 20.5)) < 0.8:
        return 0.0
    return float(np.median(distances[on_grid] / np.round(multiples[on_grid])))


def plateau(
    values: FloatArray, position: FloatArray | None = None
) -> tuple[float, float, float, int]:
    """Return (lowest, highest, share, runs): how much of a channel is cut off at its extremes.

    Only runs of at least three equal samples at an extreme count (a peak touches it once), and only
    those during which the joint moves (a drive that holds a pose repeats its value too).

    Args:
        values: (N,) the channel.
        position: (N,) of the joint, None if it is not known.
    """
    low, high = float(values.min()), float(values.max())
    share, runs = 0.0, 0
    # What a joint at rest may seem to travel: its resolution, a thousandth of its range.
    least = 0.0 if position is None else max(2.0 * resolution(position), 1e-3 * np.ptp(position))
    for extreme in {low, high} - {0.0}:
        starts, ends = true_runs(values == extreme)
        for start, end in zip(starts, ends, strict=True):
            if end - start < 3 or (
                position is not None and np.ptp(position[start + 1 : end]) <= least
            ):
                continue
            share += float(end - start) / values.size
            runs += 1
    return low, high, share, runs
