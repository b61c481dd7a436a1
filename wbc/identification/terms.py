"""The products of quantities of the motion that may make up a torque that nobody has named."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.signal import lombscargle

from wbc.arrays import FloatArray
from wbc.effects import TorqueTerm
from wbc.effects.position_torques import strongest_orders
from wbc.robot import Evidence, Robot
from wbc.robot.coordinates import slides

_HARMONICS = 2  # orders read off the data, per kind of torque
_DISTINCT = 0.2  # orders closer than this share of each other are the same


def torque_terms(robot: Robot, joint: str, seen: Evidence, band: float) -> tuple[TorqueTerm, ...]:
    """Return the products that may make up the unexplained torque of `joint`.

    Other joints are those of the same kinematic chain: what couples two joints (a cable, a shared
    bearing, inertia) runs along it.

    Args:
        robot: the robot as believed.
        joint: a driven joint.
        seen: motions and unexplained torques of the logs.
        band: of the residual [Hz]; waves that pass faster are not seen.
    """
    q, v = f"q_{joint}", f"v_{joint}"
    sign = f"sign({v})"
    waves = {1.0, 2.0} if not slides(robot, joint) else set()
    # Smooth torque and dry friction repeat with position at orders of their own.
    column, row = robot.position_index(joint), robot.velocity_index(joint)
    positions = [motion.position[:, column] for motion in seen.motions]
    speeds = [motion.velocity[:, row] for motion in seen.motions]
    torques = [torque[:, row] for torque in seen.unexplained]
    along = [torque * np.sign(speed) for torque, speed in zip(torques, speeds, strict=True)]
    usual = float(np.sqrt(np.mean(np.concatenate(speeds) ** 2)))
    highest = 2.0 * np.pi * band / max(usual, 1e-9)
    orders = (waves | _peaks(positions, own, highest) for own in (torques, along))
    smooth_waves, dry_waves = (_waves(q, own) for own in orders)
    gravity = [f"gravity_{joint}"] * _weighs(robot, joint, seen)
    load = [f"load_{joint}"] * (not robot.floating_size)
    texts = ["1", q, f"{q}^2", f"{q}^3", *smooth_waves]
    texts += [v, f"|{v}|", f"|{v}| * {v}", f"{v}^2", f"{v}^3", f"a_{joint}"]
    texts += [f"{x} * {v}" for x in (q, f"|{q}|", f"{q}^2", *_waves(q, waves), *gravity)]
    texts += [f"|{x}| * {v}" for x in load]
    texts += [f"{x} * |{v}|" for x in (q, *load)]
    dry = ["", q, f"|{q}|", f"{q}^2", f"|{q}| * {q}", *dry_waves]
    dry += [shape for x in (*gravity, *load) for shape in (f"|{x}|", f"{x}", f"{x}^2")]
    for other in _chain(robot, joint):
        smooth, level = _across(robot, joint, other, seen)
        texts += smooth
        dry += level
    texts += [f"{level} * {sign}" if level else sign for level in dry]
    return tuple(TorqueTerm.parse(text) for text in dict.fromkeys(texts))


def _across(robot: Robot, joint: str, other: str, seen: Evidence) -> tuple[list[str], list[str]]:
    """Return smooth products with the motion of another joint, and levels of dry friction."""
    q, v, x, u = f"q_{joint}", f"v_{joint}", f"q_{other}", f"v_{other}"
    waves = _waves(x, {1.0, 2.0}) if not slides(robot, other) else []
    smooth = [x, f"{x}^2", f"{q} * {x}", f"{q} * {x}^2", f"{q}^2 * {x}", *waves]
    smooth += [u, f"|{u}|", f"|{u}| * {u}", f"{u}^2", f"{u}^3", f"sign({u})", f"{v} * {u}"]
    smooth += [f"{x} * {v}", f"{q} * {u}", f"{x} * {u}", f"|{x}| * {v}", f"|{u}| * {v}"]
    smooth += [f"sin({q}) * {u}^2", f"sin({x}) * {u}^2"]
    smooth += [f"a_{other}", f"cos({q}) * a_{other}", f"cos({x}) * a_{other}"]
    level = [x, f"|{x}|", f"{x}^2", f"|{u}|", *waves]
    level += [f"|gravity_{other}|"] * _weighs(robot, other, seen)
    if not robot.floating_size:
        smooth.append(f"load_{other}")
        level.append(f"|load_{other}|")
    return smooth, level


def _waves(position: str, orders: Iterable[float]) -> list[str]:
    numbers = ["" if order == 1.0 else f"{order:g} " for order in sorted(orders)]
    return [f"{wave}({number}{position})" for number in numbers for wave in ("sin", "cos")]


def _weighs(robot: Robot, joint: str, seen: Evidence) -> bool:
    """Whether gravity asks anything of a joint."""
    term = TorqueTerm.parse(f"gravity_{joint}")
    few = [m.replace(position=m.position[::200], velocity=m.velocity[::200]) for m in seen.motions]
    return any(np.ptp(term.value(robot, motion)) > 1e-6 for motion in few)


def _chain(robot: Robot, joint: str) -> list[str]:
    """Return the other driven joints between the base and `joint`, and those that it carries."""
    model, own = robot.model, robot.model.getJointId(joint)
    chain = {*model.supports[own], *model.subtrees[own]} - {own}
    return [name for name in robot.transmission.joints if model.getJointId(name) in chain]


def _peaks(
    positions: Sequence[FloatArray], torques: Sequence[FloatArray], highest: float
) -> set[float]:
    """Return the strongest orders up to `highest`, read closely."""
    found: list[float] = []
    place, torque = np.concatenate(list(positions)), np.concatenate(list(torques))
    span = max(float(np.ptp(place)), 1e-9)
    for peak in strongest_orders(positions, torques, 4 * _HARMONICS):
        if peak > highest:
            continue
        # A peak is placed within an eighth of its width 2 pi / span; look closer.
        ends = max(peak - 0.6 * np.pi / span, 1e-3 * peak), peak + 0.6 * np.pi / span
        closer = minimize_scalar(
            lambda k: -lombscargle(place, torque, [k], floating_mean=True).item(), bounds=ends
        )
        sharp = float(f"{closer.x:.4g}")
        if all(abs(sharp - other) > _DISTINCT * max(sharp, other) for other in (*found, 1.0, 2.0)):
            found.append(sharp)
    return set(found[:_HARMONICS])
