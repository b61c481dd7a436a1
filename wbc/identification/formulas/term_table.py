"""Normal equations of every term of a library, per block, in the rows that diagnosis uses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.effects import CustomTorque, TorqueTerm
from wbc.identification.choice.screening.design_matrix import DesignMatrix
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.fit import Fit
from wbc.identification.model.residual import raw_residual
from wbc.identification.records.record import Record
from wbc.robot import Motion, Robot

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
    totals = _Totals(len(folds), len(terms) + known.shape[-1])
    levels, first = [], 0
    for record in problem.records:
        rows = slice(first, first + record.rows)
        first += record.rows
        columns, outputs, level = _columns(fit.robot, record, joint, terms)
        floor = problem.floor.values[outputs]
        beside = np.concatenate([columns, -known[rows][:, outputs]], axis=-1)
        totals.add(beside / floor[:, None], residual[rows][:, outputs] / floor, cells[rows])
        levels.append(level)
    together = np.concatenate(levels)
    every = max(1, len(together) // _LEVEL_SAMPLES)
    return totals.table(joint, terms, folds, blocks, together[::every])


def _cells(problem: EstimationProblem) -> tuple[IntArray, IntArray, IntArray]:
    """Return the cell of every row, and the fold and block of every cell."""
    merged = problem.blocks // (1 + int(problem.blocks.max()) // _MOST_BLOCKS)
    pairs, cells = np.unique(np.stack([problem.folds, merged], axis=1), axis=0, return_inverse=True)
    return cells.ravel(), pairs[:, 0], pairs[:, 1]


def _columns(
    robot: Robot, record: Record, joint: str, terms: Sequence[TorqueTerm]
) -> tuple[FloatArray, IntArray, FloatArray]:
    """Return columns (rows, outputs, c), which outputs those are, and levels (rows, c)."""
    motion = record.motion
    for effect in reversed(robot.effects):
        motion = effect.true(robot, motion)
    nudged = robot.with_effect(CustomTorque.at(joint, {"1": _NUDGE}))
    gain = (raw_residual(robot, record) - raw_residual(nudged, record)) / _NUDGE
    outputs = np.flatnonzero(np.abs(gain).max(axis=0) > 1e-9)
    values, levels = _values(robot, motion, joint, terms)
    weight = (gain * record.scale)[:, outputs]
    parts = [
        np.stack(
            [
                record.condense_driven(values[:, k : k + _BATCH] * weight[:, [o]])
                for o in range(outputs.size)
            ],
            axis=1,
        )
        for k in range(0, len(terms), _BATCH)
    ]
    sure = record.weight[:, outputs].min(axis=1, keepdims=True) > 0.5
    return np.concatenate(parts, axis=-1), outputs, record.thinned(levels * sure)


def _values(
    robot: Robot, motion: Motion, joint: str, terms: Sequence[TorqueTerm]
) -> tuple[FloatArray, FloatArray]:
    """Return the torque and the level of dry friction (N, c) of a unit of each term."""
    sign = np.sign(motion.velocity[:, robot.velocity_index(joint)])
    known = {
        factor: factor.value(robot, motion)
        for factor in dict.fromkeys(f for term in terms for f in term.factors)
    }
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


class _Totals:
    """Sums of products per cell."""

    def __init__(self, cells: int, columns: int) -> None:
        self.gram = np.zeros((cells, columns, columns))
        self.moment = np.zeros((cells, columns))
        self.energy = np.zeros(cells)
        self.count = np.zeros(cells)

    def add(self, columns: FloatArray, residual: FloatArray, cells: IntArray) -> None:
        """Add rows (rows, outputs, ...) that belong to `cells` (rows,)."""
        part = DesignMatrix.from_rows(columns, residual, cells)
        here = np.unique(cells)
        self.gram[here] += part.gram
        self.moment[here] += part.moment
        self.energy[here] += part.energy
        self.count[here] += part.count

    def table(
        self,
        joint: str,
        terms: Sequence[TorqueTerm],
        folds: IntArray,
        blocks: IntArray,
        levels: FloatArray,
    ) -> TermTable:
        """Return the table after taking out what the columns of known effects can explain."""
        size = len(terms)
        whole = self.gram.sum(axis=0)
        own, shared, known = whole[:size, :size], whole[size:, :size], whole[size:, size:]
        scale = np.sqrt(np.maximum(np.diag(known), 1e-300))
        scaled = known / np.outer(scale, scale) + 1e-8 * np.eye(scale.size)
        explained = np.linalg.solve(scaled, shared / scale[:, None]) / scale[:, None]
        before, after = np.diag(own), np.diag(own) - np.sum(shared * explained, axis=0)
        kept = np.flatnonzero((before > 0.0) & (after > _LOST * before))
        explained = explained[:, kept]
        mixed = explained.T @ self.gram[:, size:, kept]
        gram = self.gram[:, kept[:, None], kept] - mixed - np.swapaxes(mixed, 1, 2)
        return TermTable(
            joint=joint,
            terms=tuple(terms[int(k)] for k in kept),
            gram=gram + explained.T @ self.gram[:, size:, size:] @ explained,
            moment=self.moment[:, kept] - self.moment[:, size:] @ explained,
            energy=self.energy,
            count=self.count,
            folds=folds,
            blocks=blocks,
            levels=levels[:, kept],
        )
