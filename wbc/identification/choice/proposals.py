"""Which causes may be missing beside a hypothesis, or stand in the place of one: not yet fitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import chain, combinations

import numpy as np

from wbc.identification.choice.drop_screen import losses
from wbc.identification.choice.evidence import Hypothesis, Offer, weigh, without
from wbc.identification.choice.screen import CauseScreen, Proposed
from wbc.identification.choice.trials import HOPELESS, Trials
from wbc.identification.model.columns import ADDS
from wbc.robot import Effect

_LINEAR_HOOKS = ADDS | {"change"}  # by which causes act linearly
_EXCHANGES = 24  # offers that are fitted in the place of one cause, of all causes together
# Evidence [nats] that an exchange may lack by derivatives and still be fitted. Of 72 that lacked
# more (a quadruped, 22 generated logs) all were 41 behind or more once fitted, where derivatives
# know least: a Stribeck speed between those of the screen. Of 24 that lacked 20 to 250, some won.
_BEYOND_FITS = 250.0
# Times what derivatives say of the density that a cause gains or loses, up to which they may be
# wrong: of 172 drops on a recorded arm the true loss was 0.58 to 1.37 times the one they say.
MISSED = 3.0


@dataclass(eq=False)
class Proposer:
    """Proposes causes beside hypotheses.

    Attributes:
        trials: fitted so far, with the logs.
        candidates: effect classes that may be used, all of what acts at once.
    """

    trials: Trials
    candidates: tuple[type[Effect], ...]
    _screens: dict[Offer, CauseScreen] = field(default_factory=dict)

    def beside(self, h: Hypothesis, count: int) -> list[Offer]:
        """Return the most promising causes beside those of a hypothesis, best first.

        Args:
            h: the hypothesis.
            count: how many offers at most, beside drawings.
        """
        screen = self._around(h)
        found = screen.ranked((), h.keys, count)
        found += screen.together(screen.in_all_gears(h.keys), count)
        # A wrong drawing is imitated by many that explain a part each: it is tried beside them all.
        drawings = () if h.swings else screen.drawings(h.keys)
        return [*_may_add(h, found)[:count], *((*h.effects, *one.added) for one in drawings)]

    def pairs_beside(self, h: Hypothesis, count: int) -> list[Offer]:
        """Return the effects of a hypothesis with two more that explain most together.

        They may hide one another: damping makes a delay look negative, neither is possible alone.
        """
        screen = self._around(h)
        each = (screen.together(pairs, count) for pairs in screen.pairs(h.keys))
        return _may_add(h, [*chain.from_iterable(each)])[:count]

    def exchanges(self, h: Hypothesis, count: int, *, hopeless: bool = False) -> list[Offer]:
        """Return the most promising exchanges of one cause of a hypothesis, or of two at a place.

        The best first. A lossy gear is load friction and a torque constant together.

        Args:
            h: the hypothesis.
            count: how many offers are looked at in the place of the same causes.
            hopeless: whether those of one cause count, even if they cannot win by derivatives.
        """
        pairs = () if hopeless or h.swings else combinations(h.effects, 2)
        given: list[Offer] = [(own,) for own in h.effects]
        given += [(one, other) for one, other in pairs if one.where == other.where]
        found = [pair for own in given for pair in self._instead(h, own, count, hopeless)]
        found.sort(key=lambda pair: -pair[0])
        return [offer for _, offer in found[:_EXCHANGES]]

    def _instead(
        self, h: Hypothesis, own: Offer, count: int, hopeless: bool
    ) -> list[tuple[float, Offer]]:
        """Return the most promising causes in the place of some, and how far the evidence rises.

        The columns are those beside the hypothesis. What is left without the causes its derivatives
        say where they follow them, else a fit without them. What adds nothing to the evidence
        beside the rest takes nobody's place.
        """
        screen, rest, problem = self._around(h), without(h.effects, *own), self.trials.problem
        first = 0.0
        if h.swings or all(e.search.gradual and not e.search.drawn for e in own):
            loss, saved = losses(problem, self.trials.fit(h), h, [own])[0]
            found, alone = screen.ranked(own, h.keys, count), saved - loss
        elif (fewer := self.trials.of(rest, h)) is not None:
            first = alone = float(-np.diff(weigh(problem, [fewer, h]))[0])
            rest = fewer.effects
            found = screen.beside(fewer, self.trials.fit(fewer)).ranked((), h.keys, count)
        else:
            return []
        straight = all(e.acts_by <= _LINEAR_HOOKS for e in own)
        pairs = [(first + one.gain, one) for one in found if first + one.gain > alone]
        return [
            (gain, (*rest, *one.added))
            for gain, one in pairs
            if hopeless or gain > -(_BEYOND_FITS if one.shaped or not straight else HOPELESS)
        ]

    def _around(self, h: Hypothesis) -> CauseScreen:
        """Return the screen of all causes that act at once, in the place of others or beside."""
        self.trials.ask()
        if h.effects not in self._screens:
            trials, fit = self.trials, self.trials.fit(h)
            screen = CauseScreen.of(trials.problem, h, fit, self.candidates, trials.failures)
            self._screens = {h.effects: screen}
        return self._screens[h.effects]


def _may_add(h: Hypothesis, found: Sequence[Proposed]) -> list[Offer]:
    """Return causes more of which derivatives do not say that they explain far too little."""
    best = sorted(found, key=lambda one: -one.gain)
    return [(*h.effects, *one.added) for one in best if MISSED * one.density > -one.prior]
