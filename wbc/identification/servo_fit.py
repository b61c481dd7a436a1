"""Fitting a servo to its runs by output error: the simulated position against the measured one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from wbc.arrays import FloatArray
from wbc.errors import IdentificationError, unknown_name
from wbc.robot import Robot
from wbc.robot.dc_drive import DcDrive
from wbc.sim.servo_rollout import servo_rollout
from wbc.sim.servo_run import ServoRun

_SOFT = 0.03  # [rad] error from which on it counts linearly: a missed stick is no worse twice
_EVERY = 4  # rows of a rollout between two residuals of the fit


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
        missed = [positions[: run.position.size, k] - run.position for k, run in enumerate(runs)]
        return np.array([np.mean(np.abs(one)) for one in missed])


def fit_servos(
    build: Build,
    spans: Mapping[str, Span],
    runs: Sequence[ServoRun],
    step: float,
    subsets: Sequence[Sequence[int]],
    starts: Sequence[Mapping[str, float]] = ({},),
    iterations: int = 40,
    hold: Mapping[str, float] = MappingProxyType({}),
) -> list[ServoFit]:
    """Return one fit for each subset of the runs.

    Bounded least squares with a soft-L1 loss; the derivatives are differences. All fits go in
    step, so that one rollout simulates the variants of all of them: the fits of a
    cross-validation cost little more than one.

    Args:
        build: makes robot and drive from the numbers.
        spans: name -> bounds and start.
        runs: measured runs.
        step: time step of the runs [s].
        subsets: rows of `runs` that each fit sees.
        starts: overrides of the starts; the best fit of all is returned.
        iterations: of one fit, at most.
        hold: name -> how strongly the number is held to its start in `spans`: doubling it costs
            as much as a single residual of hold [rad]. It only decides what the runs leave open
            (friction against back-EMF, say).

    Raises:
        IdentificationError: nothing to fit, no run, or a held number that is not fitted.
    """
    if not spans or not subsets or any(len(subset) == 0 for subset in subsets):
        raise IdentificationError("fitting a servo needs at least one number and one run.")
    for name in hold:
        if name not in spans:
            raise IdentificationError(unknown_name("number of the fit", name, spans))
    names, table = list(spans), np.array([tuple(span) for span in spans.values()])
    low, center, high = table.T
    scale = np.maximum(np.abs(center), 0.02 * (high - low))
    firsts = [np.array([start.get(name, spans[name].start) for name in names]) for start in starts]
    row_of = np.concatenate([np.full(len(r.position[::_EVERY]), k) for k, r in enumerate(runs)])
    seen = np.array([np.isin(range(len(runs)), subset) for subset in subsets for _ in firsts])

    def residuals(points: FloatArray, tasks: Sequence[int]) -> FloatArray:
        """Return the errors (V, rows) of V variants, thinned, runs one after another."""
        servos = [build(dict(zip(names, map(float, p), strict=True))) for p in points]
        positions = servo_rollout(servos, runs, step, seen[list(tasks)])
        parts = [
            positions[: run.position.size : _EVERY, :, k] - run.position[::_EVERY, None]
            for k, run in enumerate(runs)
        ]
        return np.concatenate(parts).T

    tasks = [FitStart(first, np.isin(row_of, subset)) for subset in subsets for first in firsts]
    pull = np.array([hold.get(name, 0.0) for name in names]) / scale
    found = lockstep_fit(residuals, tasks, (low, high), scale, (pull, center), _SOFT, iterations)
    best = []
    for k in range(len(subsets)):
        x, cost = min(found[k * len(firsts) : (k + 1) * len(firsts)], key=lambda one: one[1])
        edge = np.minimum(x - low, high - x) < 1e-3 * (high - low)
        values = dict(zip(names, map(float, x), strict=True))
        at_bound = tuple(name for name, close in zip(names, edge, strict=True) if close)
        best.append(ServoFit(values, *build(values), cost, at_bound))
    return best


_STEP = 1e-3  # of the differences, in scales: small beside a fit's own uncertainty
_TRIES = (0.1, 1.0, 10.0)  # dampings tried at once, times the present one
_ENOUGH = 1e-4  # relative fall of the cost below which an iteration has gained nothing


class FitStart(NamedTuple):
    """Where one fit starts, (n,), and the rows (R,) of the residual that it sees."""

    first: FloatArray
    rows: npt.NDArray[np.bool_]


class _Point(NamedTuple):
    """Numbers of a fit, its residual (with the pull) and cost there."""

    x: FloatArray
    residual: FloatArray
    cost: float


def lockstep_fit(
    residuals: Callable[[FloatArray, Sequence[int]], FloatArray],
    tasks: Sequence[FitStart],
    bounds: tuple[FloatArray, FloatArray],
    scale: FloatArray,
    pull: tuple[FloatArray, FloatArray],
    soft: float,
    iterations: int,
) -> list[tuple[FloatArray, float]]:
    """Return (numbers (n,), cost) of each task, by Levenberg-Marquardt steps taken together.

    The cost is the sum of soft^2 (sqrt(1 + (r / soft)^2) - 1) over the residuals r of a task and
    over pull (x - centre); a number whose bound the cost pushes against is kept there (gradient
    projection). Several dampings are tried at once, so that hardly an iteration is lost to a step
    that jumps (dry friction makes such costs rough).

    Args:
        residuals: (V, n) numbers and the task (V,) of each -> (V, R) residuals; rows that the
            task does not see are not read.
        tasks: the fits.
        bounds: low and high, (n,) each.
        scale: typical sizes of the numbers, (n,), > 0.
        pull: weight and centre, (n,) each, of residuals that hold the numbers.
        soft: residual from which on it counts linearly.
        iterations: at most.
    """
    low, high = bounds
    idle = np.zeros(len(tasks), dtype=int)
    damping = np.full(len(tasks), 1e-2)

    def points(xs: FloatArray, of: Sequence[int]) -> list[_Point]:
        table = residuals(xs, of)
        result = []
        for x, row, k in zip(xs, table, of, strict=True):
            full = np.concatenate([row[tasks[k].rows], pull[0] * (x - pull[1])])
            loss = soft**2 * np.sum(np.sqrt(1.0 + (full / soft) ** 2) - 1.0)
            result.append(_Point(x, full, float(loss)))
        return result

    at = points(np.stack([np.clip(t.first, low, high) for t in tasks]), range(len(tasks)))
    for _ in range(iterations):
        active = [k for k in range(len(tasks)) if idle[k] < 2]
        if not active:
            break
        sides = [np.where(at[k].x + _STEP * scale > high, -_STEP, _STEP) * scale for k in active]
        moved = [at[k].x + np.diag(side) for k, side in zip(active, sides, strict=True)]
        around = points(np.concatenate(moved), np.repeat(active, scale.size).tolist())
        tries: list[FloatArray] = []
        for place, (k, side) in enumerate(zip(active, sides, strict=True)):
            near = around[place * scale.size : (place + 1) * scale.size]
            slopes = np.stack([p.residual - at[k].residual for p in near], axis=1) / side * scale
            weights = 1.0 / np.sqrt(1.0 + (at[k].residual / soft) ** 2)
            limits = (low - at[k].x) / scale, (high - at[k].x) / scale
            steps = _steps(slopes, weights, at[k].residual, limits, damping[k] * np.array(_TRIES))
            tries.extend(np.clip(at[k].x + scale * step, low, high) for step in steps)
        reached = points(np.stack(tries), np.repeat(active, len(_TRIES)).tolist())
        for place, k in enumerate(active):
            options = reached[place * len(_TRIES) : (place + 1) * len(_TRIES)]
            best = min(range(len(_TRIES)), key=lambda i: options[i].cost)
            gain = 1.0 - options[best].cost / max(at[k].cost, 1e-300)
            idle[k] = 0 if gain > _ENOUGH else idle[k] + 1
            damping[k] = np.clip(damping[k] * (_TRIES[best] if gain > 0.0 else 30.0), 1e-8, 1e6)
            at[k] = options[best] if gain > 0.0 else at[k]
    return [(point.x, point.cost) for point in at]


def _steps(
    slopes: FloatArray,
    weights: FloatArray,
    residual: FloatArray,
    limits: tuple[FloatArray, FloatArray],
    dampings: FloatArray,
) -> list[FloatArray]:
    """Return one step (n,) in scales for each damping; blocked numbers stay."""
    gradient = slopes.T @ (weights * residual)
    square = slopes.T @ (weights[:, None] * slopes)
    blocked = ((limits[0] >= 0.0) & (gradient > 0.0)) | ((limits[1] <= 0.0) & (gradient < 0.0))
    free = np.flatnonzero(~blocked)
    diagonal = np.diag(square)
    steps = []
    for damping in dampings:
        step = np.zeros(gradient.size)
        extra = damping * np.maximum(diagonal, 1e-9 * diagonal.max(initial=1e-300))
        matrix = (square + np.diag(extra + 1e-300))[np.ix_(free, free)]
        step[free] = -np.linalg.lstsq(matrix, gradient[free], rcond=None)[0]
        steps.append(step)
    return steps
