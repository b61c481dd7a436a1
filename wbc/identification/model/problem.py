"""Everything about a set of logs that does not depend on the candidate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.identification.arguments import require_robot_and_logs
from wbc.identification.log_warnings import moving_bases
from wbc.identification.model.fit import Fit, refine
from wbc.identification.model.friction_sides import FrictionSides
from wbc.identification.model.kept_columns import KeptColumns
from wbc.identification.model.residual import condensed_residual
from wbc.identification.records.folds import block_means, bootstrap_blocks, held_out_folds
from wbc.identification.records.noise_floor import (
    NoiseFloor,
    drawn_noise,
    noise_floor,
    with_even_noise,
)
from wbc.identification.records.preparation import REVERSAL, prepare
from wbc.identification.records.record import Record
from wbc.identification.silent_drives import reported_torque, silent_drives
from wbc.measurement import Log, cut_at_gaps, suspicions
from wbc.robot import Effect, Robot

_STANDARD_ERRORS = 2.0
_LIKELIHOOD_RATIO = 12.0
ONLY_NOISE = 1.3  # mean square in floors up to which a residual is taken for noise
_NEARLY_NOISE = 2.0  # ... and up to which it may be, where ...
_MOST = 4.0  # ... a cause has made it so many times smaller
_SAMPLES_PER_BLOCK = 4.0  # independent ones: a block lasts four periods of the band or longer
_CHI_SQUARE = 25.0
_CHI_SQUARE_LEANING = 6.6


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
        warnings: about the logs.
    """

    robot: Robot
    records: tuple[Record, ...]
    residual: FloatArray
    floor: NoiseFloor
    folds: IntArray
    blocks: IntArray
    warnings: tuple[str, ...] = ()

    @classmethod
    def from_logs(cls, robot: Robot, logs: Sequence[Log], reversal: float = REVERSAL) -> Problem:
        """Prepare logs, cut where samples are missing; see `prepare` for arguments and errors."""
        require_robot_and_logs(robot, logs)
        pieces, warnings = cut_at_gaps(logs)
        warnings += [*moving_bases(robot, logs), *suspicions(robot, pieces)]
        prepared = prepare(robot, pieces, reversal)
        records, drawn = with_even_noise(prepared, drawn_noise(prepared))
        parts = [condensed_residual(robot, [record]) for record in records]
        floor = noise_floor(records, parts, drawn)
        silent = silent_drives(records, parts, floor.values)
        aside = tuple(robot.transmission.joints.index(joint) for joint in silent)
        floor = replace(floor, aside=aside)
        return cls(
            robot=robot,
            records=records,
            residual=np.concatenate(parts),
            floor=floor,
            folds=held_out_folds(records, floor.repeats),
            blocks=bootstrap_blocks(records),
            warnings=tuple(warnings),
        )

    @property
    def torque_in_floors(self) -> float:
        """Root mean square over the judged joints of the reported torque in noise floors."""
        size = self.robot.transmission.size
        kept = [k for k in range(size) if k not in self.floor.aside]
        torque = np.concatenate([reported_torque(record) for record in self.records])[:, kept]
        return float(np.sqrt(np.mean((torque / self.floor.values[kept]) ** 2)))

    @property
    def silent(self) -> tuple[str, ...]:
        """The joints whose drives report nothing that could be compared."""
        return tuple(self.robot.transmission.joints[k] for k in self.floor.aside)

    @property
    def whitening(self) -> FloatArray:
        """(outputs, judged outputs) by which residuals are multiplied."""
        return self.floor.whitening

    @cached_property
    def _columns(self) -> KeptColumns:
        return KeptColumns(self.robot, self.records)

    @cached_property
    def _sides(self) -> FrictionSides:
        return FrictionSides(self.robot, self.records[0].motion)

    def fit(self, effects: Sequence[Effect]) -> Fit:
        """Return the robot with these effects, parameters fitted to all records."""

        def fit(sided: Sequence[Effect], steps: int) -> Fit:
            logs, floor = self.records, self.whitening
            return refine(self.robot, sided, logs, floor, steps, kept=self._columns)

        return self._sides.best(effects, fit)

    def held_out(self, fit: Fit) -> FloatArray:
        """Return (rows, outputs) held-out squares in units of the floor."""
        return fit.held_out(self.folds)

    def distortion(self, fit: Fit) -> FloatArray:
        """Return (p,) by how much parameters are off, in their scales, beside what noise does.

        Smoothing distorts sharp events (reversals, impacts) in a way that depends on the band; the
        truth is where the band no longer matters. Some effects are themselves rough models.
        """
        if not fit.parameters:
            return np.zeros(0)
        narrow = tuple(record.narrowed(0.6) for record in self.records)
        other = refine(self.robot, fit.effects, narrow, self.whitening, iterations=2)
        doubt = np.array([parameter.doubt for _, parameter in fit.parameters])
        return np.asarray(np.hypot(other.values - fit.values, doubt * fit.values))

    def significant(self, worse: FloatArray, better: FloatArray) -> bool:
        """Whether the held-out error falls by more than chance, blocks being the observations.

        Four ways to show it: the paired difference of squares or of their logarithms exceeds two
        standard errors (the first hears the few blocks in which most happens, the second gives
        each block a voice), or, for what happens rarely but violently, the likelihood ratio
        of as many independent observations as there are blocks; and, where nothing but noise is
        left, or little more of very much, its known size (a short log has few blocks, but many
        samples).
        """
        one, other = self._blockwise(worse), self._blockwise(better)
        before, after = float(np.mean(one)), float(np.mean(other))
        ratio = one.size * float(np.log(before / after))
        noise = after < ONLY_NOISE or (after < _NEARLY_NOISE and before > _MOST * after)
        known = noise and self._known_gain(worse, better) > _CHI_SQUARE * max(after, 1.0)
        return bool(
            known
            or _standard_errors(one - other) > _STANDARD_ERRORS
            or _standard_errors(np.log(one / other)) > _STANDARD_ERRORS
            or ratio > _LIKELIHOOD_RATIO
        )

    def leaning(self, worse: FloatArray, better: FloatArray) -> bool:
        """Whether `better` leaves less, by more than chance does once in a hundred times."""
        if np.mean(better) < ONLY_NOISE:
            return self._known_gain(worse, better) > _CHI_SQUARE_LEANING
        one, other = self._blockwise(worse), self._blockwise(better)
        return _standard_errors(np.log(one / other)) > 1.0

    def beyond_noise(self, worse: FloatArray, better: FloatArray) -> bool:
        """Whether `worse` leaves more than noise, or `better` gains more than fits of noise do.

        Among many candidates one always fits some noise significantly.
        """
        return bool(np.mean(worse) >= ONLY_NOISE or self._known_gain(worse, better) > _CHI_SQUARE)

    def _blockwise(self, squares: FloatArray) -> FloatArray:
        return block_means(squares.mean(axis=1), self.blocks)

    def _known_gain(self, worse: FloatArray, better: FloatArray) -> float:
        """Return by how much chi-square falls, all outputs together."""
        samples = _SAMPLES_PER_BLOCK * np.unique(self.blocks).size
        return float(samples * np.sum(np.mean(worse - better, axis=0)))


def _standard_errors(differences: FloatArray) -> float:
    """Return the mean of paired differences in units of its standard error."""
    error = float(np.std(differences, ddof=1)) / np.sqrt(differences.size)
    return float(np.mean(differences) / max(error, 1e-300))
