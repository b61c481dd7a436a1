"""The one filter without phase shift, derivatives, noise, jumps, and velocity against position."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from math import factorial

import numpy as np
import pinocchio as pin
from scipy import sparse
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import PchipInterpolator
from scipy.signal import butter, sosfilt_zi

from wbc.arrays import FloatArray, IntArray
from wbc.errors import LogError
from wbc.measurement.log import Log

WINDOW_SAMPLES = 11
"""Samples that a local polynomial sees."""
_NOISE_DEGREE = 4
_MAD_OF_GAUSSIAN = 0.674489750196
_MOST_ROWS = 50_000
_ROWS_AT_ONCE = 16_384
_ALIKE = 1e-9  # of a window's width: rounding of time stamps


def low_pass(values: FloatArray, cutoff: float, rate: float, order: int = 2) -> FloatArray:
    """Return `values` (N, ...) low-passed forward and backward (no phase shift).

    The same call on torque, velocity and position keeps them in step, which an identification
    needs more than a faithful amplitude.

    Args:
        values: samples along the first axis.
        cutoff: [Hz] of each of the two passes of a Butterworth filter.
        rate: [Hz] sampling rate; a cutoff at or above half of it leaves the values unchanged.
        order: of each pass.
    """
    if cutoff >= 0.5 * rate or len(values) < 4 or not values.size:
        return values
    padding = min(len(values) - 1, int(3.0 * rate / cutoff))
    before = 2.0 * values[0] - values[padding:0:-1]
    after = 2.0 * values[-1] - values[-2 : -padding - 2 : -1]
    from wbc.mechanics.series import filter_both_ways  # loads the compiler

    longer = np.concatenate([before, values, after]).reshape(-1, values[0].size)
    filter_both_ways(*_sections(cutoff / (0.5 * rate), order), longer)
    return longer[padding : padding + len(values)].reshape(values.shape)


@lru_cache(maxsize=64)
def _sections(relative: float, order: int) -> tuple[FloatArray, FloatArray]:
    """Return a Butterworth filter's sections and their state under a steady input of one."""
    sections = butter(order, relative, output="sos")
    return np.asarray(sections), np.asarray(sosfilt_zi(sections))


def derivative(values: FloatArray, rate: float) -> FloatArray:
    """Return the time derivative of `values` (N, ...) by fourth-order central differences.

    Second-order ones shrink a 5 Hz acceleration sampled at 500 Hz by a thousandth, which shows in
    an inertia; the first and last two samples are of second order.

    Args:
        values: samples along the first axis.
        rate: [Hz].
    """
    result = np.gradient(values, 1.0 / rate, axis=0)
    if len(values) > 4:
        inner = 8.0 * (values[3:-1] - values[1:-3]) - (values[4:] - values[:-4])
        result[2:-2] = inner * (rate / 12.0)
    return np.asarray(result)


def differentiate(positions: FloatArray, rate: float, model: pin.Model) -> FloatArray:
    """Return the velocity (N, nv) of configurations (N, nq) by central differences.

    Args:
        positions: pinocchio's configurations, already smoothed.
        rate: [Hz].
        model: gives the difference on joints whose configuration is no vector (free-flyer).
    """
    if model.nq == model.nv:
        return derivative(positions, rate)
    steps = np.array([pin.difference(model, a, b) for a, b in pairwise(positions)])
    inner = 0.5 * (steps[:-1] + steps[1:])
    return np.concatenate([steps[:1], inner, steps[-1:]]) * rate


