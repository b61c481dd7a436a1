"""Which causes may be missing beside a hypothesis: screened linearly, not yet fitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import islice

import numpy as np

from wbc.identification.choice.candidate_columns import Regressor, Shelf
from wbc.identification.choice.linear_screen import (
    LinearScreen,
    Nearby,
    Subset,
    screen,
    screen_in_shares,
    screen_instead,
)
from wbc.identification.choice.weighing.drop_screen import exchanged, until_null
from wbc.identification.choice.weighing.hypothesis import Hypothesis, Key
from wbc.identification.choice.weighing.trials import Trials
from wbc.robot import Effect

Offer = tuple[Effect, ...]
"""Effects with start values, not yet fitted."""

Screened = tuple[Offer, list[Regressor]]
"""An offer with the causes that are new in it."""

_SCREEN_ERROR = 0.03
_SCREEN_NOISE = 0.2
_REPLACED = 0.5  # of what a cause explains, that it may still explain beside what replaces it
_LINEAR = 0.2  # share of what causes explain, by which a screen without them may be off
_SCREENED = 40  # causes of a screen that are looked at
# Evidence [nats] that an exchange may lack by derivatives and still be fitted. Of 72 that lacked
# more (a quadruped, 22 generated logs) all were 41 behind or more once fitted, where derivatives
# know least: a Stribeck speed between those of the screen. Of 24 that lacked 20 to 250, some won.
_BEYOND_FITS = 250.0
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
    _common: Shelf = field(default_factory=dict)
    _near: dict[Offer, Nearby] = field(default_factory=dict)
    _instead: dict[tuple[tuple[type[Effect], ...], Offer], tuple[LinearScreen, list[Regressor]]] = (
        field(default_factory=dict)
    )

    def near(self, h: Hypothesis) -> Nearby:
        """Return the robot of a hypothesis, with the columns that serve for those close to it."""
        if h.effects not in self._near:
            self._near.clear()
            self._near[h.effects] = (self.trials.fit(h).robot, {})
        return self._near[h.effects]

    def beside(
        self,
        h: Hypothesis,
        count: int,
        exclude: Sequence[Key] = (),
        enough: float = 0.0,
        near: Nearby | None = None,
    ) -> list[Offer]:
        """Return the most promising causes beside those of a hypothesis, best first.

        Args:
            h: the hypothesis.
            count: how many offers at most.
            exclude: names and places that are not offered.
            enough: error [floors^2] up to which an offer counts as good; else the best one's.
            near: a robot close to the hypothesis', whose columns serve for its own.
        """
        if not self.candidates:
            return []
        fit, trials = self.trials.fit(h), self.trials
        search, regressors = screen(
            trials.problem,
            fit,
            self.candidates,
            {*h.keys, *exclude},
            near,
            trials.failures,
            self._common,
        )
        return [offer for offer, _ in self._chosen(h, search, regressors, count, enough)]

    def instead(
        self,
        h: Hypothesis,
        own: Sequence[Effect],
        rest: Hypothesis,
        count: int,
        exclude: Sequence[Key],
    ) -> list[Offer] | None:
        """Return the most promising causes in the place of some of a hypothesis, best first.

        All places of one hypothesis are screened by the same columns: a screen of its own for
        each would cost as much as everything else together.

        Args:
            h: the hypothesis.
            own: its causes that give way.
            rest: the hypothesis without them, fitted.
            count: how many offers at most.
            exclude: names and places that are not offered.

        Returns:
            None where one set of columns does not serve: links swing, or the causes that give way
            do not act linearly.
        """
        found = self._without(h, own, rest, exclude)
        if found is None:
            return None
        moved, search, regressors = found
        offers = self._chosen(rest, moved, regressors, count, h.error, search)
        # The best one is fitted however far behind: the answer says by how much.
        best, others = offers[:1], offers[1:]
        likely = [one for one in others if self._may_win(h, own, *one)]
        return [offer for offer, _ in (*best, *likely)]

    def _without(
        self, h: Hypothesis, own: Sequence[Effect], rest: Hypothesis, exclude: Sequence[Key]
    ) -> tuple[LinearScreen, LinearScreen, list[Regressor]] | None:
        """Return the screen beside a hypothesis without some causes, that with them, the causes."""
        drawn = any(e.search.departures(e).size for e in own)
        if drawn or h.swings or not self.candidates:
            return None
        search, regressors = self._around(h)
        robot = self.trials.problem.robot
        gone, steps = until_null(self.trials.fit(h), own, robot)
        taken = {*h.keys, *exclude}
        moved = search.instead_of(gone, steps, robot.with_effects(*rest.effects), taken)
        if abs(moved.error(()) - rest.error) > _LINEAR * abs(rest.error - h.error) + _SCREEN_NOISE:
            return None
        return moved, search, regressors

    def _may_win(
        self, h: Hypothesis, own: Sequence[Effect], offer: Offer, added: Sequence[Regressor]
    ) -> bool:
        """Whether derivatives do not say that an exchange loses far more than a fit may regain."""
        if any(regressor.usual.any() for regressor in added):
            return True
        trials = self.trials
        columns = [regressor.columns for regressor in added]
        gain = exchanged(trials.problem, trials.fit(h), h, own, columns, offer)
        return gain > -_BEYOND_FITS

    def _around(self, h: Hypothesis) -> tuple[LinearScreen, list[Regressor]]:
        """Return the screen of all causes that act at once, in the place of others or beside."""
        key = self.candidates, h.effects
        if key not in self._instead:
            self._instead.clear()
            problem, fit = self.trials.problem, self.trials.fit(h)
            self._instead[key] = screen_instead(
                problem, fit, self.candidates, self.trials.failures, self._common
            )
        return self._instead[key]

    def _chosen(
        self,
        h: Hypothesis,
        search: LinearScreen,
        regressors: list[Regressor],
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
            limit = limit or _limit(start, subset.error, enough)
            if len(seen) >= count or subset.error > start or (single and subset.error > limit):
                break
            first_single = not single and len(subset.regressors) == 1
            single |= first_single
            added = [regressors[k] for k in subset.regressors]
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
        for subset in _drawn(search, regressors) if not enough and not h.swings else ():
            drawn = [regressors[k] for k in subset.regressors]
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
        search, regressors = self._around(h)
        share = 1.0 / np.sqrt(np.maximum(h.outputs, 1.0))
        shares = screen_in_shares(self.trials.problem, self.trials.fit(h), regressors, share)
        offers: dict[tuple[Key, ...], Offer] = {}
        for screened in (search, shares):
            own = [s for s in screened.pairs(_AMONG) if np.isfinite(s.error)]
            for effects in [screened.effects(subset) for subset in own[:count]]:
                offers.setdefault(tuple(sorted(e.key for e in effects)), effects)
        return [(*h.effects, *effects) for effects in offers.values()]


def _limit(start: float, least: float, enough: float) -> float:
    """Return up to which error a cause is offered.

    Args:
        start: error without any of them.
        least: of the best of a screen.
        enough: error up to which an offer counts as good; 0 where only the best one's counts.
    """
    # The screen is linear: leave room for what the fit may still gain over it.
    return max(least, enough) + _SCREEN_ERROR * (start - least) + _SCREEN_NOISE


def _drawn(search: LinearScreen, regressors: Sequence[Regressor]) -> list[Subset]:
    """Return the best of every effect that is drawn to what is usual."""
    best: dict[type[Effect], Subset] = {}
    for k, regressor in enumerate(regressors):
        if not regressor.usual.any():
            continue
        subset = Subset((k,), search.error((k,)))
        known = best.get(regressor.effect)
        if np.isfinite(subset.error) and (known is None or subset.error < known.error):
            best[regressor.effect] = subset
    return list(best.values())
