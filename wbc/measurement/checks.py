"""What speaks against logs by themselves: how they were read, clocks, channels, copies."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

import numpy as np
from scipy.integrate import cumulative_trapezoid, trapezoid

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.errors import LogError
from wbc.measurement.clocks import GAP_STEPS, gaps
from wbc.measurement.column_map import Mend, say_so
from wbc.measurement.filters import WELL_CORRELATED, residual_noise, velocity_fits
from wbc.measurement.log import CUT_FROM, Log, LogFinding, cut_at_gaps, too_short
from wbc.measurement.schema import split_column
from wbc.tables import few

_JITTER = 0.5
_RATE_RATIO = 1.5


def check_alone(log: Log, said: Collection[str]) -> Iterator[LogFinding]:
    """Yield what speaks against a log by itself: its clock, its channels, its velocities.

    Args:
        log: the log.
        said: columns of which others speak; velocities tell nothing on a `time` that is wrong.
    """
    resting = resting_joints(log)
    yield from _check_clock(log)
    way = "The log tells its static torque alone: move it in another log, or lock it in the robot."
    for name in sorted(f"{joint}.position" for joint in resting):
        place = log.column(name)
        text = f"the joint stands still (within {np.ptp(place):.2g} of {place.mean():.4g})."
        yield LogFinding("warning", "constant_joint", name, text, way)
    yield from _check_channels(log, resting)
    yield from _check_stuck(log, resting)
    yield from _check_velocities(log, {*said, *resting}) if "time" not in said else ()


def check_reading(log: Log, said: Sequence[LogFinding]) -> Iterator[LogFinding]:
    """Yield what reading the file found, without the columns of which others spoke."""
    yield from (LogFinding("info", "read", "", note, "") for note in log.source.notes)
    alike: dict[str, list[str]] = {}
    for column, text in log.source.unusable.items():
        alike.setdefault(text.replace(column, "*"), []).append(column)
    for columns in () if any(finding.kind == "missing" for finding in said) else alike.values():
        text = log.source.unusable[columns[0]]
        if len(columns) > 1:
            text += f" The same rows lack {', '.join(columns[1:])}."
        yield LogFinding("warning", "missing", ", ".join(columns), text, "")
    told = "".join(finding.way_out for finding in said)
    if ignored := ", ".join(name for name in log.source.ignored if f"'{name}'" not in told):
        way = "If one matters, give it the name of a channel."
        yield LogFinding("info", "unread", "", f"columns that were not read: {ignored}.", way)


def _check_clock(log: Log) -> Iterator[LogFinding]:
    """Yield findings about gaps, jitter and length."""
    steps = np.diff(log.time)
    median = float(np.median(steps))
    holes = gaps(log.time)
    if holes.size:
        first, longest = f"{log.time[holes[0]]:.4f} s", f"{1e3 * steps.max():.1f} ms"
        text = f"{holes.size} gaps longer than {GAP_STEPS:g} samples; the first at {first}, the "
        text += f"longest {longest}."
        severity, way = "warning", "Derivatives across a gap mean nothing: compare and diagnose "
        way += f"cut the log where more than {1e3 * CUT_FROM:g} ms are missing."
        try:
            cut_at_gaps([log])
        except LogError as cause:
            severity, text, way = "error", str(cause).removeprefix(f"{log.source.label}: "), ""
        yield LogFinding(severity, "gap", "time", text, way)
    jitter = float(np.std(steps[steps <= GAP_STEPS * median]) / median)
    if jitter > _JITTER:
        text = f"the distances of the time stamps scatter by {100.0 * jitter:.0f} % of a sample."
        way = "Stamp the samples where they are measured, not where they are received."
        yield LogFinding("warning", "jitter", "time", text, way)
    if (short := too_short(log)) is not None:
        yield short


def _check_velocities(log: Log, said: Collection[str]) -> Iterator[LogFinding]:
    """Yield findings about velocities that are late or of something else.

    Args:
        log: the log.
        said: columns and joints of which others speak.
    """
    for joint, fit in velocity_fits(log).items():
        name, late = f"{joint}.velocity", 1e3 * fit.delay
        if {joint, name} & {*said}:
            continue
        if abs(fit.correlation) < WELL_CORRELATED:
            text = f"its integral and the position correlate by {fit.correlation:.2f} only."
            way = "Check that both belong to one joint; leave the velocity out if it is noise."
            yield LogFinding("warning", "velocity_unrelated", name, text, way)
        if fit.late(log.sample_time):  # none is that correlates badly
            kind, side = "clock_lag", "behind" if late > 0.0 else "ahead of"
            samples = abs(fit.delay) / log.sample_time
            text = f"{abs(late):.2f} ms ({samples:.1f} samples) {side} the position."
            if fit.filtered:
                kind = "velocity_filtered"
                text = f"it has gone through a low-pass with a time constant of {late:.1f} ms."
            mend: Mend = {"time": {"align_velocity": True}}
            way = f"To take it out, {say_so(mend)}\nTo use the position instead, "
            way += say_so({"columns": {name: False}})
            yield LogFinding("warning", kind, name, text, way, mend)


def check_set(logs: Sequence[Log]) -> Iterator[LogFinding]:
    """Yield findings about duplicates, different joints, channels and rates."""
    for group in find_duplicates(logs):
        labels = [logs[k].source.label for k in group]
        text = f"the same data more than once: {few(labels, 6)}."
        way = "Give each recording once; a copy is no repeat, it says nothing about noise."
        yield LogFinding("error", "duplicate", "", text, way)
    first = logs[0]
    for log in logs[1:]:
        if set(log.joints) != set(first.joints):
            has = (f"{x.source.label} has the joints {', '.join(x.joints)}" for x in (log, first))
            way = "Logs given together must be of one robot."
            yield LogFinding("error", "joints_differ", "", f"{'; '.join(has)}.", way)
        elif odd := ", ".join(sorted({*first.names} ^ {*log.names})):
            text = f"{log.source.label} and {first.source.label} differ in the channels {odd}."
            way = "Only channels that all logs have are used together."
            yield LogFinding("warning", "channels_differ", "", text, way)
    slow, fast = (pick(logs, key=lambda log: log.sample_time) for pick in (max, min))
    if slow.sample_time >= _RATE_RATIO * fast.sample_time:
        has = (f"{one.source.label} has {1.0 / one.sample_time:.4g} Hz" for one in (slow, fast))
        way = "Fine if they were recorded so; otherwise one clock is in another unit."
        yield LogFinding("warning", "rates_differ", "time", f"{', '.join(has)}.", way)


_SATURATED_SHARE = 0.005
_COARSE_SHARE = 0.1
_FULL_DUTY = 0.995
_ACTUATION = ("rotor_torque", "motor_torque", "current", "duty")
_MOTION = ("position", "velocity", "rotor_position")
_MEASURED = (*_MOTION, *_ACTUATION, "joint_torque")
_SECONDS = 0.1
_SAMPLES = 5
_END_SHARE = 0.2
_TOLD = 0.1  # of what a velocity jumps by once it is back, that the position must have shown
_MOVES = 5.0  # times the noise, as for the suspicions about columns
_ROUNDING = 1e-6  # of the range: smaller steps come from printed digits
_WALK = 1.0 / 15.0  # mean square of a random walk over its length, its best line taken out


def _check_channels(log: Log, resting: Collection[str]) -> Iterator[LogFinding]:
    """Yield findings about every measured channel of the joints.

    Args:
        log: the log.
        resting: joints that stand still, whose motion and resolution are not judged.
    """
    for name, values in log.columns.items():
        joint, quantity = split_column(name) or ("", "")
        if quantity not in _MEASURED or (joint in resting and quantity in _MOTION):
            continue
        if values[0] == values[-1] and np.ptp(values) == 0.0:
            kind, way = "constant_channel", "Fine if unpowered; else the channel is not connected."
            text = f"{values[0]:g} throughout."
            if quantity == "position":
                kind, way = "constant_joint", "The channel is not connected."
                text = f"{values[0]:g} throughout, while the velocity changes."
            idle = quantity in _ACTUATION and values[0] == 0.0
            yield LogFinding("info" if idle else "warning", kind, name, text, way)
            continue
        step, spread = resolution(values), float(np.std(values))
        if step > _COARSE_SHARE * spread and joint not in resting:
            text = f"the resolution {step:.4g} is {100.0 * step / spread:.0f} % of its spread."
            way = "Excite more, or read it with more bits."
            yield LogFinding("warning", "coarse", name, text, way)
        # A duty of one is the limit by definition, whether the joint moves or not.
        full = quantity == "duty" and float(np.abs(values).max()) >= _FULL_DUTY
        position = None if full else log.columns.get(f"{joint}.position")
        low, high, share, runs = plateau(values, position)
        if quantity in _ACTUATION and share >= _SATURATED_SHARE and (runs >= 3 or full):
            text = f"{100.0 * share:.1f} % of the samples sit at an extreme ({low:g} or {high:g})."
            way = "The drive or its sensor is at its limit: what it really did there is unknown. "
            way += "Leave those times out, or excite less."
            yield LogFinding("warning", "saturation", name, text, way)


def resting_joints(log: Log) -> frozenset[str]:
    """Return the joints that neither their position nor their velocity shows to move.

    A position flickers by its noise and by the count of its encoder; the integral of a velocity
    strays by a constant offset, by the random walk of its noise and by its rounding.
    """
    return frozenset(joint for joint in log.with_quantity("position") if not _moves(log, joint))


def _moves(log: Log, joint: str) -> bool:
    time, position = log.time, log.column(f"{joint}.position")
    unsure = 0.0  # the deviation from the mean of one value is what rounding makes of it
    if np.ptp(position) > 0.0:
        spread, steps = float(np.std(position)), float(np.sqrt(np.mean(np.diff(position) ** 2)))
        rounded = _rounding(position)
        # The steps from row to row hold all of the noise: what is far above them needs no filter.
        if spread > 2.0 * _MOVES * np.hypot(steps, rounded):
            return True
        unsure = float(np.hypot(residual_noise(time, position), rounded))
        if spread > _MOVES * unsure:
            return True
    velocity = log.columns.get(f"{joint}.velocity", np.zeros(1))
    if np.ptp(velocity) == 0.0:
        return False
    integral = cumulative_trapezoid(velocity, time, initial=0.0)
    line = np.polynomial.Polynomial.fit(time, integral, 1)
    strays = float(np.std(integral - line(time)))
    walk = residual_noise(time, velocity) * log.sample_time * np.sqrt(_WALK * time.size)
    # A value that is held is off by the same rounding all the while.
    ends = np.flatnonzero(np.diff(velocity))
    held = np.diff(time[np.concatenate([[0], ends, [time.size - 1]])])
    rounded = _rounding(velocity) * float(np.linalg.norm(held))
    return bool(strays > _MOVES * np.hypot(np.hypot(walk, rounded), unsure))


def _rounding(position: FloatArray) -> float:
    steps = np.abs(np.diff(position))
    steps = steps[steps > _ROUNDING * max(float(np.ptp(position)), 1e-300)]
    return float(steps.min()) / np.sqrt(12.0) if steps.size else 0.0


def _check_stuck(log: Log, resting: Collection[str]) -> Iterator[LogFinding]:
    """Yield findings about positions and velocities that are held for a while.

    A value that is held and then jumps by what the other sensor saw meanwhile was lost; a joint
    that rests, or a coarse sensor, does not jump. At the end of a log there is no jump to see:
    there the other sensor must show a fifth of the whole motion, and a speed that it resolves.

    Args:
        log: the log.
        resting: joints that stand still throughout; nothing of theirs is lost.
    """
    for joint in log.with_quantity("position"):
        names = [f"{joint}.position", f"{joint}.velocity"]
        held = [log.columns.get(name, np.zeros(1)) for name in names]
        if joint in resting or not all(map(np.ptp, held)):
            continue
        position, velocity = held
        # What the velocity shows at rest, by the rows outside those that are held.
        steps = np.diff(log.time)
        strays = 0.5 * (velocity[1:] + velocity[:-1]) * steps - np.diff(position)
        for name, values in zip(names, held, strict=True):
            runs = zip(*true_runs(np.diff(values) == 0.0), strict=True)
            start, end = max(runs, key=lambda run: run[1] - run[0], default=(0, 0))
            seconds = float(log.time[end] - log.time[start])
            if end - start < _SAMPLES or seconds < _SECONDS:
                continue
            # The later half alone: a velocity that lags behind dies out in the first.
            rows, stop = slice((start + end) // 2, end + 1), end + 1
            moved = abs(float(position[end] - position[rows.start]))
            passed = log.time[rows][-1] - log.time[rows][0]
            others = np.delete(np.arange(steps.size), slice(start, stop))
            zero = strays[others].sum() / max(float(steps[others].sum()), 1e-300) * passed
            seen = abs(moved - abs(float(trapezoid(velocity[rows], log.time[rows])) - zero))
            jump = abs(float(values[stop] - values[stop - 1])) if stop < len(log) else 0.0
            least = max(seen if values is position else 0.1 * np.ptp(velocity), 5.0 * _step(values))
            # Where a velocity was lost, the position shows what it jumps by afterwards: 0.75 of it
            # in the later half, if it changes evenly; nothing at a joint that starts abruptly.
            told = _TOLD * jump * passed if values is velocity else 2.0 * _step(position)
            lost = seen > max(_END_SHARE * np.ptp(position), _step(velocity) * passed)
            if (seen > told and jump > least) if stop < len(log) else lost:
                text = f"one value for {seconds:.3f} s from {log.time[start]:.3f} s on, while the "
                way = "The sensor or its link dropped out: leave that time out (log.between)."
                yield LogFinding("error", "stuck", name, f"{text}joint moves.", way)


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
    distances = np.diff(levels)
    # Rounding in the file (single precision, printed digits) splits one level into several.
    distances = distances[distances > 1e-6 * np.ptp(levels)]
    if levels.size > 0.7 * min(values.size, _SAMPLE_ROWS) or distances.size < 2:
        return 0.0
    step = float(np.quantile(distances, 0.05))
    whole = np.round(distances / step)
    on_grid = np.abs(distances / step - whole) < 0.1
    if np.mean(on_grid & (whole <= 20.0)) < 0.8:
        return 0.0
    return float(np.median(distances[on_grid] / whole[on_grid]))


def plateau(values: FloatArray, position: FloatArray | None) -> tuple[float, float, float, int]:
    """Return (lowest, highest, share, runs): how much of a channel is cut off at its extremes.

    Only runs of at least three equal samples at an extreme count (a peak touches it once), and only
    those during which the joint moves (a drive that holds a pose repeats its value too).

    Args:
        values: (N,) the channel.
        position: (N,) of the joint, None if it is not known.
    """
    low, high = float(values.min()), float(values.max())
    # What a joint at rest may seem to travel: its resolution, a thousandth of its range.
    least = 0.0 if position is None else max(2.0 * resolution(position), 1e-3 * np.ptp(position))
    lengths = [
        end - start
        for extreme in {low, high} - {0.0}
        for start, end in zip(*true_runs(values == extreme), strict=True)
        if end - start >= 3 and (position is None or np.ptp(position[start + 1 : end]) > least)
    ]
    return low, high, float(sum(lengths)) / values.size, len(lengths)


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
    groups: dict[int, list[int]] = {}
    for k, log in enumerate(logs):
        if k not in copies:
            home = next((first for first in groups if _same_excitation(logs[first], log)), k)
            groups.setdefault(home, []).append(k)
    return tuple(tuple(group) for group in groups.values() if len(group) > 1)


def find_duplicates(logs: Sequence[Log]) -> tuple[tuple[int, ...], ...]:
    """Return groups of logs that hold the same data, as indices into `logs`.

    The same file counts, and so does the same data in other files (time counted from the start).
    """
    seen: dict[tuple[tuple[str, bytes], ...], list[int]] = {}
    for k, log in enumerate(logs):
        # Nine decimals, so that another file format changes nothing.
        held = {name: np.round(values, 9) for name, values in sorted(log.columns.items())}
        held |= {"": np.round(log.time - log.time[0], 6)}
        seen.setdefault(tuple((name, v.tobytes()) for name, v in held.items()), []).append(k)
    return tuple(tuple(group) for group in seen.values() if len(group) > 1)


def _same_excitation(a: Log, b: Log) -> bool:
    names = _motions(a)
    rates = [a.duration / b.duration, a.sample_time / b.sample_time]
    if names != _motions(b) or max(abs(ratio - 1.0) for ratio in rates) > 0.01:
        return False
    moved = False
    for name in names:
        first = a.column(name)
        second = np.interp(a.time - a.time[0], b.time - b.time[0], b.column(name))
        motion, noise = float(np.std(first)), _NOISE_ALLOWANCE * residual_noise(a.time, first)
        # A joint that stands still repeats its place within the noise of its sensor.
        if float(np.sqrt(np.mean((first - second) ** 2))) > _REPEATS * motion + noise:
            return False
        moved |= motion > noise
    return moved


def _motions(log: Log) -> list[str]:
    """Return the column that shows how each joint moves: its position, else its velocity."""
    ways = [[f"{joint}.{q}" for q in ("position", "velocity")] for joint in log.joints]
    return sorted(next(filter(log.has, names)) for names in ways if any(map(log.has, names)))
