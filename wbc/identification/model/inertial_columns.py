"""Derivatives by numbers that change the links' inertias: the regressor instead of differences."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.arrays import FloatArray
from wbc.dynamics import inertial_parameters
from wbc.identification.model.kept_columns import IMPOSSIBLE, STEP
from wbc.identification.model.residual import by_link_torque
from wbc.identification.records.record import Record
from wbc.robot import Effect, Parameter, Robot

# Slopes are differences by 1e-7 of the largest load: rounding leaves seven of their digits.
_STEADY, _DIGITS = 1e-6, 6


def only_inertial(robot: Robot, effect: Effect) -> bool:
    """Whether an effect changes the inertias of the links and nothing else."""
    if effect.acts_by != {"change"}:
        return False
    changed = effect.change(robot)
    same_field = np.array_equal(changed.model.gravity.linear, robot.model.gravity.linear)
    return changed.transmission is robot.transmission and same_field


def parameter_changes(
    robot: Robot, effects: Sequence[Effect], varied: Sequence[tuple[int, int, Parameter]]
) -> dict[int, FloatArray]:
    """Return (10 n_links,) the change of the links' parameters per scale of each number.

    Args:
        robot: that lacks the effects.
        effects: as they are.
        varied: (number of the column, number of an effect, its parameter).

    Returns:
        By number of the column, without those that the robot cannot have changed.
    """
    kinds = {type(effects[k]) for _, k, _ in varied}  # no others change the links' inertias
    acting = {k: e for k, e in enumerate(effects) if type(e) in kinds}
    before = inertial_parameters(robot.with_effects(*acting.values()))
    columns = {}
    for row, k, parameter in varied:
        for size in (STEP, -STEP):
            try:
                value = effects[k].values[parameter.name] + size * parameter.scale
                moved = effects[k].with_values({parameter.name: value})
                changed = robot.with_effects(*{**acting, k: moved}.values())
            except IMPOSSIBLE:
                continue
            columns[row] = (inertial_parameters(changed) - before) / size
            break
    return columns


def inertial_columns(
    robot: Robot,
    records: Sequence[Record],
    swinging: Sequence[FloatArray | None],
    changes: FloatArray,
) -> FloatArray:
    """Return (rows, m + b, p) the change of the residual with the links' parameters.

    What the links need is linear in their parameters, Y theta; what a gear that loses a share makes
    of it is differentiated at every sample.

    Args:
        robot: with its effects; none of its links swings with these parameters.
        records: the logs.
        swinging: torque of `swing_of`, of each record.
        changes: (10 n_links, p) of the parameters.
    """
    parts = []
    for record, held in zip(records, swinging, strict=True):
        slope, moved = by_link_torque(robot, record, held)
        outputs = [_at_output(moved, k, slope[:, k], changes) for k in range(slope.shape[1])]
        parts.append(np.stack(outputs, axis=1))
    return np.concatenate(parts)


def _at_output(record: Record, output: int, slope: FloatArray, changes: FloatArray) -> FloatArray:
    """Return the columns (rows, p) at one output, of which `slope` (N, nv) is the derivative.

    Where nothing loses a share of the load the slope is the same at every sample. Then the columns
    are sums of those of the links' parameters, which are kept whatever else the robot has.
    """
    mean = slope.mean(axis=0)
    size = float(np.max(np.abs(mean), initial=0.0))
    if size > 0.0 and np.max(np.abs(slope - mean)) < _STEADY * size:
        direction = np.round(mean / size, _DIGITS) + 0.0
        return np.asarray(record.condensed_regressor(output, direction) @ (size * changes))
    if not np.any(slope):
        return np.zeros((record.rows, changes.shape[1]))
    felt = np.einsum("ni,nip->np", slope, record.regressor)
    return record.condensed_at(felt, output) @ changes
