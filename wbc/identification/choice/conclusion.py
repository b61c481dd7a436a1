"""What a search on logs amounts to: causes, what could stand for them, and the verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from wbc.identification.answer.diagnosis import Verdict
from wbc.identification.answer.verdict import judge
from wbc.identification.choice.exchange import settle
from wbc.identification.choice.hypothesis import Model
from wbc.identification.choice.selection import Selector
from wbc.identification.choice.stacks import without_little_terms
from wbc.identification.choice.unexplained import unexplained
from wbc.identification.model.problem import ONLY_NOISE, Problem


@dataclass(frozen=True, eq=False)
class Conclusion:
    """The end of a search.

    Attributes:
        selector: with the logs and every model fitted.
        path: from no cause on.
        final: the model chosen.
        alternatives: for each of its effects, what it cannot be told from.
        series: whether the causes look like terms in which something else was written down.
    """

    selector: Selector
    path: Sequence[Model]
    final: Model
    alternatives: Sequence[tuple[str, ...]]
    series: bool

    @property
    def problem(self) -> Problem:
        """The logs."""
        return self.selector.problem

    @property
    def verdict(self) -> Verdict:
        """The verdict; a series explains nothing."""
        if self.series:
            return "unknown"
        return judge(self.problem, self.path[0].error, self.final, self.alternatives)


def conclude(selector: Selector, path: Sequence[Model], final: Model) -> Conclusion:
    """Return the conclusion after exchanges of causes, where enough is explained to ask for them.

    Args:
        selector: of the search.
        path: from no cause on.
        final: what was found.
    """
    problem, first = selector.problem, path[0]
    if unexplained(problem, first.error, final):
        return Conclusion(selector, path, final, [() for _ in final.effects], False)
    settled, alternatives = settle(selector, final, first)
    if unexplained(problem, first.error, settled):
        return Conclusion(selector, path, settled, alternatives, False)
    main = without_little_terms(selector, settled)
    series = main is not settled
    # Terms beside causes that leave nothing but noise alone were only fitted to the noise.
    if series and main.error < ONLY_NOISE:
        settled, alternatives = settle(selector, main, first)
        series = without_little_terms(selector, settled) is not settled
    return Conclusion(selector, path, settled, alternatives, series)
