"""Terms of a library and their normal equations, per block, in the rows that diagnosis uses."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.signal import lombscargle

from wbc.arrays import FloatArray, IntArray
from wbc.effects import CustomTorque, TorqueTerm
from wbc.effects.position_torques import strongest_orders
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.fit import Fit
from wbc.identification.model.residual import raw_residual
from wbc.identification.records.record import Record, rows_of_folds
from wbc.robot import Motion, Robot
from wbc.robot.coordinates import slides

_MOST_BLOCKS = 96  # memory grows with blocks times the square of the library
_LEVEL_SAMPLES = 2000
_NUDGE = 1e-3  # [N m]
_ROUNDING = 1e-6  # share of what an effect does to the output that feels it most
_LOST = 1e-6  # share of a column's square that must be left beside the known effects
_BATCH = 64


@dataclass(frozen=True, eq=False)
class TermTable:
    """Products of columns and residual of one joint, summed per cell (a fold of a block).

    Columns are what a unit of each term changes in the joint's outputs, in floors; what the known
    effects could explain by other parameters has been taken out of them.

    Attributes:
        joint: on which the terms act.
        terms: c candidates.
        gram: (cells, c, c) A' A.
        moment: (cells, c) A' r.
        energy: (cells,) r' r.
        count: (cells,) entries of r.
        folds: (cells,) held out together.
        blocks: (cells,) resampled together.
        levels: (samples, c) level of dry friction that a unit of each term gives; 0 where smooth.
    """

    joint: str
    terms: tuple[TorqueTerm, ...]
    gram: FloatArray
    moment: FloatArray
    energy: FloatArray
    count: FloatArray
    folds: IntArray
    blocks: IntArray
    levels: FloatArray

    def only(self, kept: Sequence[bool]) -> TermTable:
        """Return the table with some of the terms."""
        index = np.flatnonzero(kept)
        return replace(
            self,
            terms=tuple(self.terms[k] for k in index),
            gram=self.gram[:, index[:, None], index],
            moment=self.moment[:, index],
            levels=self.levels[:, index],
        )

    def possible(self, chosen: Sequence[int], coefficients: FloatArray) -> bool:
        """Whether the dry friction of these terms brakes nearly everywhere."""
        level = self.levels[:, list(chosen)] @ coefficients
        driving = float(np.sum(np.maximum(-level, 0.0)))
        return driving <= 0.01 * float(np.sum(np.abs(level)))


def term_table(
    problem: EstimationProblem, fit: Fit, joint: str, terms: Sequence[TorqueTerm]
) -> TermTable:
    """Return the normal equations of `terms` at `joint` against the residual of `fit`.

    Args:
        problem: the logs.
        fit: the robot whose residual is to be explained; its parameters stay free to move.
        joint: a driven joint.
        terms: the library.
    """
    back = np.linalg.pinv(problem.whitening)
    residual, known = fit.residual @ back, np.einsum("rpk,po->rok", fit.jacobian, back)
    size = np.sqrt(np.mean(known**2, axis=0))
    # What another joint feels is left over here by rounding: scaled up it would pass for a cause.
    known[:, size < _ROUNDING * size.max(axis=0, initial=0.0)] = 0.0
    cells, folds, blocks = _cells(problem)
    each = [_columns(fit.robot, record, joint, terms) for record in problem.records]
    added, outputs = np.concatenate([columns for columns, _, _ in each]), each[0][1]
    beside = np.concatenate([-known, residual[:, :, None]], axis=-1)[:, outputs]
    whole = np.concatenate([added, beside], axis=-1) / problem.floor.values[outputs, None]
    parts = [whole[rows].reshape(-1, whole.shape[2]) for rows in rows_of_folds(cells)]
    sums = np.array([own.T @ own for own in parts])
    kept, gram, moment = _beside_known(sums[:, :-1, :-1], sums[:, :-1, -1], len(terms))
    together = np.concatenate([levels for _, _, levels in each])
    every = max(1, len(together) // _LEVEL_SAMPLES)
    return TermTable(
        joint=joint,
        terms=tuple(terms[k] for k in kept),
        gram=gram,
        moment=moment,
        energy=sums[:, -1, -1],
        count=np.array([float(len(own)) for own in parts]),
        folds=folds,
        blocks=blocks,
        levels=together[::every, kept],
    )


def _beside_known(
    gram: FloatArray, moment: FloatArray, size: int
) -> tuple[list[int], FloatArray, FloatArray]:
    """Return which of `size` terms say more than the known effects, their columns behind them.

    With the normal equations (cells, c, c) and (cells, c) after taking out what the known effects
    can explain, of those with it.
    """
    whole = gram.sum(axis=0)
    alone, shared, known = whole[:size, :size], whole[size:, :size], whole[size:, size:]
    scale = np.sqrt(np.maximum(np.diag(known), 1e-300))
    scaled = known / np.outer(scale, scale) + 1e-8 * np.eye(scale.size)
    explained = np.linalg.solve(scaled, shared / scale[:, None]) / scale[:, None]
    before, after = np.diag(alone), np.diag(alone) - np.sum(shared * explained, axis=0)
    kept = np.flatnonzero((before > 0.0) & (after > _LOST * before))
    explained = explained[:, kept]
    mixed = explained.T @ gram[:, size:, kept]
    own = gram[:, kept[:, None], kept] - mixed - np.swapaxes(mixed, 1, 2)
    own = own + explained.T @ gram[:, size:, size:] @ explained
    return kept.tolist(), own, moment[:, kept] - moment[:, size:] @ explained


def _cells(problem: EstimationProblem) -> tuple[IntArray, IntArray, IntArray]:
    """Return the cell of every row, and the fold and block of every cell."""
    merged = problem.blocks // (1 + int(problem.blocks.max()) // _MOST_BLOCKS)
    pairs, cells = np.unique(np.stack([problem.folds, merged], axis=1), axis=0, return_inverse=True)
    return cells.ravel(), pairs[:, 0], pairs[:, 1]


def _columns(
    robot: Robot, record: Record, joint: str, terms: Sequence[TorqueTerm]
) -> tuple[FloatArray, IntArray, FloatArray]:
    """Return columns (rows, outputs, c), which outputs those are, and levels (rows, c)."""
    motion = record.motion_of(robot)
    nudged = robot.with_effect(CustomTorque.at(joint, {"1": _NUDGE}))
    gain = (raw_residual(robot, record) - raw_residual(nudged, record)) / _NUDGE
    outputs = np.flatnonzero(np.abs(gain).max(axis=0) > 1e-9)
    values, levels = _values(robot, motion, joint, terms)
    weight = (gain * record.scale)[:, outputs]
    parts = [
        record.condense_driven(values[:, None, k : k + _BATCH] * weight[:, :, None])
        for k in range(0, len(terms), _BATCH)
    ]
    sure = record.weight[:, outputs].min(axis=1, keepdims=True) > 0.5
    return np.concatenate(parts, axis=-1), outputs, record.thinned(levels * sure)


def _values(
    robot: Robot, motion: Motion, joint: str, terms: Sequence[TorqueTerm]
) -> tuple[FloatArray, FloatArray]:
    """Return the torque and the level of dry friction (N, c) of a unit of each term."""
    sign = np.sign(motion.velocity[:, robot.velocity_index(joint)])
    known = {f: f.value(robot, motion) for f in {f for term in terms for f in term.factors}}
    torque = np.ones((len(motion.velocity), len(terms)))
    level = np.zeros_like(torque)
    for k, term in enumerate(terms):
        direction = term.direction_of(joint)
        for factor in term.factors:
            if factor is not direction:
                torque[:, k] *= known[factor]
        if direction is not None:
            level[:, k] = -torque[:, k]
            torque[:, k] *= sign
    return torque, level


_HARMONICS = 2  # orders read off the data, per kind of torque
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
    waves = {1.0, 2.0} if not slides(robot, joint) else set()
    # Smooth torque and dry friction repeat with position at orders of their own.
    column, row = robot.position_index(joint), robot.velocity_index(joint)
    positions = [motion.position[:, column] for motion in motions]
    speeds = [motion.velocity[:, row] for motion in motions]
    torques = [torque[:, row] for torque in unexplained]
    along = [torque * np.sign(speed) for torque, speed in zip(torques, speeds, strict=True)]
    usual = float(np.sqrt(np.mean(np.concatenate(speeds) ** 2)))
    highest = 2.0 * np.pi * band / max(usual, 1e-9)
    smooth_waves, dry_waves = (
        _waves(q, waves | _peaks(positions, own, highest)) for own in (torques, along)
    )
    gravity = [f"gravity_{joint}"] * _weighs(robot, joint, motions)
    load = [f"load_{joint}"] * (not robot.floating_size)
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
    waves = _waves(x, {1.0, 2.0}) if not slides(robot, other) else []
    smooth = [x, f"{x}^2", f"{q} * {x}", f"{q} * {x}^2", f"{q}^2 * {x}", *waves]
    smooth += [u, f"|{u}|", f"|{u}| * {u}", f"{u}^2", f"{u}^3", f"sign({u})", f"{v} * {u}"]
    smooth += [f"{x} * {v}", f"{q} * {u}", f"{x} * {u}", f"|{x}| * {v}", f"|{u}| * {v}"]
    smooth += [f"sin({q}) * {u}^2", f"sin({x}) * {u}^2"]
    smooth += [f"a_{other}", f"cos({q}) * a_{other}", f"cos({x}) * a_{other}"]
    level = [x, f"|{x}|", f"{x}^2", f"|{u}|", *waves]
    level += [f"|gravity_{other}|"] * _weighs(robot, other, motions)
    if not robot.floating_size:
        smooth.append(f"load_{other}")
        level.append(f"|load_{other}|")
    return smooth, level


def _waves(position: str, orders: Iterable[float]) -> list[str]:
    numbers = ["" if order == 1.0 else f"{order:g} " for order in sorted(orders)]
    return [f"{wave}({number}{position})" for number in numbers for wave in ("sin", "cos")]


def _weighs(robot: Robot, joint: str, motions: Sequence[Motion]) -> bool:
    """Whether gravity asks anything of a joint."""
    term = TorqueTerm.parse(f"gravity_{joint}")
    few = [m.replace(position=m.position[::200], velocity=0.0 * m.velocity[::200]) for m in motions]
    return any(np.ptp(term.value(robot, motion)) > 1e-6 for motion in few)


def _chain(robot: Robot, joint: str) -> list[str]:
    """Return the other driven joints between the base and `joint`, and those that it carries."""
    model, own = robot.model, robot.model.getJointId(joint)
    numbers = {name: model.getJointId(name) for name in robot.transmission.joints if name != joint}
    return [
        name
        for name, other in numbers.items()
        if other in list(model.supports[own]) or own in list(model.supports[other])
    ]


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
