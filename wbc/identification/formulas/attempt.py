"""Named effects and formulas fitted together, and which of two such attempts is better."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from wbc.effects import CustomTorque
from wbc.identification.choice.weighing.evidence import log_densities
from wbc.identification.choice.weighing.hypothesis import Hypothesis
from wbc.identification.choice.weighing.trials import hypothesis_of
from wbc.identification.formulas.formula import Formula
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.fit import Fit
from wbc.robot import Effect


@dataclass(frozen=True, eq=False)
class Attempt:
    """Named effects and formulas with their fit.

    Attributes:
        fit: all of them, refitted together; named effects first.
        hypothesis: what it leaves on held-out data.
        formulas: by joint.
    """

    fit: Fit
    hypothesis: Hypothesis
    formulas: Mapping[str, Formula]

    @classmethod
    def of(
        cls, problem: EstimationProblem, effects: Sequence[Effect], formulas: Mapping[str, Formula]
    ) -> Attempt:
        """Fit `effects`, which hold the `formulas`, to all records of `problem`."""
        fit = problem.fit(effects)
        return cls(fit, hypothesis_of(problem, fit), formulas)

    @property
    def error(self) -> float:
        """Held-out mean square in floors."""
        return self.hypothesis.error

    @property
    def known(self) -> tuple[Effect, ...]:
        """The named effects."""
        return tuple(e for e in self.fit.effects if not isinstance(e, CustomTorque))

    @property
    def freedom(self) -> int:
        """How many numbers had to be chosen."""
        return sum(effect.search.freedom(effect) for effect in self.fit.effects)


def better_somewhere(problem: EstimationProblem, worse: Attempt, better: Attempt) -> bool:
    """Whether the evidence at one output outweighs what more is asked to be believed.

    A bad joint hides no other.
    """
    one, other = log_densities(problem, [worse.hypothesis, better.hypothesis])
    asked = worse.hypothesis.prior - better.hypothesis.prior
    return bool(np.max(other - one) > asked)
