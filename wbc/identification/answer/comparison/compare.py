"""How far a robot's model is from its logs, and where."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.identification.answer.comparison.breakdown import breakdowns
from wbc.identification.answer.comparison.comparison import Comparison, OutputError
from wbc.identification.answer.series import Series, series_of
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.records.outputs import output_names, output_units
from wbc.identification.records.record import Record
from wbc.identification.records.torque_sensors import without_links
from wbc.measurement import Log, LogSource
from wbc.robot import Robot


def compare(robot: Robot, logs: Sequence[Log]) -> Comparison:
    """Return how far `robot` is from `logs`, and where.

    Raises:
        IdentificationError: logs that cannot be compared with this robot, or too short ones.
        LogError: a channel is missing.
    """
    problem = EstimationProblem.from_logs(robot, logs)
    return compare_problem(problem, tuple(log.source for log in logs))


def compare_problem(problem: EstimationProblem, sources: tuple[LogSource, ...] = ()) -> Comparison:
    """Return the comparison of the robot and logs of a prepared problem.

    Args:
        problem: the robot and the logs.
        sources: where the logs came from.
    """
    records = problem.records
    ends = np.cumsum([record.rows for record in records])
    residuals = np.split(problem.residual, ends[:-1])
    whitened = problem.residual @ problem.whitening
    accelerations = [_acceleration_error(r, e) for r, e in zip(records, residuals, strict=True)]
    series = series_of(problem.robot, records)
    outputs = _outputs(problem, residuals, accelerations, series)
    shown = {output.output for output in outputs}
    return Comparison(
        robot=problem.robot,
        outputs=outputs,
        error=float(np.sqrt(np.mean(whitened**2))),
        floor=problem.floor,
        where=tuple(b for b in breakdowns(records, residuals) if b.output in shown),
        series=series,
        warnings=problem.warnings,
        sources=sources,
    )


def _outputs(
    problem: EstimationProblem,
    residuals: Sequence[FloatArray],
    accelerations: Sequence[FloatArray],
    series: Sequence[Series],
) -> tuple[OutputError, ...]:
    gears = problem.robot.transmission
    record = problem.records[0]
    step = record.stride / record.rate
    measured = np.concatenate([s.measured for s in series])
    units, found = output_units(problem.robot), []
    unknown = without_links(problem.robot)
    for column, name in enumerate(output_names(problem.robot)):
        if column in unknown:
            continue
        driven = column < gears.size
        rms = _rms([r[:, column] for r in residuals])
        found.append(
            OutputError(
                output=name,
                unit=units[column],
                rms=rms,
                rotor_rms=rms / abs(float(gears.gear_ratio[column])) if driven else np.nan,
                floor=float(problem.floor.values[column]),
                size=_rms([measured[:, column]]) if driven else np.nan,
                acceleration=_rms([a[:, column] for a in accelerations]),
                correlation_time=_correlation_time([r[:, column] for r in residuals], step),
                frequency=_peak([r[:, column] for r in residuals], step),
            )
        )
    return tuple(found)


def _rms(parts: Sequence[FloatArray]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))


def _acceleration_error(record: Record, residual: FloatArray) -> FloatArray:
    """Return (rows, m + b) the acceleration that the unexplained torque would cause.

    One step of forward dynamics is linear in torque: a_model - a = -M^-1 r, with the rotors'
    inertia behind their gears and the measured contact forces.
    """
    robot = record.robot
    gears = robot.transmission
    order = np.concatenate([robot.actuated, robot.unactuated])
    lift = np.linalg.inv(gears.topology)
    rotors = lift.T @ np.diag(gears.reflected_inertia) @ lift
    model = record.model_of(robot)
    data = model.createData()
    errors = np.empty_like(residual)
    m = gears.size
    for row, q in enumerate(record.thinned(record.motion.position)):
        mass = pin.crba(model, data, q)
        mass = np.triu(mass) + np.triu(mass, 1).T
        mass[np.ix_(robot.actuated, robot.actuated)] += rotors
        force = np.concatenate([lift.T @ residual[row, :m], residual[row, m : order.size]])
        errors[row, : order.size] = np.linalg.solve(mass[np.ix_(order, order)], force)
    errors[:, order.size :] = errors[:, robot.sensed]
    return errors


def _correlation_time(parts: Sequence[FloatArray], step: float) -> float:
    longest = min(len(part) for part in parts) // 2
    total = np.zeros(longest)
    for part in parts:
        power = np.abs(np.fft.rfft(part, 2 * len(part))) ** 2
        total += np.fft.irfft(power)[:longest]
    if total[0] <= 0.0:
        return 0.0
    below = np.flatnonzero(total / total[0] < np.exp(-1.0))
    return float(below[0] * step) if below.size else float(longest * step)


def _peak(parts: Sequence[FloatArray], step: float) -> float:
    longest = max(parts, key=len)
    power = np.abs(np.fft.rfft(longest - longest.mean())) ** 2
    return float(np.fft.rfftfreq(len(longest), step)[int(np.argmax(power))])
