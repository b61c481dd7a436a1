"""Inertia, force capability, impact mitigation and holding of many designs at once.

One robot is one design: the metrics of this package share the arrays of `ContactTask` and the laws
of `force_capability`, with the designs as the leading axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from wbc.arrays import FloatArray
from wbc.metrics.designs import ContactTask, Designs, designs_task, ratio
from wbc.metrics.force_capability import forces_along, holding_torques, joule_heats
from wbc.transmission import Direction

_LOCKED = 1e-12  # the share of the conservative mobility below which there is none


@dataclass(frozen=True, eq=False)
class DesignMetrics:
    """The metrics of k designs along one direction at one contact, each (k,).

    Infinite means that nothing limits the number; NaN that it does not exist for the design.

    Attributes:
        inertia: 1/(n' Lambda^-1 n) [kg] with perfect gears.
        backward_inertia: the same, every gear driven by its joint [kg].
        forward_inertia: the same, every gear driven by its motor [kg]; NaN on a floating base.
        conventional: force [N] with perfect gears at the motors' limits.
        lift: force [N] that the motors can raise.
        hold: force [N] that they can resist.
        backdriving_force: force [N] that sets the unpowered robot in motion.
        impact_mitigation: 0 to 1, losses counted; NaN where the point cannot give way.
        impact_mitigation_lossless: the same with perfect gears.
        impact_mitigation_determinant: det of the factor's matrix over all axes, losses counted.
        holding_torque: root of the sum of squares [N m] of the least rotor torques that hold
            `load` along the direction.
        holding_torque_lossless: the same with perfect gears.
        heat_saved: share, 0 to 1, of the Joule heat of holding that stiction saves.
    """

    inertia: FloatArray
    backward_inertia: FloatArray
    forward_inertia: FloatArray
    conventional: FloatArray
    lift: FloatArray
    hold: FloatArray
    backdriving_force: FloatArray
    impact_mitigation: FloatArray
    impact_mitigation_lossless: FloatArray
    impact_mitigation_determinant: FloatArray
    holding_torque: FloatArray
    holding_torque_lossless: FloatArray
    heat_saved: FloatArray


def design_metrics(
    designs: Designs,
    contact: str,
    direction: ArrayLike,
    axes: str = "xyz",
    load: float | None = None,
) -> DesignMetrics:
    """Return the metrics of every design at one contact point.

    Args:
        designs: k designs of one robot.
        contact: name of the contact point.
        direction: (n,) along `axes`.
        axes: world axes, each at most once, for example "xz".
        load: force [N] to hold along the direction; the robot's weight when left out.

    Raises:
        DynamicsError: axes that do not exist, a direction of zero.
        RobotError: no such contact.
    """
    task = designs_task(designs, contact, axes)
    n = task.direction(direction)
    found = {**_inertias(task, n), **_forces(task, n, load)}
    return DesignMetrics(**{name: np.broadcast_to(x, designs.size) for name, x in found.items()})


def _inertias(task: ContactTask, n: FloatArray) -> dict[str, FloatArray]:
    def along(matrix: FloatArray) -> FloatArray:
        return np.asarray(n @ matrix @ n)

    free, driven = task.mobility(Direction.STUCK), task.mobility(Direction.BACKWARD)
    blocked, least = task.blocked(), _LOCKED * along(free)
    forward = np.full(1, np.nan)
    if not task.designs.robot.floating_size:
        forward = ratio(1.0, along(task.forward_mobility()), 0.0, np.inf)
    regular = np.linalg.det(driven) > _LOCKED * np.abs(np.linalg.det(free))
    safe = np.where(regular[:, None, None], driven, np.eye(len(n)))
    factor = np.linalg.det(np.eye(len(n)) - np.linalg.solve(safe, blocked))
    return {
        "inertia": ratio(1.0, along(free), 0.0, np.inf),
        "backward_inertia": ratio(1.0, along(driven), least, np.inf),
        "forward_inertia": forward,
        "impact_mitigation": 1.0 - ratio(along(blocked), along(driven), least, np.nan),
        "impact_mitigation_lossless": 1.0 - ratio(along(blocked), along(free), 0.0, np.nan),
        "impact_mitigation_determinant": np.where(regular, factor, np.nan),
    }


def _forces(task: ContactTask, n: FloatArray, load: float | None) -> dict[str, FloatArray]:
    robot = task.designs.robot
    output = task.torque_from_force @ n * (robot.weight if load is None else load)
    perfect, least = holding_torques(task.designs.gears, output)
    return {
        **forces_along(task, n),
        "holding_torque": np.sqrt(np.sum(least**2, axis=1)),
        "holding_torque_lossless": np.sqrt(np.sum(perfect**2, axis=1)),
        "heat_saved": joule_heats(robot, perfect, least)[2],
    }
