"""All metrics of one contact in one pose, each with its unit and what it assumes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from wbc.arrays import FloatArray
from wbc.errors import DynamicsError
from wbc.metrics.designs import contact_task, upward
from wbc.metrics.force_capability import ForceCapability, force_capability, holding
from wbc.metrics.inertia import (
    backward_generalized_inertia,
    directional_inertia,
    forward_generalized_inertia,
    generalized_inertia,
    impact_mitigation,
)
from wbc.robot import Robot

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
    rows = [
        _row(name, "kg", f"{assumption}; {REST}", partial(find, *where))
        for name, assumption, find in (
            ("GIT", PERFECT, generalized_inertia),
            ("Backward-GIT", BACKWARD, backward_generalized_inertia),
            ("Forward-GIT", FORWARD, forward_generalized_inertia),
        )
    ]
    rows += _directions(robot, q, contact, axes, way, up)
    rows += [
        _row(f"force {way}, {name}", "N", f"{note}; {STATIC}", partial(_along, reach, up, of))
        for name, note, of in (
            ("lossless", PERFECT, "conventional"),
            ("lift", "all gears lift", "lift"),
            ("hold", "all gears hold", "hold"),
        )
    ]
    note = f"{MOVING}; {STATIC}"
    rows.append(_row(f"force polygon, moving {way}", "N", note, partial(reach.moving, up)))
    for name, note, mode in (("conservative", PERFECT, 0.0), ("dissipative", BACKWARD, -1.0)):
        factor, note = impact_mitigation(*where, mode), f"{note}; {IMPACT}"
        rows.append(_row(f"IMF {way}, {name}", "1", note, partial(factor.along, up)))
        determinant = partial(getattr, factor, "determinant")
        rows.append(_row(f"IMF determinant, {name}", "1", note, determinant))
    back = f"motor output; {UNPOWERED}"
    return [
        *rows,
        Metric("holding torque, lossless", "N m", held.lossless, carried, gears),
        Metric("holding torque, least", "N m", held.least, carried, gears),
        Metric("holding heat, lossless", "W", held.heat_lossless, carried),
        Metric("holding heat, least", "W", held.heat_least, carried),
        Metric("heat saved by stiction", "1", held.heat_saved, carried),
        _row(f"backdriving force {way}", "N", UNPOWERED, partial(reach.backdriving, up)),
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


def _row(name: str, unit: str, assumption: str, find: Callable[[], Value]) -> Metric:
    try:
        return Metric(name, unit, find(), assumption)
    except DynamicsError as reason:
        return Metric(name, unit, str(reason), assumption)


def _along(reach: ForceCapability, direction: FloatArray, of: str) -> float:
    return float(getattr(reach.along(direction), of))
