"""Whether a model does better than another by more than chance and distortion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.identification.choice.credibility import credible
from wbc.identification.choice.hypothesis import Model
from wbc.identification.model.problem import Problem
from wbc.identification.model.yielding import loose

_LEAST_GAIN = 0.05  # in units of the floor's mean square
_LEAST_SHARE = 0.02  # of the present excess over the floor that a cause must remove
_SYSTEMATIC = 0.01  # share of the first error (rms) that filters and derivatives distort
SYSTEMATIC_SIMULATED = 0.02
"""The same for links simulated behind play or soft gears."""
_SYSTEMATIC_LOOSE = 0.03  # the same for links that bounce: they soon forget how they began


@dataclass(frozen=True, eq=False)
class Judge:
    """Compares models on held-out data.

    Attributes:
        problem: the logs.
    """

    problem: Problem

    def pays(self, small: Model, large: Model, first: Model) -> bool:
        """Whether `large` is better than `small` by more than chance and distortion.

        What filters and derivatives distort is a share of each output's first error; only what
        an output gains beyond that counts.
        """
        if not self.problem.significant(small.squares, large.squares):
            return False
        return self._gained(small.squares - large.squares, small, first)

    def _gained(self, gain: FloatArray, small: Model, first: Model) -> bool:
        """Whether a gain (rows, outputs) over `small` is more than what is distorted."""
        if loose(small.effects):
            share = _SYSTEMATIC_LOOSE
        else:
            share = SYSTEMATIC_SIMULATED if small.swings else _SYSTEMATIC
        distorted = share**2 * np.mean(first.squares, axis=0)
        return bool(np.mean(np.maximum(np.mean(gain, axis=0) - distorted, 0.0)) > _LEAST_GAIN)

    def hopeful(self, model: Model, first: Model) -> bool:
        """Whether explaining all that is left would pay, beside a simulation all but the noise."""
        noise = 1.0 if model.swings else 0.0
        return self._gained(model.squares - noise, model, first)

    def worthwhile(self, small: Model, large: Model, first: Model) -> bool:
        """Whether `large` pays, gains more than fits of noise do, and is an explanation at all."""
        return (
            self.pays(small, large, first)
            and self.problem.beyond_noise(small.squares, large.squares)
            and small.error - large.error > _LEAST_SHARE * max(small.error - 1.0, 0.0)
            and credible(self.problem, large.fit)
        )
