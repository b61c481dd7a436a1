"""Which causes may be missing beside a hypothesis: screened linearly, not yet fitted."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import chain
from typing import NamedTuple

import numpy as np

from wbc.identification.choice.certainty import TIED
from wbc.identification.choice.drop_screen import exchanged, losses, until_null
from wbc.identification.choice.evidence import Hypothesis, Key, Offer, weigh, without
from wbc.identification.choice.linear_screen import LinearScreen, Subset, screen
from wbc.identification.choice.trials import HOPELESS, Trials
from wbc.identification.model.columns import ADDS, drawn
from wbc.robot import Effect

_LINEAR_HOOKS = ADDS | {"change"}  # by which causes act linearly
_REPLACED = 0.5  # of what a cause explains, that it may still explain beside what replaces it
_LINEAR = 0.2  # share of what causes explain, by which a screen without them may be off
_SCREENED = 40  # causes of a screen that are looked at
_SWAPPED = 5  # ... in the place of one cause
_FITTED = 24  # offers that are fitted for one move
# Evidence [nats] that an exchange may lack by derivatives and still be fitted. Of 72 that lacked
# more (a quadruped, 22 generated logs) all were 41 behind or more once fitted, where derivatives
# know least: a Stribeck speed between those of the screen. Of 24 that lacked 20 to 250, some won.
_BEYOND_FITS = 250.0
# Times what derivatives say of the density that a cause gains or loses, up to which they may be
# wrong: of 172 drops on a recorded arm the true loss was 0.58 to 1.37 times the one they say.
MISSED = 3.0
SAME = 0.01
"""Evidence [nats] by which hypotheses differ that differ in last digits only."""
_KEPT = 2  # screens: of the present hypothesis, and of one without a cause
_AMONG = 100  # pairs of causes that are screened on held-out data


class Move(NamedTuple):
    """A step from one hypothesis to another, as derivatives tell it before a fit."""

    offer: Offer
    names: tuple[Key, ...]
    """Of causes that go, and of new ones."""
    density: float
    """By how much the log density rises [nats]."""
    prior: float
    """By how much the log prior does, with plausible numbers [nats]."""
    shaped: bool
    """Whether a new cause has a shape, between those of the screen."""
    lacked: float | None = None
    """How much less a fit gained when it was tried last [nats]; None where it never was."""

    @property
    def gain(self) -> float:
        """Of the evidence [nats]."""
        return self.density + self.prior - (self.lacked or 0.0)

    def may_gain(self, least: float) -> bool:
        """Whether the evidence may rise by as much; what was never fitted counts as if it did."""
        return self.lacked is None or self.gain > least


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
    _lacked: dict[tuple[Key, ...], float] = field(default_factory=dict)

    def learn(self, move: Move, gain: float) -> None:
        """Remember what a fit of a move gained: it corrects what derivatives say of it later."""
        self._lacked[move.names] = move.density + move.prior - gain

    def additions(self, h: Hypothesis) -> list[Move]:
        """Return the most promising causes beside those of a hypothesis, best first."""
        search = self._beside(h, h.keys)
        # A wrong drawing is imitated by many that explain a part each: it is tried beside them all.
        several = chain(search.best_first(), () if h.swings else search.best_drawn())
        return self._likely(self._moves(h, (), search, several, _SCREENED))

    def pairs(self, h: Hypothesis) -> list[Move]:
        """Return the most promising pairs of causes beside those of a hypothesis, best first.

        They may hide one another: damping makes a delay look negative, neither is possible alone.
        """
        search = self._around(h)
        return self._likely(self._moves(h, (), search, search.pairs(_AMONG), _SCREENED))

    def exchanges(self, h: Hypothesis, *, hopeless: bool = False) -> list[Move]:
        """Return the most promising exchanges of any one cause of a hypothesis, best first.

        Args:
            h: the hypothesis.
            hopeless: as of `instead`.
        """
        moves = [move for own in h.effects for move in self.instead(h, own, hopeless=hopeless)]
        return self._ranked(moves)

    def instead(self, h: Hypothesis, own: Effect, *, hopeless: bool = False) -> list[Move]:
        """Return the most promising causes in the place of one of a hypothesis.

        All places of one hypothesis are screened by the same columns: a screen of its own for each
        would cost as much as everything else together. What is left without the cause its
        derivatives say; a cause that does not act linearly is left out of a fit first, unless
        nothing regains half of what it explains.

        Args:
            h: the hypothesis.
            own: its cause that gives way.
            hopeless: whether those count that cannot win by derivatives; then these are enough,
                and nothing is fitted.
        """
        if drawn(own) or not own.search.gradual:
            return self._beside_rest(h, own)
        problem, fit = self.trials.problem, self.trials.fit(h)
        fewer = without(h.effects, own)
        search = self._around(h)
        gone, steps = until_null(fit, (own,), problem.robot)
        moved = search.instead_of(gone, steps, problem.robot.with_effects(*fewer), set(h.keys))
        # What leaves a cause as much to explain as before does not take its place: it was tried as
        # a cause more.
        kept = _REPLACED * (moved.error(()) - search.error(()))
        replacing = (
            subset
            for subset in moved.best_first()
            if subset.error <= kept + search.error(subset.regressors)
        )
        moves = self._moves(h, (own,), moved, replacing, _SWAPPED)
        if hopeless or h.swings:
            return moves
        linear = own.acts_by <= _LINEAR_HOOKS
        # What a cause that is not linear explains may be half of what its derivatives say.
        lost = 0.0 if linear else losses(problem, fit, h, [(own,)])[0][0]
        least = -_REPLACED * max(lost, 0.0)
        moves = [
            move
            for move in moves
            if move.gain > least - (HOPELESS if linear and not move.shaped else _BEYOND_FITS)
            and move.may_gain(TIED)
        ]
        if linear or not moves:
            return moves
        rest = self.trials.of(fewer, h)
        if rest is None:
            return []
        off, whole = (abs(moved.shared(rest) - e) for e in (moved.error(()), moved.shared(h)))
        if off > _LINEAR * whole:
            return self._beside_rest(h, own)
        begun = (move._replace(offer=(*rest.effects, *move.offer[len(fewer) :])) for move in moves)
        return list(begun)

    def _beside_rest(self, h: Hypothesis, own: Effect) -> list[Move]:
        """Return the same as `instead`, screened beside the hypothesis fitted without the cause."""
        rest = self.trials.of(without(h.effects, own), h)
        if rest is None:
            return []
        left, right = weigh(self.trials.problem, [rest, h])
        search = self._beside(rest, h.keys)
        moves = self._moves(rest, (), search, search.best_first(), _SWAPPED, [own])
        each = (move._replace(prior=move.prior + float(left - right)) for move in moves)
        return [move for move in each if move.gain > -_BEYOND_FITS]

    def _moves(
        self,
        h: Hypothesis,
        own: Sequence[Effect],
        search: LinearScreen,
        subsets: Iterable[Subset],
        count: int,
        gone: Sequence[Effect] = (),
    ) -> list[Move]:
        """Return what sets of causes in the place of some of a hypothesis promise.

        Args:
            h: the hypothesis.
            own: its causes that give way.
            search: the screen.
            subsets: of it, best first; each set of names and places counts once.
            count: how many at most.
            gone: causes that the hypothesis is fitted without.
        """
        problem, fit = self.trials.problem, self.trials.fit(h)
        found: dict[tuple[Key, ...], Move] = {}
        for subset in subsets:
            self.trials.ask()
            if len(found) >= count:
                break
            added = [search.regressors[k] for k in subset.regressors]
            key = tuple(sorted(regressor.key for regressor in added))
            if key not in found:
                offer = (*without(h.effects, *own), *search.effects(subset))
                told = exchanged(problem, fit, h, own, added, offer)
                shaped = any(p.shape for regressor in added for p in regressor.effect.parameters)
                names = (*(effect.key for effect in (*own, *gone)), *key)
                found[key] = Move(offer, names, *told, shaped, self._lacked.get(names))
        return list(found.values())

    def _likely(self, moves: Iterable[Move]) -> list[Move]:
        """Return the moves that may win, best first.

        Derivatives do not say of them that they explain far less than they cost.
        """
        return self._ranked(m for m in moves if MISSED * m.density > -m.prior and m.may_gain(0.0))

    def _ranked(self, moves: Iterable[Move]) -> list[Move]:
        """Return the moves that are fitted, best first; of what does the same the usual effect."""
        order = {kind.name: k for k, kind in enumerate(self.candidates)}

        def place(move: Move) -> tuple[float, list[int]]:
            return -round(move.gain / SAME), [order.get(name, 0) for name, _ in move.names]

        return sorted(moves, key=place)[:_FITTED]

    def _beside(self, h: Hypothesis, taken: Iterable[Key]) -> LinearScreen:
        """Return the screen of causes beside all of a hypothesis."""
        whole = self._around(h)
        return whole.instead_of((), np.zeros(0), whole.robot, set(taken))

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
