"""The library of products among which a formula for a joint's torque is searched."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects import TorqueTerm
from wbc.effects.drive.periodicity import strongest_orders
from wbc.robot import Motion, Robot

_HARMONICS = 2  # orders read off the data, per kind of torque
_TRIALS = 33  # orders tried around each peak of the spectrum
_DISTINCT = 0.2  # orders closer than this share of each other are the same


def torque_terms(
    robot: Robot,
    joint: str,
    motions: Sequence[Motion],
    unexplained: Sequence[FloatArray],
    band: float,
) -> tuple[TorqueTerm, ...]:
    """Return the products that may make up the unexplained torque of `joint`.

    Other joints are those of the same kinematic chain: what couples two joints (a cable, a shared
    bearing, inertia) runs along it.

    Args:
        robot: the robot as believed.
        joint: a driven joint.
        motions: one per log.
        unexplained: (N, nv) per log [N m].
        band: of the residual [Hz]; waves that pass faster are not seen.
    """
    q, v = f"q_{joint}", f"v_{joint}"
    sign = f"sign({v})"
    waves = {1.0, 2.0} if _turns(robot, joint) else set()
    smooth_orders, dry_orders = _orders(robot, joint, motions, unexplained, band)
    smooth_waves = _waves(q, waves | smooth_orders)
    dry_waves = _waves(q, waves | dry_orders)
    gravity = [f"gravity_{joint}"] if _weighs(robot, joint, motions) else []
    load = [] if robot.floating_size else [f"load_{joint}"]
    texts = ["1", q, f"{q}^2", f"{q}^3", *smooth_waves]
    texts += [v, f"|{v}|", f"|{v}| * {v}", f"{v}^2", f"{v}^3", f"a_{joint}"]
    texts += [f"{x} * {v}" for x in (q, f"|{q}|", f"{q}^2", *_waves(q, waves), *gravity)]
    texts += [f"|{x}| * {v}" for x in load]
    texts += [f"{x} * |{v}|" for x in (q, *load)]
    dry = ["", q, f"|{q}|", f"{q}^2", f"|{q}| * {q}", *dry_waves]
    dry += [shape for x in (*gravity, *load) for shape in (f"|{x}|", f"{x}", f"{x}^2")]
    for other in _chain(robot, joint):
        smooth, level = _across(robot, joint, other, motions)
        texts += smooth
        dry += level
    texts += [f"{level} * {sign}" if level else sign for level in dry]
    return tuple(TorqueTerm.parse(text) for text in dict.fromkeys(texts))


def _across(
    robot: Robot, joint: str, other: str, motions: Sequence[Motion]
) -> tuple[list[str], list[str]]:
    """Return smooth products with the motion of another joint, and levels of dry friction."""
    q, v, x, u = f"q_{joint}", f"v_{joint}", f"q_{other}", f"v_{other}"
    waves = _waves(x, {1.0, 2.0}) if _turns(robot, other) else []
    smooth = [x, f"{x}^2", f"{q} * {x}", f"{q} * {x}^2", f"{q}^2 * {x}", *waves]
    smooth += [u, f"|{u}|", f"|{u}| * {u}", f"{u}^2", f"{u}^3", f"sign({u})", f"{v} * {u}"]
    smooth += [f"{x} * {v}", f"{q} * {u}", f"{x} * {u}", f"|{x}| * {v}", f"|{u}| * {v}"]
    smooth += [f"sin({q}) * {u}^2", f"sin({x}) * {u}^2"]
    smooth += [f"a_{other}", f"cos({q}) * a_{other}", f"cos({x}) * a_{other}"]
    level = [x, f"|{x}|", f"{x}^2", f"|{u}|", *waves]
    if _weighs(robot, other, motions):
        level.append(f"|gravity_{other}|")
    if not robot.floating_size:
        smooth.append(f"load_{other}")
        level.append(f"|load_{other}|")
    return smooth, level


def _waves(position: str, orders: Iterable[float]) -> list[str]:
    numbers = ["" if order == 1.0 else f"{order:g} " for order in sorted(orders)]
    return [f"{wave}({number}{position})" for number in numbers for wave in ("sin", "cos")]


def _turns(robot: Robot, joint: str) -> bool:
    number = robot.model.getJointId(joint)
    return not robot.model.joints[number].shortname().startswith("JointModelP")


def _weighs(robot: Robot, joint: str, motions: Sequence[Motion]) -> bool:
    """Whether gravity asks anything of a joint."""
    term = TorqueTerm.parse(f"gravity_{joint}")
    few = [motion.replace(position=motion.position[::200]) for motion in motions]
    few = [
        motion.replace(velocity=np.zeros((len(motion.position), robot.model.nv))) for motion in few
    ]
    return any(np.ptp(term.value(robot, motion)) > 1e-6 for motion in few)


def _chain(robot: Robot, joint: str) -> list[str]:
    """Return the other driven joints between the base and `joint`, and those that it carries."""
    model = robot.model
    own = model.getJointId(joint)

    def related(other: int) -> bool:
        return other in list(model.supports[own]) or own in list(model.supports[other])

    return [
        name
        for name in robot.transmission.joints
        if name != joint and related(model.getJointId(name))
    ]


def _orders(
    robot: Robot,
    joint: str,
    motions: Sequence[Motion],
    unexplained: Sequence[FloatArray],
    band: float,
) -> tuple[set[float], set[float]]:
    """Return the orders at which smooth torque and dry friction repeat with position."""
    column, row = robot.position_index(joint), robot.velocity_index(joint)
    positions = [motion.position[:, column] for motion in motions]
    torques = [torque[:, row] for torque in unexplained]
    along = [
        torque * np.sign(motion.velocity[:, row])
        for torque, motion in zip(torques, motions, strict=True)
    ]
    speeds = np.concatenate([motion.velocity[:, row] for motion in motions])
    highest = 2.0 * np.pi * band / max(float(np.sqrt(np.mean(speeds**2))), 1e-9)
    return _peaks(positions, torques, highest), _peaks(positions, along, highest)


def _peaks(
    positions: Sequence[FloatArray], torques: Sequence[FloatArray], highest: float
) -> set[float]:
    """Return the strongest orders up to `highest`, read closely."""
    found: list[float] = []
    span = max(float(np.ptp(np.concatenate(list(positions)))), 1e-9)
    place, torque = np.concatenate(list(positions)), np.concatenate(list(torques))
    for peak in strongest_orders(positions, torques, 4 * _HARMONICS):
        if peak > highest:
            continue
        # A peak is placed within an eighth of its width 2 pi / span; look closer, twice.
        sharp, reach = peak, 0.3 * 2.0 * np.pi / span
        for _ in range(2):
            trials = sharp + np.linspace(-reach, reach, _TRIALS)
            sharp = max(trials[trials > 0.0], key=lambda k: _power(place, torque, k))
            reach *= 2.0 / _TRIALS
        sharp = float(f"{sharp:.4g}")
        if all(abs(sharp - other) > _DISTINCT * max(sharp, other) for other in (*found, 1.0, 2.0)):
            found.append(sharp)
    return set(found[:_HARMONICS])


def _power(position: FloatArray, torque: FloatArray, order: float) -> float:
    """Return how much of a torque one wave explains."""
    wave = np.stack([np.sin(order * position), np.cos(order * position), np.ones_like(position)])
    return float((wave @ torque) @ np.linalg.lstsq(wave @ wave.T, wave @ torque, rcond=None)[0])
