"""What else was tried, beside the answer; which of its parameters move together."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from scipy.stats import sem

from wbc.arrays import FloatArray
from wbc.files import as_json
from wbc.identification.choice.certainty import TIED, Odds
from wbc.identification.choice.evidence import Hypothesis, Key
from wbc.identification.choice.find_causes import RIVALS
from wbc.identification.choice.trials import Trials
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.fit import Fit
from wbc.robot import Effect
from wbc.robot.effect import spoken

_MOST_ODDS = 6.0  # powers of ten: beyond, odds say nothing that a reader could use
Standing = Literal["found", "better", "worse", "not distinguishable"]
_BLOCKS_PER_PARAMETER = 4  # in fewer blocks parameters are correlated by chance


@dataclass(frozen=True, eq=False)
class Ranked:
    """A hypothesis that was tried, beside the one that was found.

    Attributes:
        added: (effect, where) of what it has and the one found has not.
        removed: (effect, where) of what it lacks.
        error: held-out root mean square in noise floors.
        difference: its held-out mean square minus that of the one found [floors^2].
        deviation: standard error of the difference; both on the same blocks of the logs, a block
            being one observation.
        evidence: its evidence minus that of the one found [nats].
        standing: `found` for what was found itself; `better`, `worse`, or `not distinguishable`,
            by the evidence.
        effects: all it has, with the parameters fitted to these logs.
        covariance: (p, p) of these parameters, in their order and units; None for hypotheses that
            no experiment is planned for: only what was found and its closest rivals have it.
    """

    added: tuple[Key, ...]
    removed: tuple[Key, ...]
    error: float
    difference: float
    deviation: float
    evidence: float
    standing: Standing
    effects: tuple[Effect, ...] = ()
    covariance: FloatArray | None = None

    @property
    def text(self) -> str:
        """What the hypothesis is, in words."""
        more, less = (
            " and ".join(f"{spoken(name)} at {where}" for name, where in keys)
            for keys in (self.added, self.removed)
        )
        if more:
            return f"{more} instead of {less}" if less else f"with {more}, too"
        if less:
            return "robot as given" if len(self.removed) > 1 else f"without {less}"
        return "what was found"

    @property
    def judgement(self) -> str:
        """What to think of it, in words: how it fits and how probable it is are not the same."""
        if self.standing == "found":
            return "found" if self.effects else "kept"
        if self.standing != "worse":
            return "more probable" if self.standing == "better" else "as good"
        # By chance a difference is beyond two standard errors in one of twenty.
        if abs(self.difference) > 2.0 * self.deviation:
            return "fits worse" if self.difference > 0.0 else "fits better, but less probable"
        return "fits as well, but less probable" if self.removed else "no gain beyond chance"

    @property
    def beyond(self) -> tuple[float, float]:
        """Its error minus that of the one found, and the standard error [noise floors]."""
        both = max(self.error + np.sqrt(max(self.error**2 - self.difference, 0.0)), 1e-300)
        return self.difference / both, self.deviation / both

    @property
    def odds(self) -> str:
        """How probable it is beside what was found, such as 1 to 20; empty for that itself."""
        if self.standing == "found":
            return ""
        power = min(abs(self.evidence) / np.log(10.0), _MOST_ODDS)
        ratio = f"{10.0**power:.2g}" if power < 2.0 else f"{10.0 ** round(power):,.0f}"
        more = "beyond " if power >= _MOST_ODDS else ""
        return more + (f"1 : {ratio}" if self.evidence <= 0.0 else f"{ratio} : 1")

    def to_json(self) -> dict[str, Any]:
        """Return plain texts and numbers."""
        told = dict(as_json(self)) | {"effects": [effect_entry(e) for e in self.effects]}
        for name in ("added", "removed"):
            told[name] = [{"effect": effect, "where": at} for effect, at in getattr(self, name)]
        return told


def effect_entry(effect: Effect) -> dict[str, Any]:
    """Return an effect as JSON has it."""
    return {"effect": effect.name, "where": effect.where, "parameters": effect.values}


def rank_hypotheses(trials: Trials, odds: Odds, found: Hypothesis) -> tuple[Ranked, ...]:
    """Return the hypotheses that differ from `found` in one cause, most evidence first.

    One cause is an effect less, an effect more, or one in the place of another, at one place or in
    all gears; the robot as given is always among them. What the logs leave open of the parameters
    is told of `found` and of its closest rivals. Those whose links swing behind their gears are
    left out: no experiment is planned for them, and to fit them anew takes long. So are all rivals
    where somebody waits.

    Args:
        trials: which hold the fits, or make them again.
        odds: of everything that was tried.
        found: the hypothesis chosen.
    """
    own, level = set(found.keys), odds.level(found)
    rows, left = [], 0 if trials.hurried else RIVALS
    for h, nats in zip(odds.hypotheses, odds.evidence, strict=True):
        keys = set(h.keys)
        less, more = own - keys, {name for name, _ in keys - own}
        if keys and (len(less) > 1 or len(more) > 1):
            continue
        row, rival = _beside(h, found, nats - level), bool(less and more)
        if keys and not h.swings and (row.standing == "found" or (rival and left > 0)):
            left -= rival
            fit = trials.fit(h, found)
            scales = [parameter.scale for _, parameter in fit.parameters]
            deviations = trials.problem.deviations(fit) * scales
            row = replace(row, covariance=deviations.T @ deviations)
        rows.append(row)
    return tuple(rows)


def _beside(h: Hypothesis, found: Hypothesis, evidence: float) -> Ranked:
    standing: Standing = "not distinguishable"
    if set(h.keys) == set(found.keys):
        standing = "found"
    elif abs(evidence) > TIED:
        standing = "better" if evidence > 0.0 else "worse"
    return Ranked(
        added=tuple(key for key in h.keys if key not in found.keys),
        removed=tuple(key for key in found.keys if key not in h.keys),
        error=float(np.sqrt(h.error)),
        difference=h.error - found.error,
        deviation=float(sem(h.blocks - found.blocks)),
        evidence=evidence,
        standing=standing,
        effects=h.effects,
    )


@dataclass(frozen=True, eq=False)
class Correlation:
    """Correlations of the parameters found, over blocks of the logs.

    Attributes:
        parameters: (effect, where, name) of each.
        matrix: (p, p), ones on the diagonal; zero beside a parameter that no block moves. Empty
            where there are too few blocks to tell.
    """

    parameters: tuple[tuple[str, str, str], ...]
    matrix: FloatArray


def correlation_of(problem: EstimationProblem, fit: Fit) -> Correlation:
    """Return how the parameters of a fit move together."""
    names = tuple((*fit.effects[k].key, parameter.name) for k, parameter in fit.parameters)
    count = len(names)
    if count < 2 or np.unique(problem.blocks).size < _BLOCKS_PER_PARAMETER * count:
        return Correlation(names, np.zeros((0, 0)))
    deviations = problem.deviations(fit)
    size = np.linalg.norm(deviations, axis=0)
    own = deviations / np.where(size > 0.0, size, np.inf)
    matrix = own.T @ own
    np.fill_diagonal(matrix, 1.0)
    return Correlation(names, matrix)
