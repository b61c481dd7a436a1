"""All metrics of one contact: in one pose, each with what it assumes; of many designs as arrays."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from wbc.arrays import FloatArray
from wbc.errors import DynamicsError
from wbc.metrics.designs import ContactTask, Designs, contact_task, designs_task, ratio, upward
from wbc.metrics.force_capability import force_capability, forces_along, holding, holding_of
from wbc.metrics.inertia import (
    backward_generalized_inertia,
    directional_inertia,
    forward_generalized_inertia,
    generalized_inertia,
    impact_mitigation,
)
from wbc.robot import Robot
from wbc.transmission import Direction

REST = "from rest, gravity left out"
PERFECT = "eta = 1 both ways"
BACKWARD = "every gear driven by its joint; motors without torque"
FORWARD = "every gear driven by its motor; wrong where one is not"
EXACT = "set-valued mesh law: each gear drives, is driven or sticks"
STATIC = "at rest, weight of the links left out, motors at their limits"
MOVING = "force on the surroundings, about to move so: gears lift with it, hold against it"
IMPACT = "frictionless impact, motors without torque, links rigid"
HELD = "at rest under the load alone, the least torque that holds"
UNPOWERED = "motors off; only the rotors' dry friction resists"
_LOCKED = 1e-12  # the share of the conservative mobility below which there is none

Value = float | FloatArray | str


@dataclass(frozen=True, eq=False)
class Metric:
    """One metric.

    Attributes:
        name: what it is.
        unit: "1" for a ratio.
        value: a number, an array, or the reason why it does not exist here.
        assumption: what the number needs to be true.
        joints: whose gear each entry of a vector belongs to; empty for all else.
    """

    name: str
    unit: str
    value: Value
    assumption: str
    joints: tuple[str, ...] = ()


def summary(
    robot: Robot, position: ArrayLike, contact: str, axes: str = "xz", load: float | None = None
) -> list[Metric]:
    """Return every metric of a contact, those that do not exist with the reason.

    Args:
        robot: fixed or floating base, gears serial or parallel.
        position: q (nq,).
        contact: name of the contact point.
        axes: world axes; metrics of one direction go along z, the last axis where z is missing.
        load: force [N] to hold along that direction; the robot's weight when left out.

    Raises:
        DynamicsError: axes that do not exist, a position of wrong shape or not finite.
        RobotError: no such contact.
    """
    q = contact_task(robot, position, contact, axes).designs.position[0]
    up = upward(axes)
    main = axes[int(np.argmax(up))]
    way = "up" if main == "z" else f"along {main}"
    size, where = robot.weight if load is None else load, (robot, q, contact, axes)
    reach, held = force_capability(*where), holding(robot, q, contact, up, size, axes)
    gears, carried = robot.transmission.joints, f"rotor side, load {size:.4g} N {way}; {HELD}"

    def force(of: str) -> float:
        return float(getattr(reach.along(up), of))

    rows = [
        _row("GIT", "kg", f"{PERFECT}; {REST}", generalized_inertia, *where),
        _row("Backward-GIT", "kg", f"{BACKWARD}; {REST}", backward_generalized_inertia, *where),
        _row("Forward-GIT", "kg", f"{FORWARD}; {REST}", forward_generalized_inertia, *where),
        *_directions(robot, q, contact, axes, way, up),
        _row(f"force {way}, lossless", "N", f"{PERFECT}; {STATIC}", force, "conventional"),
        _row(f"force {way}, lift", "N", f"all gears lift; {STATIC}", force, "lift"),
        _row(f"force {way}, hold", "N", f"all gears hold; {STATIC}", force, "hold"),
        _row(f"force polygon, moving {way}", "N", f"{MOVING}; {STATIC}", reach.moving, up),
    ]
    for name, note, mode in (("conservative", PERFECT, 0.0), ("dissipative", BACKWARD, -1.0)):
        factor, note = impact_mitigation(*where, mode), f"{note}; {IMPACT}"
        rows.append(_row(f"IMF {way}, {name}", "1", note, factor.along, up))
        rows.append(_row(f"IMF determinant, {name}", "1", note, getattr, factor, "determinant"))
    back = f"motor output; {UNPOWERED}"
    return [
        *rows,
        Metric("holding torque, lossless", "N m", held.lossless, carried, gears),
        Metric("holding torque, least", "N m", held.least, carried, gears),
        Metric("holding heat, lossless", "W", held.heat_lossless, carried),
        Metric("holding heat, least", "W", held.heat_least, carried),
        Metric("heat saved by stiction", "1", held.heat_saved, carried),
        _row(f"backdriving force {way}", "N", UNPOWERED, force, "backdriving_force"),
        Metric("backdriving torque", "N m", reach.backdriving_torque, back, gears),
    ]


def _directions(
    robot: Robot, q: FloatArray, contact: str, axes: str, way: str, up: FloatArray
) -> list[Metric]:
    name, share = f"effective mass {way}", "directions driven forward by all"
    try:
        one = directional_inertia(robot, q, contact, axes, up[None])
        shown = directional_inertia(robot, q, contact, axes, 3600).share_forward
    except DynamicsError as reason:
        return [Metric(name, "kg", str(reason), EXACT)]
    return [
        Metric(f"{name}, lossless", "kg", float(one.lossless[0]), f"{PERFECT}; {REST}"),
        Metric(f"{name}, pushed", "kg", float(one.pushed[0]), f"{BACKWARD}; {REST}"),
        Metric(f"{name}, driven", "kg", float(one.driven[0]), f"{EXACT}; {REST}"),
        Metric(share, "1", shown, f"share of the directions of force; {EXACT}; {REST}"),
    ]


def _row(name: str, unit: str, assumption: str, find: Callable[..., Value], *given: Any) -> Metric:
    """Return the metric that `find` returns of what is given, or why there is none."""
    try:
        return Metric(name, unit, find(*given), assumption)
    except DynamicsError as reason:
        return Metric(name, unit, str(reason), assumption)


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
    robot = designs.robot
    lossless, least, *_, saved = holding_of(task, n, robot.weight if load is None else load)
    found = {
        **_inertias(task, n),
        **forces_along(task, n),
        "holding_torque": np.linalg.norm(least, axis=1),
        "holding_torque_lossless": np.linalg.norm(lossless, axis=1),
        "heat_saved": saved,
    }
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
