"""Fitting a servo to its runs by output error: the simulated position against the measured one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import IdentificationError, unknown_name
from wbc.identification.servo.lockstep_fit import FitStart, lockstep_fit
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


def fit_servo(
    build: Build,
    spans: Mapping[str, Span],
    runs: Sequence[ServoRun],
    step: float,
    starts: Sequence[Mapping[str, float]] = ({},),
    iterations: int = 40,
    hold: Mapping[str, float] = MappingProxyType({}),
) -> ServoFit:
    """Return the servo whose rollouts come closest to the measured positions.

    One fit of `fit_servos` to all runs; arguments and errors are described there.
    """
    return fit_servos(build, spans, runs, step, [range(len(runs))], starts, iterations, hold)[0]


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
