"""One session of one machine: its errors and the parameters of the robot's effects, fitted anew."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.stats import norm

from wbc.effects import load_robot
from wbc.errors import failure_text
from wbc.identification.answer.diagnosis.diagnosis import Estimate
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.intervals import interval_bounds
from wbc.identification.records.outputs import output_names, output_units
from wbc.measurement import Log, load_logs
from wbc.robot import Robot
from wbc.robot.coordinates import unit_at

LEVEL = 0.9
"""Share of the intervals that hold the truth."""
DEVIATIONS = float(norm.ppf(0.5 + 0.5 * LEVEL))
"""Standard deviations from the value to the ends of such an interval."""

Quantity = tuple[str, str, str]
"""(effect, place, parameter); the effect is empty for the error of an output."""


@dataclass(frozen=True)
class Session:
    """What one worker measures.

    Attributes:
        robot: name or path of the robot, loaded anew by every worker.
        lossless: whether its gears are made perfect.
        columns: path of a column map.
        machine: whose logs they are.
        date: ISO 8601.
        paths: of the logs.
    """

    robot: str
    lossless: bool
    columns: str | None
    machine: str
    date: str
    paths: tuple[str, ...]


@dataclass(frozen=True)
class SessionResult:
    """What one session says.

    Attributes:
        machine: whose logs they are.
        date: ISO 8601.
        paths: of the logs.
        values: quantity -> estimate with its 90 % interval.
        failure: why there are none, empty otherwise.
        warnings: about the logs.
    """

    machine: str
    date: str
    paths: tuple[str, ...]
    values: Mapping[Quantity, Estimate] = field(default_factory=dict)
    failure: str = ""
    warnings: tuple[str, ...] = ()


def measure_session(session: Session) -> SessionResult:
    """Return errors and parameters of one session; any error is a failure of it alone."""
    machine, date, paths = session.machine, session.date, session.paths
    try:
        values, warnings = _measured(*robot_and_logs(session))
    except Exception as error:  # whatever one log does, the others are measured
        return SessionResult(machine, date, paths, failure=failure_text(error))
    return SessionResult(machine, date, paths, values, warnings=warnings)


def robot_and_logs(session: Session) -> tuple[Robot, tuple[Log, ...]]:
    """Return the robot of a session and its logs, read with the robot's gear ratios."""
    robot = load_robot(session.robot)
    robot = robot.lossless() if session.lossless else robot
    gears = robot.transmission
    ratios = dict(zip(gears.joints, map(float, gears.gear_ratio), strict=True))
    return robot, load_logs(session.paths, session.columns, gear_ratios=ratios)


def _measured(
    robot: Robot, logs: tuple[Log, ...]
) -> tuple[dict[Quantity, Estimate], tuple[str, ...]]:
    problem = EstimationProblem.from_logs(robot, logs)
    values = _errors(problem)
    if robot.effects:
        bare = EstimationProblem.from_logs(robot.without_effects(), logs)
        fit = bare.fit(robot.effects)
        bounds = interval_bounds(fit, bare.blocks, bare.distortion(fit), LEVEL)
        for (k, parameter), (low, high) in zip(fit.parameters, bounds, strict=True):
            effect = fit.effects[k]
            values[(effect.name, effect.where, parameter.name)] = Estimate(
                effect.values[parameter.name],
                unit_at(robot, effect.where, parameter.unit),
                float(low),
                float(high),
            )
    return values, problem.warnings


def _errors(problem: EstimationProblem) -> dict[Quantity, Estimate]:
    """Return the rms of every output with its interval, blocks of the logs being samples."""
    units, found = output_units(problem.robot), {}
    for column, name in enumerate(output_names(problem.robot)):
        blocks = problem.block_means(problem.residual[:, column] ** 2)
        mean = float(np.mean(blocks))
        spread = DEVIATIONS * float(np.std(blocks, ddof=1) / np.sqrt(blocks.size))
        low, high = np.sqrt(max(mean - spread, 0.0)), np.sqrt(mean + spread)
        rms = float(np.sqrt(np.mean(problem.residual[:, column] ** 2)))
        found[("", name, "rms error")] = Estimate(rms, units[column], float(low), float(high))
    return found
