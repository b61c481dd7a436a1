"""Sweeps of the metrics over efficiency, gear ratio and pose: the tables behind a design choice."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from wbc.arrays import FloatArray, checked, frozen
from wbc.errors import DynamicsError
from wbc.metrics.contact_task import ContactTask, contact_task
from wbc.metrics.force_capability import ForceRange, force_capability
from wbc.metrics.inertia import impact_mitigation
from wbc.robot import Robot
from wbc.transmission import Direction, wedge_backward_efficiency

_LOCKED = 1e-12  # share of the conservative mobility below which there is none


@dataclass(frozen=True, eq=False)
class Sweep:
    """The metrics along one direction at k points of a sweep.

    Attributes:
        name: what was varied.
        values: (k,) or (k, nq), what it was set to.
        conventional: (k,) [N], force with perfect gears.
        lift: (k,) [N], force the motors can raise.
        hold: (k,) [N], force they can resist.
        inertia: (k,) [kg], apparent inertia 1/(n' Lambda^-1 n) with perfect gears.
        backward_inertia: (k,) [kg], the same, every gear driven by its joint; infinite where
            every way to give is locked.
        impact_mitigation: (k,), 0 to 1; NaN where every way to give is locked, for want of a
            motion to compare with that of blocked gears.
    """

    name: str
    values: FloatArray
    conventional: FloatArray
    lift: FloatArray
    hold: FloatArray
    inertia: FloatArray
    backward_inertia: FloatArray
    impact_mitigation: FloatArray

    @property
    def lift_ratio(self) -> FloatArray:
        """Lift over conventional force, (k,)."""
        return self.lift / self.conventional

    @property
    def hold_ratio(self) -> FloatArray:
        """Hold over conventional force, (k,)."""
        return self.hold / self.conventional


def efficiency_sweep(
    robot: Robot,
    position: ArrayLike,
    contact: str,
    direction: ArrayLike,
    forward_efficiencies: ArrayLike,
    backward_efficiencies: ArrayLike | None = None,
    axes: str = "xyz",
) -> Sweep:
    """Return the metrics with every gear set to the same efficiencies.

    Args:
        robot: the robot whose efficiencies are replaced.
        position: q (nq,).
        contact: name of the contact point.
        direction: (n,) along `axes`.
        forward_efficiencies: eta_f (k,).
        backward_efficiencies: eta_b (k,); the wedge's 2 - 1/eta_f when left out.
        axes: world axes, for example "xz".

    Raises:
        TransmissionError: an efficiency outside its range.
        DynamicsError: a singular pose, arrays of different length.
    """
    forward = checked(forward_efficiencies, (None,), "forward_efficiencies", DynamicsError)
    given = (
        wedge_backward_efficiency(forward)
        if backward_efficiencies is None
        else backward_efficiencies
    )
    backward = checked(given, (len(forward),), "backward_efficiencies", DynamicsError)
    one = np.ones(robot.transmission.size)
    robots = [
        robot.with_transmission(
            robot.transmission.replace(forward_efficiency=f * one, backward_efficiency=b * one)
        )
        for f, b in zip(forward, backward, strict=True)
    ]
    tasks = [contact_task(variant, position, contact, axes) for variant in robots]
    return _sweep("forward_efficiency", forward, tasks, direction)


def gear_ratio_sweep(
    robot: Robot,
    position: ArrayLike,
    contact: str,
    direction: ArrayLike,
    gear_ratios: ArrayLike,
    axes: str = "xyz",
) -> Sweep:
    """Return the metrics with every gear set to the same ratio, rotors and motors unchanged.

    The reflected inertia grows with N^2, the torque at the motor output with N.

    Args:
        robot: the robot whose ratios are replaced.
        position: q (nq,).
        contact: name of the contact point.
        direction: (n,) along `axes`.
        gear_ratios: N (k,), none zero.
        axes: world axes, for example "xz".

    Raises:
        TransmissionError: a ratio of zero.
        DynamicsError: a singular pose.
    """
    ratios = checked(gear_ratios, (None,), "gear_ratios", DynamicsError)
    one = np.ones(robot.transmission.size)
    robots = [
        robot.with_transmission(robot.transmission.replace(gear_ratio=ratio * one))
        for ratio in ratios
    ]
    tasks = [contact_task(variant, position, contact, axes) for variant in robots]
    return _sweep("gear_ratio", ratios, tasks, direction)


def pose_sweep(
    robot: Robot, positions: ArrayLike, contact: str, direction: ArrayLike, axes: str = "xyz"
) -> Sweep:
    """Return the metrics in several poses (k, nq).

    Raises:
        DynamicsError: a singular pose among them.
    """
    poses = checked(positions, (None, robot.model.nq), "positions", DynamicsError)
    tasks = [contact_task(robot, pose, contact, axes) for pose in poses]
    return _sweep("position", poses, tasks, direction)


def _sweep(
    name: str, values: FloatArray, tasks: Sequence[ContactTask], direction: ArrayLike
) -> Sweep:
    forces: list[ForceRange] = []
    rows = np.zeros((len(tasks), 3))
    for row, task in zip(rows, tasks, strict=True):
        robot, pose = task.robot, task.terms.position
        forces.append(force_capability(robot, pose, task.contact, task.axes).along(direction))
        n = task.direction(direction)
        free, driven = (
            n @ task.mobility(mode) @ n for mode in (Direction.STUCK, Direction.BACKWARD)
        )
        locked = driven <= _LOCKED * free
        row[0] = 1.0 / free if free > 0.0 else np.inf
        row[1] = np.inf if locked else 1.0 / driven
        row[2] = np.nan
        if not locked or free <= 0.0:
            row[2] = impact_mitigation(robot, pose, task.contact, task.axes).along(direction)
    return Sweep(
        name=name,
        values=frozen(values),
        conventional=frozen([force.conventional for force in forces]),
        lift=frozen([force.lift for force in forces]),
        hold=frozen([force.hold for force in forces]),
        inertia=frozen(rows[:, 0]),
        backward_inertia=frozen(rows[:, 1]),
        impact_mitigation=frozen(rows[:, 2]),
    )
