"""Everything about a set of logs that does not depend on the candidate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.identification.fit import Fit, refine
from wbc.identification.floor import NoiseFloor, noise_floor
from wbc.identification.folds import bootstrap_blocks, held_out_folds, paired_difference
from wbc.identification.preparation import prepare
from wbc.identification.record import Record
from wbc.identification.residual import condensed_residual
from wbc.measurement import Log
from wbc.robot import Effect, Robot


@dataclass(frozen=True, eq=False)
class Problem:
    """Records of one robot with their noise floor, folds and blocks.

    Attributes:
        robot: the robot that the user believes in.
        records: one per log.
        residual: (rows, outputs) of that robot [N m, N].
        floor: noise floor per output.
        folds: (rows,) held out together.
        blocks: (rows,) resampled together.
    """

    robot: Robot
    records: tuple[Record, ...]
    residual: FloatArray
    floor: NoiseFloor
    folds: IntArray
    blocks: IntArray

    @classmethod
    def from_logs(cls, robot: Robot, logs: Sequence[Log]) -> Problem:
        """Prepare logs; see `prepare` for the errors raised."""
        records = prepare(robot, logs)
        parts = [condensed_residual(robot, [record]) for record in records]
        floor = noise_floor(records, parts)
        return cls(
            robot=robot,
            records=records,
            residual=np.concatenate(parts),
            floor=floor,
            folds=held_out_folds(records, floor.repeats),
            blocks=bootstrap_blocks(records),
        )

    @property
    def whitening(self) -> FloatArray:
        """(outputs, outputs) by which residuals are multiplied."""
        return self.floor.whitening

    def fit(self, effects: Sequence[Effect]) -> Fit:
        """Return the robot with these effects, parameters fitted to all records."""
        return refine(self.robot, effects, self.records, self.whitening)

    def held_out(self, fit: Fit) -> FloatArray:
        """Return (rows, outputs) held-out squares in units of the floor."""
        return fit.held_out(self.folds)

    def distortion(self, fit: Fit) -> FloatArray:
        """Return (p,) how far parameters move, in their scales, in a band half as wide.

        Smoothing distorts sharp events (reversals, impacts) in a way that depends on the band; the
        truth is where the band no longer matters.
        """
        if not fit.parameters:
            return np.zeros(0)
        narrow = tuple(record.narrowed(0.6) for record in self.records)
        other = refine(self.robot, fit.effects, narrow, self.whitening, iterations=2)
        return np.abs(other.values - fit.values)

    def gain(self, worse: FloatArray, better: FloatArray) -> tuple[float, float]:
        """Return the fall of the held-out mean square and its standard error."""
        return paired_difference(worse.mean(axis=1), better.mean(axis=1), self.blocks)
