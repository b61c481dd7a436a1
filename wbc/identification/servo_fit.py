"""Fitting a servo to its runs by output error: the simulated position against the measured one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from wbc.arrays import FloatArray
from wbc.errors import IdentificationError
from wbc.robot import Robot
from wbc.robot.dc_drive import DcDrive
from wbc.sim.servo_rollout import servo_rollout
from wbc.sim.servo_run import ServoRun

_SOFT = 0.03  # [rad] error from which on it counts linearly: a missed stick is no worse twice
_EVERY = 4  # rows of a rollout between two residuals of the fit
_STEP = 1e-4


class Span(NamedTuple):
    """Bounds and start of one number."""

    low: float
    start: float
    high: float


Build = Callable[[Mapping[str, float]], tuple[Robot, DcDrive]]


@dataclass(frozen=True, eq=False)
class ServoFit:
    """A servo fitted to runs.

    Attributes:
        values: the fitted numbers by name.
        robot, drive: built from them.
        cost: of the fit, to compare starts.
        at_bound: names of the numbers that ended on a bound.
    """

    values: Mapping[str, float]
    robot: Robot
    drive: DcDrive
    cost: float
    at_bound: tuple[str, ...]

    def error(self, runs: Sequence[ServoRun], step: float) -> FloatArray:
        """Return the mean absolute position error (L,) [rad] in rollouts of `runs`."""
        positions = servo_rollout([(self.robot, self.drive)], runs, step)[:, 0]
        return np.array(
            [
                np.mean(np.abs(positions[: run.position.size, k] - run.position))
                for k, run in enumerate(runs)
            ]
        )


def fit_servo(
    build: Build,
    spans: Mapping[str, Span],
    runs: Sequence[ServoRun],
    step: float,
    starts: Sequence[Mapping[str, float]] = ({},),
    evaluations: int = 60,
    hold: float = 0.0,
) -> ServoFit:
    """Return the servo whose rollouts come closest to the measured positions.

    Bounded least squares with a soft-L1 loss; the derivatives are differences, all variants of an
    iteration being simulated together.

    Args:
        build: makes robot and drive from the numbers.
        spans: name -> bounds and start.
        runs: measured runs.
        step: time step of the runs [s].
        starts: overrides of the starts; the best fit of all is returned.
        evaluations: of one fit, at most.
        hold: how strongly the numbers are held to the starts in `spans`: a number that doubles
            costs as much as a single residual of hold [rad]. It only decides what the runs leave
            open (friction against back-EMF, say).

    Raises:
        IdentificationError: nothing to fit, or no run.
    """
    if not spans or not runs:
        raise IdentificationError("fitting a servo needs at least one number and one run.")
    fits = [_fit(build, spans, runs, step, start, evaluations, hold) for start in starts]
    return min(fits, key=lambda fit: fit.cost)


def _fit(
    build: Build,
    spans: Mapping[str, Span],
    runs: Sequence[ServoRun],
    step: float,
    start: Mapping[str, float],
    evaluations: int,
    hold: float,
) -> ServoFit:
    names = list(spans)
    low = np.array([spans[name].low for name in names])
    high = np.array([spans[name].high for name in names])
    first = np.array([start.get(name, spans[name].start) for name in names])
    margin = 1e-6 * (high - low)
    first = np.clip(first, low + margin, high - margin)
    centre = np.array([spans[name].start for name in names])
    scale = np.maximum(np.abs(centre), 0.02 * (high - low))
    pull = np.diag(hold / scale)
    memory: dict[bytes, tuple[FloatArray, FloatArray]] = {}

    def both(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        if x.tobytes() not in memory:
            memory.clear()
            size = np.where(x + _STEP * scale > high, -_STEP, _STEP) * scale
            points = np.vstack([x, x + np.diag(size)])
            servos = [build(dict(zip(names, map(float, p), strict=True))) for p in points]
            residuals = _residuals(servos, runs, step)
            slopes = (residuals[1:] - residuals[0]).T / size
            memory[x.tobytes()] = (
                np.concatenate([residuals[0], pull @ (x - centre)]),
                np.vstack([slopes, pull]),
            )
        return memory[x.tobytes()]

    found = least_squares(
        lambda x: both(x)[0],
        first,
        lambda x: both(x)[1],
        bounds=(low, high),
        x_scale=scale,
        loss="soft_l1",
        f_scale=_SOFT,
        max_nfev=evaluations,
    )
    values = dict(zip(names, map(float, found.x), strict=True))
    edge = np.minimum(found.x - low, high - found.x) < 1e-3 * (high - low)
    at_bound = tuple(name for name, close in zip(names, edge, strict=True) if close)
    robot, drive = build(values)
    return ServoFit(values, robot, drive, float(found.cost), at_bound)


def _residuals(
    servos: Sequence[tuple[Robot, DcDrive]], runs: Sequence[ServoRun], step: float
) -> FloatArray:
    """Return (V, rows) position errors of all variants, thinned, runs one after another."""
    positions = servo_rollout(servos, runs, step)
    parts = [
        (positions[: run.position.size, :, k] - run.position[:, None])[::_EVERY]
        for k, run in enumerate(runs)
    ]
    return np.concatenate(parts).T
