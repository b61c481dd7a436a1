"""Derivatives by numbers that change the links' inertias: the regressor instead of differences."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.arrays import FloatArray
from wbc.dynamics import inertial_parameters
from wbc.identification.model.residual import by_link_torque
from wbc.identification.records.record import Record
from wbc.robot import Effect, Robot


def only_inertial(robot: Robot, effect: Effect) -> bool:
    """Whether an effect changes the inertias of the links and nothing else."""
    if effect.acts_by != {"change"}:
        return False
    changed = effect.change(robot)
    same_field = np.array_equal(changed.model.gravity.linear, robot.model.gravity.linear)
    return changed.transmission is robot.transmission and same_field


def parameter_changes(
    robot: Robot, effects: Sequence[Effect], varied: Sequence[tuple[int, Effect, float]]
) -> FloatArray:
    """Return (10 n_links, p) the change of the links' parameters per unit of each variation.

    Args:
        robot: that lacks the effects.
        effects: as they are.
        varied: (number of an effect, the effect as varied, size of the variation).
    """
    # What changes no link keeps out of the way.
    acting = {k: e for k, e in enumerate(effects) if "change" in e.acts_by}
    before = inertial_parameters(robot.with_effects(*acting.values()))
    columns = []
    for k, moved, size in varied:
        changed = robot.with_effects(*{**acting, k: moved}.values())
        columns.append((inertial_parameters(changed) - before) / size)
    return np.stack(columns, axis=-1)


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
        swinging: what `swinging_torque` returned for each record.
        changes: (10 n_links, p) of the parameters.
    """
    parts = []
    for record, held in zip(records, swinging, strict=True):
        slope, regressor = by_link_torque(robot, record, held)
        parts.append(record.condense(np.einsum("noi,nip->nop", slope, regressor @ changes)))
    return np.concatenate(parts)
