"""Which causes may be missing beside a hypothesis: screened linearly, not yet fitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from wbc.identification.choice.candidate_columns import Regressor
from wbc.identification.choice.drop_screen import exchanged, until_null
from wbc.identification.choice.evidence import Hypothesis, Key, weigh, without
from wbc.identification.choice.linear_screen import (
    LinearScreen,
    Subset,
    screen,
    screen_in_shares,
)
from wbc.identification.choice.trials import HOPELESS, Trials
from wbc.identification.model.columns import drawn
from wbc.identification.model.sparse_columns import ADDS
from wbc.identification.model.yielding import deflects
from wbc.robot import Effect

Offer = tuple[Effect, ...]
"""Effects with start values, not yet fitted."""

Screened = tuple[Offer, list[Regressor]]
"""An offer with the causes that are new in it."""

_LINEAR_HOOKS = ADDS | {"change"}  # by which causes act linearly
# Evidence [nats] that an exchange may lack by derivatives and still be fitted. Of 72 that lacked
# more (a quadruped, 22 generated logs) all were 41 behind or more once fitted, where derivatives
# know least: a Stribeck speed between those of the screen. Of 24 that lacked 20 to 250, some won.
_BEYOND_FITS = 250.0
# Times what derivatives say of the density that a cause gains or loses, up to which they may be
# wrong: of 172 drops on a recorded arm the true loss was 0.58 to 1.37 times the one they say.
MISSED = 3.0
_KEPT = 2  # screens: of the present hypothesis, and of one without a cause
_AMONG = 100  # pairs of causes that are screened on held-out data


@dataclass(eq=False)
class Proposer:
    """Proposes causes beside hypotheses.

    Attributes:
        trials: fitted so far, with the logs.
        candidates: effect classes that may be used, all of what acts at once.
    """

    trials: Trials
    candidates: tuple[type[Effect], ...]
    _screens: dict[tuple[tuple[type[Effect], ...], Offer], LinearScreen] = field(
        default_factory=dict
    )

    def beside(self, h: Hypothesis, count: int) -> list[Offer]:
        """Return the most promising causes beside those of a hypothesis, best first.

        Those alone of which derivatives do not say that they explain far less than they cost, or
        that the best of them explains far more.

        Args:
            h: the hypothesis.
            count: how many offers at most.
        """
        offers = self._beside(h, count)
        chosen = [
            (density, prior, added, offer)
            for offer, added in [*offers, *self._drawings(h, offers)]
            for density, prior in [self._gain(h, (), offer, added)]
            if MISSED * density > -prior
        ]
        sure = [d + p for d, p, _, _ in chosen if np.isfinite(d)]
        best = max(sure, default=0.0)
        return [o for d, p, added, o in chosen if d + p > best - _reach(added)]

    def _beside(self, h: Hypothesis, count: int, exclude: Sequence[Key] = ()) -> list[Screened]:
        if not self.candidates:
            return []
        return self._chosen(h, self._without(h, exclude), count)

    def _drawings(self, h: Hypothesis, beside: Sequence[Screened]) -> list[Screened]:
        """Return the best of every effect that is drawn to what is usual, if it is not offered.

        A wrong drawing is imitated by many that explain a part each: it is tried beside them all.
        """
        if h.swings or not self.candidates:
            return []
        search = self._without(h)
        seen = {tuple(regressor.key for regressor in added) for _, added in beside}
        each = [(s, search.regressors[s.regressors[0]]) for s in _drawn(search)]
        fresh = [(subset, drawn) for subset, drawn in each if (drawn.key,) not in seen]
        return [((*h.effects, *search.effects(subset)), [drawn]) for subset, drawn in fresh]

    def _without(self, h: Hypothesis, exclude: Sequence[Key] = ()) -> LinearScreen:
        """Return the screen beside a hypothesis without what it holds, and other keys."""
        whole = self._around(h)
        return whole.instead_of((), np.zeros(0), whole.robot, {*h.keys, *exclude})

    def instead(
        self, h: Hypothesis, own: Effect, count: int, *, hopeless: bool = False
    ) -> list[tuple[float, Offer]]:
        """Return the most promising causes in the place of one of a hypothesis.

        With each offer by how much derivatives say that it raises the evidence [nats]. All places
        of one hypothesis are screened by the same columns: a screen of its own for each would cost
        as much as everything else together. What is left without the cause its derivatives say; a
        cause that does not act linearly is left out of a fit first.

        Args:
            h: the hypothesis.
            own: its cause that gives way.
            count: how many offers at most.
            hopeless: whether those count that cannot win by derivatives.
        """
        if not own.acts_by <= _LINEAR_HOOKS or drawn(own) or deflects(own):
            return self._beside_rest(h, own, count, hopeless=hopeless)
        if not self.candidates:
            return []
        robot, fewer = self.trials.problem.robot, without(h.effects, own)
        gone, steps = until_null(self.trials.fit(h), (own,), robot)
        rest = robot.with_effects(*fewer)
        moved = self._around(h).instead_of(gone, steps, rest, set(h.keys))
        chosen = self._chosen(replace(h, effects=fewer), moved, count)
        found = [(sum(self._gain(h, (own,), *one)), one) for one in chosen]
        return [(g, offer) for g, (offer, added) in found if hopeless or g > -_reach(added)]

    def _beside_rest(
        self, h: Hypothesis, own: Effect, count: int, *, hopeless: bool
    ) -> list[tuple[float, Offer]]:
        """Return the same as `instead`, screened beside the hypothesis fitted without the cause."""
        rest = self.trials.of(without(h.effects, own))
        if rest is None:
            return []
        left, right = weigh(self.trials.problem, [rest, h])
        likely = [
            (sum(self._gain(rest, (), offer, added)) + float(left - right), offer)
            for offer, added in self._beside(rest, count, (own.key,))
        ]
        return [(gain, offer) for gain, offer in likely if hopeless or gain > -_BEYOND_FITS]

    def _gain(
        self, h: Hypothesis, own: Sequence[Effect], offer: Offer, added: Sequence[Regressor]
    ) -> tuple[float, float]:
        """Return what derivatives say that an exchange gains of the density and the prior [nats].

        Infinite for what is drawn to what is usual, of which they say little.

        Args:
            h: a hypothesis.
            own: its causes that give way.
            offer: what it then holds.
            added: the new ones.
        """
        if any(regressor.usual.any() for regressor in added):
            return np.inf, 0.0
        trials, columns = self.trials, [regressor.columns for regressor in added]
        return exchanged(trials.problem, trials.fit(h), h, own, columns, offer)

    def _around(self, h: Hypothesis) -> LinearScreen:
        """Return the screen of all causes that act at once, in the place of others or beside."""
        self.trials.ask()
        key = self.candidates, h.effects
        if key not in self._screens:
            while len(self._screens) >= _KEPT:
                del self._screens[next(iter(self._screens))]
            problem, fit = self.trials.problem, self.trials.fit(h)
            self._screens[key] = screen(problem, fit, self.candidates, self.trials.failures)
        return self._screens[key]

    def _chosen(self, h: Hypothesis, search: LinearScreen, count: int) -> list[Screened]:
        """Return the best of a screen, each cause in its best shape."""
        offers: dict[tuple[Key, ...], Screened] = {}
        start = search.error(())
        for subset in search.best_first():
            self.trials.ask()
            if len(offers) >= count or subset.error > start:
                break
            added = [search.regressors[k] for k in subset.regressors]
            key = tuple(sorted(regressor.key for regressor in added))
            if key not in offers:
                offers[key] = (*h.effects, *search.effects(subset)), added
        return list(offers.values())

    def pairs_beside(self, h: Hypothesis, count: int) -> list[Offer]:
        """Return the effects of a hypothesis with two more that explain most together.

        They may hide one another: damping makes a delay look negative, neither is possible alone.
        What they explain is measured in floors, and in shares of what is left at each output: the
        log density falls by shares as long as they are small. In floors alone a joint that is far
        from its sensors' floor decides for all: a recorded six-axis arm, off by 103 floors at its
        fourth joint, kept 2.9 N m at its second (11 floors), where a pair leaves 1.3.
        """
        if not self.candidates:
            return []
        search = self._around(h)
        share = 1.0 / np.sqrt(np.maximum(h.outputs, 1.0))
        shares = screen_in_shares(self.trials.problem, self.trials.fit(h), search.regressors, share)
        offers: dict[tuple[Key, ...], Screened] = {}
        for screened in (search, shares):
            own = [s for s in screened.pairs(_AMONG) if np.isfinite(s.error)]
            for subset in own[:count]:
                added = [search.regressors[k] for k in subset.regressors]
                offer = (*h.effects, *screened.effects(subset))
                offers.setdefault(tuple(sorted(r.key for r in added)), (offer, added))
        each = [(self._gain(h, (), *one), one[0]) for one in offers.values()]
        return [offer for (density, prior), offer in each if MISSED * density > -prior]


def _reach(added: Sequence[Regressor]) -> float:
    """Return by how much derivatives may say too little of the evidence of causes [nats]."""
    shaped = any(p.shape for regressor in added for p in regressor.effect.parameters)
    linear = all(regressor.effect.acts_by <= _LINEAR_HOOKS for regressor in added)
    return HOPELESS if linear and not shaped else _BEYOND_FITS


def _drawn(search: LinearScreen) -> list[Subset]:
    """Return the best of every effect that is drawn to what is usual."""
    best: dict[type[Effect], Subset] = {}
    for k, regressor in enumerate(search.regressors):
        if not regressor.usual.any():
            continue
        subset = Subset((k,), search.error((k,)))
        known = best.get(regressor.effect)
        if np.isfinite(subset.error) and (known is None or subset.error < known.error):
            best[regressor.effect] = subset
    return list(best.values())
