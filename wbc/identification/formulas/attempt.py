"""Named effects and formulas fitted together, and which of two such attempts is better."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects import CustomTorque
from wbc.identification.formulas.formula import Formula
from wbc.identification.model.fit import Fit
from wbc.identification.model.problem import Problem
from wbc.robot import Effect

_LEAST_GAIN = 0.05  # of the floor's mean square
_LEAST_SHARE = 0.02  # of an output's excess over the floor


@dataclass(frozen=True, eq=False)
class Attempt:
    """Named effects and formulas with their fit.

    Attributes:
        fit: all of them, refitted together; named effects first.
        squares: (rows, outputs) held-out squares in floors.
        formulas: by joint.
    """

    fit: Fit
    squares: FloatArray
    formulas: Mapping[str, Formula]

    @classmethod
    def of(
        cls, problem: Problem, effects: Sequence[Effect], formulas: Mapping[str, Formula]
    ) -> Attempt:
        """Fit `effects`, which hold the `formulas`, to all records of `problem`."""
        fit = problem.fit(effects)
        return cls(fit, problem.held_out(fit), formulas)

    @property
    def error(self) -> float:
        """Held-out mean square in floors."""
        return float(np.mean(self.squares))

    @property
    def known(self) -> tuple[Effect, ...]:
        """The named effects."""
        return tuple(e for e in self.fit.effects if not isinstance(e, CustomTorque))

    @property
    def freedom(self) -> int:
        """How many numbers had to be chosen."""
        return sum(effect.freedom for effect in self.fit.effects)


def better_somewhere(problem: Problem, worse: Attempt, better: Attempt) -> bool:
    """Whether an output's held-out error falls by more than chance; a bad joint hides no other."""
    for one, other in zip(worse.squares.T, better.squares.T, strict=True):
        least = max(_LEAST_GAIN, _LEAST_SHARE * (float(np.mean(one)) - 1.0))
        pays = float(np.mean(one - other)) > least
        if pays and problem.significant(one[:, None], other[:, None]):
            return True
    return False
