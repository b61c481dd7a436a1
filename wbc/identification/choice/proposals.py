"""Which causes may be missing beside a model: screened linearly, not yet fitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from wbc.identification.choice.candidate_columns import Atom
from wbc.identification.choice.hypothesis import Model
from wbc.identification.choice.judge import SYSTEMATIC_SIMULATED, Judge
from wbc.identification.choice.linear_screen import BeamSearch, Subset
from wbc.identification.choice.screening import Nearby, Swinging, screen
from wbc.identification.model.yielding import deflects
from wbc.robot import Effect, Robot

_PROMISING = 0.5  # of the present error, that a swinging link must be screened to leave
_ROUGHLY = 5.0  # times the error of the best one screened, from which on it cannot catch up
_SCREEN_ERROR = 0.03
_SCREEN_NOISE = 0.2
_AMONG = 100  # pairs of causes that are judged on held-out data


@dataclass(frozen=True, eq=False)
class Proposer(Judge):
    """Proposes causes for models, and keeps every model fitted.

    Attributes:
        problem: the logs.
        candidates: effect classes that may be used.
        aside: (name, where) of causes that are not considered.
    """

    candidates: tuple[type[Effect], ...]
    aside: frozenset[tuple[str, str]] = frozenset()
    _known: dict[tuple[Effect, ...], Model] = field(default_factory=dict)
    _simulated: dict[tuple[Effect, ...], Swinging] = field(default_factory=dict)

    @property
    def fitted(self) -> tuple[Model, ...]:
        """Every model fitted so far."""
        return tuple(model for model in self._known.values() if not model.fit.failed)

    @property
    def dropped(self) -> tuple[Model, ...]:
        """Every model that could not be fitted; `fit.failed` says why."""
        return tuple(model for model in self._known.values() if model.fit.failed)

    def model(self, effects: Sequence[Effect]) -> Model:
        """Return the fitted model with these causes."""
        key = tuple(effects)
        if key not in self._known:
            fit = self.problem.fit(effects)
            self._known[key] = Model(fit, self.problem.held_out(fit))
        return self._known[key]

    @property
    def at_once(self) -> Self:
        """The same among causes that act at once: no link is simulated for them."""
        return replace(self, candidates=tuple(c for c in self.candidates if not deflects(c)))

    def promising(
        self,
        model: Model,
        count: int,
        exclude: Sequence[tuple[str, str]] = (),
        enough: float = 0.0,
        most: float = np.inf,
        near: Nearby | None = None,
    ) -> list[tuple[Effect, ...]]:
        """Return the effects of a model with those that are most promising beside them, unfitted.

        Those whose screened error is clearly above both the best one and `enough`, or above `most`,
        are left out. With `near` the screen's columns are those of a robot close by.
        """
        if not self.candidates or model.fit.failed:
            return []
        excess, first = model.error - 1.0, self.model(()).error - 1.0
        much = excess > SYSTEMATIC_SIMULATED**2 * first
        offered = [c for c in self.candidates if much or not deflects(c)]
        search, atoms = self._screened(model, offered, exclude, near)
        start = Subset((), search.error(()))
        found = search.grow([start])
        found = [subset for subset in found if subset.error < most]
        offers: list[tuple[Effect, ...]] = []
        least = found[0].error if found else start.error
        # The screen is linear: leave room for what the refit may still gain over it.
        doubt = _SCREEN_ERROR * (start.error - least) + _SCREEN_NOISE
        worst = max(least, enough) + doubt
        # Beside the best group of places stands the best single one.
        single = next((s for s in found if len(s.atoms) == 1), None)
        seen: set[tuple[tuple[str, str], ...]] = set()
        for subset in found:
            added = [atoms[k] for k in subset.atoms]
            key = tuple(sorted(atom.key for atom in added))
            # How a link swings is screened roughly: the fit gains much over it.
            swings = any(deflects(atom.effect) for atom in added)
            rough = min(_PROMISING * start.error, _ROUGHLY * (enough or least))
            rough = max(rough, worst) if enough else rough
            enters = subset.error <= rough if swings else subset is single or subset.error <= worst
            if key in seen or len(seen) >= count or not enters or subset.error > start.error:
                continue
            seen.add(key)
            offers.append((*model.effects, *search.effects(subset)))
        if model.swings:
            offers += [(*model.effects, e) for e in _swinging_too(model.fit.robot, atoms, seen)]
        return offers

    def in_pairs(self, model: Model, count: int, most: float) -> list[tuple[Effect, ...]]:
        """Return the effects of a model with two more, unfitted, whose screened error is low.

        Args:
            model: beside whose causes two are sought that hide one another.
            count: how many offers at most.
            most: screened error above which a pair is left out.
        """
        offered = [c for c in self.candidates if not deflects(c)]
        if not offered or model.fit.failed:
            return []
        search, _ = self._screened(model, offered)
        offers: dict[tuple[tuple[str, str], ...], tuple[Effect, ...]] = {}
        for subset in search.pairs(_AMONG):
            if subset.error >= most or len(offers) == count:
                break
            effects = search.effects(subset)
            offers.setdefault(tuple(sorted(e.key for e in effects)), effects)
        return [(*model.effects, *effects) for effects in offers.values()]

    def _screened(
        self,
        model: Model,
        offered: Sequence[type[Effect]],
        exclude: Sequence[tuple[str, str]] = (),
        near: Nearby | None = None,
    ) -> tuple[BeamSearch, list[Atom]]:
        taken = {e.key for e in model.effects} | set(exclude) | self.aside
        # One gear yields in one way: play before a spring is play with soft flanks.
        yielding = [e.where for e in model.effects if deflects(e)]
        taken |= {(c.name, joint) for c in offered if deflects(c) for joint in yielding}
        simulated = self._simulated.setdefault(model.effects, {})
        return screen(self.problem, model.fit, offered, taken, simulated, near)


def _swinging_too(
    robot: Robot, atoms: Sequence[Atom], seen: set[tuple[tuple[str, str], ...]]
) -> list[Effect]:
    """Return the best of every link that may swing, but those seen.

    Two links that swing shake one another: no sum of columns says how both would move.
    """
    best = {atom.key: atom for atom in reversed(atoms) if deflects(atom.effect)}
    effects = [atom.build(robot, np.ones(1)) for key, atom in best.items() if (key,) not in seen]
    return [effect for effect in effects if effect is not None]
