"""Sweeps of the metrics over efficiency, gear ratio and pose: the tables behind a design choice."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike

from wbc.arrays import FloatArray, checked, frozen
from wbc.errors import DynamicsError
from wbc.metrics.design_metrics import design_metrics
from wbc.metrics.designs import Designs
from wbc.robot import Robot


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
    gears = {"forward_efficiency": forward}
    if backward_efficiencies is not None:
        gears["backward_efficiency"] = checked(
            backward_efficiencies, (len(forward),), "backward_efficiencies", DynamicsError
        )
    designs = Designs.of(robot, position, gears)
    return _sweep("forward_efficiency", forward, designs, contact, direction, axes)


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
    designs = Designs.of(robot, position, {"gear_ratio": ratios})
    return _sweep("gear_ratio", ratios, designs, contact, direction, axes)


def pose_sweep(
    robot: Robot, positions: ArrayLike, contact: str, direction: ArrayLike, axes: str = "xyz"
) -> Sweep:
    """Return the metrics in several poses (k, nq).

    Raises:
        DynamicsError: a singular pose among them.
    """
    poses = checked(positions, (None, robot.model.nq), "positions", DynamicsError)
    return _sweep("position", poses, Designs.of(robot, poses), contact, direction, axes)


def _sweep(
    name: str,
    values: FloatArray,
    designs: Designs,
    contact: str,
    direction: ArrayLike,
    axes: str,
) -> Sweep:
    found = design_metrics(designs, contact, direction, axes).columns()
    free = np.flatnonzero(np.isinf(found["conventional"]))
    if free.size and np.isfinite(designs.gears["torque_limit"]).all():
        raise DynamicsError(
            f"a force on '{contact}' along {np.asarray(direction).tolist()} (axes {axes}) loads no "
            f"motor at point {free[0]} of the sweep: leave the singular pose, or choose the axes "
            "that the leg's motors act on."
        )
    kept = {f.name: frozen(found[f.name]) for f in fields(Sweep) if f.name in found}
    return Sweep(name=name, values=frozen(values), **kept)
