"""What was found beside what was tried, and its numbers beside one another.

Of hypotheses: evidence, and paired differences on held-out data. Of numbers: correlations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from wbc.arrays import FloatArray
from wbc.files import as_json
from wbc.identification.choice.certainty import TIED, Odds
from wbc.identification.choice.evidence import Hypothesis, Key
from wbc.identification.choice.trials import Trials
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.fit import Fit
from wbc.identification.model.intervals import bootstrap_steps, parameter_covariance
from wbc.robot import Effect
from wbc.robot.effect import spoken

_MOST_ODDS = 6.0  # powers of ten: beyond, odds say nothing that a reader could use
RIVALS = 3
"""Rivals of what was found whose covariance is kept: as many as an experiment is planned for."""
Standing = Literal["found", "better", "worse", "not distinguishable"]
_BLOCKS_PER_PARAMETER = 4  # fewer resampled blocks are correlated by chance


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
        if not self.added and not self.removed:
            return "what was found"
        if not self.added:
            return "robot as given" if len(self.removed) > 1 else f"without {_spoken(self.removed)}"
        if not self.removed:
            return f"with {_spoken(self.added)}, too"
        return f"{_spoken(self.added)} instead of {_spoken(self.removed)}"

    @property
    def judgement(self) -> str:
        """What to think of it, in words: how it fits and how probable it is are not the same."""
        if self.standing == "found":
            return "found" if self.effects else "kept"
        if self.standing == "not distinguishable":
            return "as good"
        if self.standing == "better":
            return "more probable"
        # By chance a difference is beyond two standard errors in one of twenty.
        if self.difference < -2.0 * self.deviation:
            return "fits better, but less probable"
        if self.difference > 2.0 * self.deviation:
            return "fits worse"
        return "fits as well, but less probable" if self.removed else "no gain beyond chance"

    @property
    def beyond(self) -> tuple[float, float]:
        """Its error minus that of the one found, and the standard error [noise floors]."""
        both = self.error + np.sqrt(max(self.error**2 - self.difference, 0.0))
        return self.difference / max(both, 1e-300), self.deviation / max(both, 1e-300)

    @property
    def odds(self) -> str:
        """How probable it is beside what was found, such as 1 to 20; empty for that itself."""
        if self.standing == "found":
            return ""
        ratio = 10.0 ** min(abs(self.evidence) / np.log(10.0), _MOST_ODDS)
        whole = 10.0 ** round(float(np.log10(ratio)))
        shown = f"{ratio:.2g}" if ratio < 100.0 else f"{whole:,.0f}"
        more = "beyond " if ratio >= 10.0**_MOST_ODDS else ""
        return more + (f"1 : {shown}" if self.evidence <= 0.0 else f"{shown} : 1")

    def to_json(self) -> dict[str, Any]:
        """Return plain texts and numbers."""
        lists = {"added": self.added, "removed": self.removed}
        keys = {k: [{"effect": n, "where": at} for n, at in own] for k, own in lists.items()}
        return dict(as_json(self)) | keys | {"effects": [effect_entry(e) for e in self.effects]}


def effect_entry(effect: Effect) -> dict[str, Any]:
    """Return an effect as JSON has it."""
    return {"effect": effect.name, "where": effect.where, "parameters": effect.values}


def rank_hypotheses(odds: Odds, found: Hypothesis) -> tuple[Ranked, ...]:
    """Return the hypotheses that differ from `found` in one cause, most evidence first.

    One cause is an effect less, an effect more, or one in the place of another, at one place or in
    all gears; the robot as given is always among them.

    Args:
        odds: of everything that was tried.
        found: the hypothesis chosen.
    """
    own = set(found.keys)
    level = odds.level(found)
    rows = []
    for h, nats in zip(odds.hypotheses, odds.evidence, strict=True):
        keys = set(h.keys)
        less, more = own - keys, {name for name, _ in keys - own}
        if (len(less) <= 1 and len(more) <= 1) or not keys:
            rows.append(_beside(h, found, nats - level))
    return tuple(rows)


def with_covariances(ranking: Sequence[Ranked], trials: Trials) -> tuple[Ranked, ...]:
    """Return the ranking with what the logs leave open of the parameters of the closest rivals.

    Those whose links swing behind their gears are left out: no experiment is planned for them, and
    to fit them anew takes long. So are all rivals where somebody waits.

    Args:
        ranking: of the hypotheses tried.
        trials: which hold their fits, or make them again.
    """
    known = {h.effects: h for h in trials.known}
    rows, left = [], 0 if trials.hurried else RIVALS
    for row in ranking:
        h = known.get(row.effects)
        rival = bool(row.added and row.removed)
        wanted = bool(row.effects) and (row.standing == "found" or (rival and left > 0))
        if not wanted or h is None or h.swings:
            rows.append(row)
            continue
        left -= rival
        covariance = parameter_covariance(trials.fit(h), trials.problem.blocks)
        rows.append(replace(row, covariance=covariance))
    return tuple(rows)


def _beside(h: Hypothesis, found: Hypothesis, evidence: float) -> Ranked:
    blocks = h.blocks - found.blocks
    own = set(found.keys)
    standing: Standing = "not distinguishable"
    if set(h.keys) == own:
        standing = "found"
    elif abs(evidence) > TIED:
        standing = "better" if evidence > 0.0 else "worse"
    return Ranked(
        added=tuple(key for key in h.keys if key not in own),
        removed=tuple(key for key in found.keys if key not in h.keys),
        error=float(np.sqrt(h.error)),
        difference=h.error - found.error,
        deviation=float(np.std(blocks, ddof=1) / np.sqrt(blocks.size)),
        evidence=evidence,
        standing=standing,
        effects=h.effects,
    )


def _spoken(keys: tuple[Key, ...]) -> str:
    return " and ".join(f"{spoken(name)} at {where}" for name, where in keys)


@dataclass(frozen=True, eq=False)
class Correlation:
    """Correlations of the parameters found, over refits on blocks drawn from the logs.

    Attributes:
        names: (effect, where, parameter) of each.
        matrix: (p, p), ones on the diagonal; zero beside a parameter that no refit moves. Empty
            where there are too few blocks to tell.
    """

    names: tuple[tuple[str, str, str], ...]
    matrix: FloatArray


def correlation_of(problem: EstimationProblem, fit: Fit) -> Correlation:
    """Return how the parameters of a fit move together."""
    names = tuple((*fit.effects[k].key, parameter.name) for k, parameter in fit.parameters)
    count = len(names)
    if count < 2 or np.unique(problem.blocks).size < _BLOCKS_PER_PARAMETER * count:
        return Correlation(names, np.zeros((0, 0)))
    steps = bootstrap_steps(fit, problem.blocks)
    moving = np.std(steps, axis=0) > 0.0
    matrix = np.eye(count)
    matrix[np.ix_(moving, moving)] = np.atleast_2d(np.corrcoef(steps[:, moving].T))
    return Correlation(names, matrix)
