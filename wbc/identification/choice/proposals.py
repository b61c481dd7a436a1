"""Which causes may be missing beside a hypothesis: screened linearly, not yet fitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import islice

import numpy as np

from wbc.identification.choice.candidate_columns import Regressor
from wbc.identification.choice.drop_screen import exchanged, losses, until_null
from wbc.identification.choice.evidence import Hypothesis, Key, Offer, weigh, without
from wbc.identification.choice.linear_screen import (
    LinearScreen,
    Subset,
    screen,
    screen_in_shares,
)
from wbc.identification.choice.trials import HOPELESS, Trials
from wbc.identification.model.columns import ADDS, drawn
from wbc.robot import Effect

Screened = tuple[Offer, list[Regressor]]
"""An offer with the causes that are new in it."""

_SCREEN_ERROR = 0.03
_SCREEN_NOISE = 0.2
_LINEAR_HOOKS = ADDS | {"change"}  # by which causes act linearly
_REPLACED = 0.5  # of what a cause explains, that it may still explain beside what replaces it
_LINEAR = 0.2  # share of what causes explain, by which a screen without them may be off
_SCREENED = 40  # causes of a screen that are looked at
_EXCHANGES = 24  # offers that are fitted in the place of one cause, of all causes together
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

    def beside(self, h: Hypothesis, count: int, exclude: Sequence[Key] = ()) -> list[Offer]:
        """Return the most promising causes beside those of a hypothesis, best first.

        Args:
            h: the hypothesis.
            count: how many offers at most.
        """
        chosen = self._beside(h, count, exclude, 0.0)
        return [offer for offer, added in chosen if self._may_add(h, offer, added)]

    def _beside(
        self, h: Hypothesis, count: int, exclude: Sequence[Key], enough: float
    ) -> list[Screened]:
        if not self.candidates:
            return []
        whole = self._around(h)
        search = whole.instead_of((), np.zeros(0), whole.robot, {*h.keys, *exclude})
        return self._chosen(h, search, count, enough)

    def instead(
        self, h: Hypothesis, own: Effect, count: int, *, hopeless: bool = False
    ) -> list[tuple[float, Offer]]:
        """Return the most promising causes in the place of one of a hypothesis.

        With each offer by how much derivatives say that it raises the evidence [nats]. All places
        of one hypothesis are screened by the same columns: a screen of its own for each would cost
        as much as everything else together. What is left without the cause its derivatives say; a
        cause that does not act linearly is left out of a fit first, unless nothing regains half of
        what it explains.

        Args:
            h: the hypothesis.
            own: its cause that gives way.
            count: how many offers at most.
            hopeless: whether those count that cannot win by derivatives; then these are enough,
                and nothing is fitted.
        """
        if drawn(own) or not own.search.gradual:
            return self._beside_rest(h, own, count)
        if not self.candidates:
            return []
        problem, fit = self.trials.problem, self.trials.fit(h)
        fewer = without(h.effects, own)
        search = self._around(h)
        gone, steps = until_null(fit, (own,), problem.robot)
        moved = search.instead_of(gone, steps, problem.robot.with_effects(*fewer), set(h.keys))
        chosen = self._chosen(replace(h, effects=fewer), moved, count, h.error, search)
        linear = own.acts_by <= _LINEAR_HOOKS
        # What a cause that is not linear explains may be half of what its derivatives say.
        lost = 0.0 if linear or h.swings else losses(problem, fit, h, [(own,)])[0][0]
        likely = []
        for offer, added in chosen:
            gain = sum(self._gain(h, (own,), offer, added))
            shaped = any(p.shape for regressor in added for p in regressor.effect.parameters)
            least = -HOPELESS if linear and not shaped else -_BEYOND_FITS
            if hopeless or gain > least - _REPLACED * max(lost, 0.0):
                likely.append((gain, offer))
        if linear or h.swings or hopeless or not likely:
            return likely
        rest = self.trials.of(fewer, h)
        if rest is None:
            return []
        off = abs(moved.error(()) - rest.error)
        if off > _LINEAR * abs(rest.error - h.error) + _SCREEN_NOISE:
            return self._beside_rest(h, own, count)
        return [(gain, (*rest.effects, *offer[len(fewer) :])) for gain, offer in likely]

    def exchanges(self, h: Hypothesis, count: int, *, hopeless: bool = False) -> list[Offer]:
        """Return the most promising exchanges of any one cause of a hypothesis, best first.

        Args:
            h: the hypothesis.
            count: how many offers are looked at in the place of one cause.
            hopeless: as of `instead`.
        """
        pairs = [
            pair for own in h.effects for pair in self.instead(h, own, count, hopeless=hopeless)
        ]
        pairs.sort(key=lambda pair: -pair[0])
        return [offer for _, offer in pairs[:_EXCHANGES]]

    def _beside_rest(self, h: Hypothesis, own: Effect, count: int) -> list[tuple[float, Offer]]:
        """Return the same as `instead`, screened beside the hypothesis fitted without the cause."""
        rest = self.trials.of(without(h.effects, own), h)
        if rest is None:
            return []
        left, right = weigh(self.trials.problem, [rest, h])
        likely = [
            (sum(self._gain(rest, (), offer, added), float(left - right)), offer)
            for offer, added in self._beside(rest, count, (own.key,), h.error)
        ]
        return [(gain, offer) for gain, offer in likely if gain > -_BEYOND_FITS]

    def _gain(
        self, h: Hypothesis, own: Sequence[Effect], offer: Offer, added: Sequence[Regressor]
    ) -> tuple[float, float]:
        """Return by how much derivatives say that the density and the prior rise [nats].

        The density is infinite for what is drawn to what is usual, of which they say little.

        Args:
            h: a hypothesis.
            own: its causes that give way.
            offer: what it then holds.
            added: the new ones.
        """
        if any(regressor.drawn for regressor in added):
            return np.inf, 0.0
        problem = self.trials.problem
        whitened = [regressor.columns.whitened(problem.whitening) for regressor in added]
        columns = -np.concatenate(whitened, axis=2)
        return exchanged(problem, self.trials.fit(h), h, own, columns, offer)

    def _may_add(self, h: Hypothesis, offer: Offer, added: Sequence[Regressor]) -> bool:
        """Whether derivatives do not say that causes more explain far less than they cost."""
        density, prior = self._gain(h, (), offer, added)
        return MISSED * density > -prior

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

    def _chosen(
        self,
        h: Hypothesis,
        search: LinearScreen,
        count: int,
        enough: float,
        around: LinearScreen | None = None,
    ) -> list[Screened]:
        """Return the best of a screen; `around` is that with the causes that give way."""
        start = search.error(())
        # What leaves a cause as much to explain as before does not take its place: it was tried as
        # a cause more.
        replaced = 0.0 if around is None else _REPLACED * (start - around.error(()))
        offers: list[Screened] = []
        seen: set[tuple[Key, ...]] = set()
        limit = 0.0
        single = False  # whether the best single one was seen, which stands beside the best group
        for subset in islice(search.best_first(), _SCREENED):
            self.trials.ask()
            limit = limit or _limit(start, subset.error, enough)
            if len(seen) >= count or subset.error > start or (single and subset.error > limit):
                break
            first_single = not single and len(subset.regressors) == 1
            single |= first_single
            added = [search.regressors[k] for k in subset.regressors]
            key = tuple(sorted(regressor.key for regressor in added))
            enters = subset.error <= limit or first_single
            if around is not None and search.error(subset.regressors) > replaced + around.error(
                subset.regressors
            ):
                continue
            if key in seen or not enters:
                continue
            seen.add(key)
            offers.append(((*h.effects, *search.effects(subset)), added))
        # A wrong drawing is imitated by many that explain a part each: it is tried beside them all.
        for subset in _drawn(search) if not enough and not h.swings else ():
            drawn = [search.regressors[k] for k in subset.regressors]
            if tuple(regressor.key for regressor in drawn) not in seen:
                offers.append(((*h.effects, *search.effects(subset)), drawn))
        return offers

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
            for subset in islice(screened.pairs(_AMONG), count):
                added = [search.regressors[k] for k in subset.regressors]
                offer = (*h.effects, *screened.effects(subset))
                offers.setdefault(tuple(sorted(r.key for r in added)), (offer, added))
        return [offer for offer, added in offers.values() if self._may_add(h, offer, added)]


def _limit(start: float, least: float, enough: float) -> float:
    """Return up to which error a cause is offered.

    Args:
        start: error without any of them.
        least: of the best of a screen.
        enough: error up to which an offer counts as good; 0 where only the best one's counts.
    """
    # The screen is linear: leave room for what the fit may still gain over it.
    return max(least, enough) + _SCREEN_ERROR * (start - least) + _SCREEN_NOISE


def _drawn(search: LinearScreen) -> list[Subset]:
    """Return the best of every effect that is drawn to what is usual."""
    best: dict[type[Effect], Subset] = {}
    for k, regressor in enumerate(search.regressors):
        if not regressor.drawn:
            continue
        subset = Subset((k,), search.error((k,)))
        known = best.get(regressor.effect)
        if search.possible((k,)) and (known is None or subset.error < known.error):
            best[regressor.effect] = subset
    return list(best.values())