def local_polynomial_operator(
    time: FloatArray, degree: int = 3, derivative: int = 0
) -> sparse.csr_array:
    """Return the banded operator A (N, N) with (A y)(t_i) = d^k y/dt^k of a local fit.

    At every time stamp a polynomial is fitted to the 11 samples around it by weighted least squares
    (tricube weights) on the true, possibly jittered stamps; A acts on any number of channels at
    once (A @ Y with Y (N, n)). At the ends the window turns one-sided. The classic uniform case is
    Savitzky & Golay, Analytical Chemistry 36 (1964); the weights are Cleveland's, JASA 74 (1979).

    Args:
        time: (N,) [s], increasing, at least one window.
        degree: of the polynomial.
        derivative: k, at most the degree.
    """
    size, step = WINDOW_SAMPLES, float(np.median(np.diff(time)))
    first = np.clip(np.arange(time.size) - size // 2, 0, time.size - size)
    columns = first[:, None] + np.arange(size)
    weights = np.empty((time.size, size))
    for start in range(0, time.size, _ROWS_AT_ONCE):
        rows = slice(start, start + _ROWS_AT_ONCE)
        offsets = time[columns[rows]] - time[rows, None]
        # On an even grid all windows inside are alike.
        inner = offsets[len(offsets) // 2]
        other = np.abs(offsets - inner).max(axis=1) > _ALIKE * size * step
        weights[rows] = _weights(inner[None], degree, derivative)
        weights[rows][other] = _weights(offsets[other], degree, derivative)
    pointers, shape = np.arange(0, time.size * size + 1, size), (time.size, time.size)
    return sparse.csr_array((weights.ravel(), columns.ravel(), pointers), shape=shape)


def _weights(offsets: FloatArray, degree: int, derivative: int) -> FloatArray:
    """Return for each window (rows of `offsets`) the weights of its samples, same shape."""
    reach = np.abs(offsets).max(axis=1, keepdims=True)
    scaled = offsets / reach
    kernel = (1.0 - (0.999 * np.abs(scaled)) ** 3) ** 3
    powers = scaled[:, :, None] ** np.arange(degree + 1)
    weighted = powers * kernel[:, :, None]
    normal = np.einsum("rsp,rsq->rpq", weighted, powers)
    unit = np.zeros((len(normal), degree + 1, 1))
    unit[:, derivative] = factorial(derivative)
    values = np.einsum("rsp,rp->rs", weighted, np.linalg.solve(normal, unit)[:, :, 0])
    return np.asarray(values / reach**derivative)


def residual_noise(time: FloatArray, values: FloatArray) -> float:
    """Return the standard deviation of what a local polynomial leaves of a channel.

    A lower bound: noise that is slow against 11 samples, or that a filter of the drive has taken
    out, does not show. Robust against single steps (median absolute deviation), corrected for the
    degrees of freedom that the polynomial takes up.

    Args:
        time: (N,) [s].
        values: (N,).
    """
    if time.size < 2 * WINDOW_SAMPLES:
        return 0.0
    inner = unsmooth(time[:_MOST_ROWS], values[:_MOST_ROWS])[WINDOW_SAMPLES:-WINDOW_SAMPLES]
    robust = float(np.median(np.abs(inner)) / _MAD_OF_GAUSSIAN)
    # A coarse sensor stands still most of the time: half of the residuals vanish, not its noise.
    return robust if robust > 0.0 else float(np.std(inner))


def unsmooth(time: FloatArray, values: FloatArray) -> FloatArray:
    """Return what a local polynomial leaves of each sample, as large as the noise in it.

    Args:
        time: (N,) [s], at least two windows.
        values: (N, ...).

    Returns:
        Same shape as the values, corrected for the degrees of freedom of the polynomial.
    """
    smooth = local_polynomial_operator(time, _NOISE_DEGREE)
    own = np.sqrt(np.maximum(1.0 - smooth.diagonal(), 0.05))
    return np.asarray(((values - smooth @ values).T / own).T)


_BLOCKS = 8
_BLOCK_ROWS = 40
_FILTER_SAMPLES = 2.0
_LONGEST_DELAY = 0.2


WELL_CORRELATED = 0.9
"""Least correlation of a position and the integral of its velocity that are of one joint."""
_DELAY_SAMPLES, _DELAY_ERRORS = 0.25, 4.0  # up to which a delay is none
_MISSING = 1.5  # usual steps of time, in which samples are missing


@dataclass(frozen=True)
class VelocityFit:
    """velocity(t) = scale dq/dt(t - delay), or the same through a first-order low-pass.

    Attributes:
        scale: 1 for a velocity that is the derivative of the position.
        delay: of the velocity behind the position [s], negative if it leads; the time constant of
            a low-pass is its delay at low frequency.
        delay_error: standard error of the delay [s], from the scatter between blocks of the log.
        correlation: between the position and the integral of the velocity, delay and trends taken
            out; its sign is that of the scale.
        filtered: whether a first-order low-pass explains the velocity better than a pure delay.
    """

    scale: float
    delay: float
    delay_error: float
    correlation: float
    filtered: bool

    def late(self, sample_time: float) -> bool:
        """Whether it is behind or ahead by more than chance and a part of a sample [s] would be."""
        least = max(_DELAY_SAMPLES * sample_time, _DELAY_ERRORS * self.delay_error)
        return abs(self.correlation) > WELL_CORRELATED and abs(self.delay) > least


def fit_velocity(
    time: FloatArray, position: FloatArray, velocity: FloatArray
) -> VelocityFit | None:
    """Fit scale and delay by regression of the position on the integral of the velocity.

    A low-pass T dv/dt + v = k dq/dt gives q = (1/k) (int v dt + T v) + constant without error, a
    delay d = T the same for a delay that is short against the motion. Regressing q on
    (int v, v, t, 1) gives both numbers without differentiating noise, on jittered stamps, finer
    than a sample; the term in t takes up an offset of the velocity. Which of the two it is, the
    residuals tell; below two samples they are the same.

    Args:
        time: (N,) [s].
        position: (N,), continuous (wraps removed).
        velocity: (N,).

    Returns:
        None where nothing moves.
    """
    integral = cumulative_trapezoid(velocity, time, initial=0.0)
    whole = _regress(time, position, integral, velocity)
    if whole is None:
        return None
    (inverse, late), correlation, residual = whole
    if abs(late) > _LONGEST_DELAY * (time[-1] - time[0]) * abs(inverse):
        # No delay, but a channel that resembles the position itself.
        alone = _regress(time, position, integral)
        return VelocityFit(1.0, 0.0, np.inf, alone[1] if alone else 0.0, False)
    lag, delays = float(late / inverse), []
    size = max(_BLOCK_ROWS, time.size // _BLOCKS)
    for k in range(0, time.size - size + 1, size):
        part = _regress(*(x[k : k + size] for x in (time, position, integral, velocity)))
        longest = _LONGEST_DELAY * (time[k + size - 1] - time[k])
        if part and part[1] > 0.9 and abs(part[0][1]) <= longest * abs(part[0][0]):
            delays.append(part[0][1] / part[0][0])
    spread = np.inf
    if len(delays) >= 3:
        lag = float(np.median(delays))
        spread = float(1.4826 * np.median(np.abs(np.array(delays) - lag)) / np.sqrt(len(delays)))
    filtered = False
    if lag > _FILTER_SAMPLES * float(np.median(np.diff(time))):
        inside, delayed = time + lag <= time[-1], np.interp(time + lag, time, integral)
        other = _regress(*(x[inside] for x in (time, position, delayed)))
        filtered = other is not None and residual < 0.5 * other[2]
    return VelocityFit(float(1.0 / inverse), lag, spread, correlation, filtered)


def _regress(
    time: FloatArray, position: FloatArray, *signals: FloatArray
) -> tuple[FloatArray, float, float] | None:
    """Return (coefficients, correlation, rms residual) of a position in terms of some signals.

    Straight lines are taken out of all. None where nothing moves, or signals are alike; the sign of
    the correlation is that of the first coefficient.
    """
    table = np.stack([position, *signals], axis=1)
    basis, _ = np.linalg.qr(np.stack([np.ones_like(time), time - time.mean()], axis=1))
    table = table - basis @ (basis.T @ table)
    gram = table.T @ table
    powers, own = np.diag(gram), gram[1:, 1:]
    if powers.min() <= 1e-24 * time.size or np.linalg.det(own) <= 1e-10 * powers[1:].prod():
        return None
    found = np.linalg.solve(own, gram[1:, 0])
    rest = table @ np.array([1.0, *-found])
    left = float(rest @ rest)
    correlation = float(np.sign(found[0]) * np.sqrt(max(0.0, 1.0 - left / powers[0])))
    return found, correlation, float(np.sqrt(left / time.size))


def velocity_fits(log: Log) -> dict[str, VelocityFit]:
    """Return the relation of velocity to position of every joint that has both and moves."""
    fits = dict[str, VelocityFit]()
    for joint in log.with_quantity("position"):
        position, velocity = log.column(f"{joint}.position"), log.columns.get(f"{joint}.velocity")
        if velocity is None or jumps(position).size:  # it wraps
            continue
        if fit := fit_velocity(log.time, position, velocity):
            fits[joint] = fit
    return fits


def late_velocities(log: Log) -> dict[str, VelocityFit]:
    """Return the same of the joints whose velocity is late or early."""
    fits = velocity_fits(log)
    return {joint: fit for joint, fit in fits.items() if fit.late(log.sample_time)}


def align_velocity(log: Log, late: Mapping[str, VelocityFit] | None = None) -> Log:
    """Return a log whose velocities are on the clock of the positions.

    A pure delay d is shifted out, v(t + d); a first-order low-pass with the time constant T is
    undone, v + T dv/dt (local polynomials over 11 samples, so that noise above their band is not
    raised). Which of the two it is, and how long, is what `check_log` finds; all other velocities
    stay as they are.

    Args:
        log: the log.
        late: of `late_velocities`, where it is known.

    Returns:
        The rows for which every shifted velocity exists; the ends of the log are lost.

    Raises:
        LogError: a delay as long as the log.
    """
    late = late_velocities(log) if late is None else late
    own = {f"{joint}.velocity": fit for joint, fit in late.items()}
    if filtered := {name: fit.delay for name, fit in own.items() if fit.filtered}:
        slope = local_polynomial_operator(log.time, derivative=1)
        held = {name: log.column(name) for name in filtered}
        log = log.with_columns({n: v + filtered[n] * (slope @ v) for n, v in held.items()})
    return shifted(log, {name: fit.delay for name, fit in own.items() if not fit.filtered})


def shifted(log: Log, lags: Mapping[str, float]) -> Log:
    """Return a log without the delays of some channels, x(t + lag).

    Args:
        log: the log.
        lags: channel -> by how much it is late [s], negative where it is early.

    Returns:
        The rows for which every channel exists; the ends of the log are lost.

    Raises:
        LogError: a delay as long as the log.
    """
    if not lags:
        return log
    early, late = min([0.0, *lags.values()]), max([0.0, *lags.values()])
    if late - early >= 0.5 * log.duration:
        worst = f"{max(late, -early):g} s"
        raise LogError(f"{log.source.label}: a delay of {worst} is as long as the log.")
    kept = log.between(log.time[0] - early, log.time[-1] - late + 1e-12)
    columns = {name: PchipInterpolator(log.time, log.column(name)) for name in lags}
    return kept.with_columns({name: own(kept.time + lags[name]) for name, own in columns.items()})


def turned(log: Log, names: Sequence[str], lag: float) -> Log:
    """Return a log without a delay of some channels, x(t + lag), with all of their noise.

    Curves between samples smooth the noise that tells a floor. Here each frequency of a channel,
    with its image behind each end, turns its phase. Where samples are missing curves have to do.

    Args:
        log: the log.
        names: of the channels.
        lag: by how much these are late [s], negative where they are early.
    """
    if not lag:
        return log
    kept, step = shifted(log, dict.fromkeys(names, lag)), log.sample_time
    if np.max(np.diff(log.time)) > _MISSING * step:
        return kept
    first = int(np.searchsorted(log.time, kept.time[0]))
    columns = {}
    for name in names:
        own = log.column(name)
        wide = np.concatenate([2.0 * own[0] - own[:0:-1], own, 2.0 * own[-1] - own[-2::-1]])
        phase = np.exp(2j * np.pi * np.fft.rfftfreq(len(wide)) * lag / step)
        moved = np.fft.irfft(np.fft.rfft(wide) * phase, len(wide))[len(own) - 1 :]
        columns[name] = moved[first : first + len(kept)]
    return kept.with_columns(columns)


def jumps(values: FloatArray) -> IntArray:
    """Return the rows (n,) after which a channel steps far beyond every usual step.

    A jump is a step of at least 20 times the 99th percentile and a quarter of the range. The last
    digit of a sensor at rest flickers: its step is usual, however rare it is.
    """
    size = np.abs(np.diff(values))
    usual = max(float(np.quantile(size, 0.99)), float(np.min(size[size > 0.0], initial=np.inf)))
    return np.flatnonzero((size > 20.0 * usual) & (size > 0.25 * np.ptp(values)))
