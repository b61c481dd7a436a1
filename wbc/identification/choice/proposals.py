"""Which causes may be missing beside a hypothesis: screened linearly, not yet fitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from wbc.identification.choice.candidate_columns import Atom
from wbc.identification.choice.hypothesis import Hypothesis, Key
from wbc.identification.choice.linear_screen import BeamSearch, Subset
from wbc.identification.choice.screening import Nearby, Swinging, screen
from wbc.identification.choice.trials import Trials
from wbc.identification.model.yielding import deflects
from wbc.robot import Effect, Robot

Offer = tuple[Effect, ...]
"""Effects with start values, not yet fitted."""

_PROMISING = 0.5  # of the present error, that a swinging link must be screened to leave
_ROUGHLY = 5.0  # times the error of the best one screened, from which on it cannot catch up
_SCREEN_ERROR = 0.03
_SCREEN_NOISE = 0.2
_SIMULATED = 4  # joints behind which links are simulated in one screen
_REMEMBERED = 6  # hypotheses whose simulated links are kept
_AMONG = 100  # pairs of causes that are screened on held-out data


@dataclass(eq=False)
class Proposer:
    """Proposes causes beside hypotheses.

    Attributes:
        trials: fitted so far, with the logs.
        candidates: effect classes that may be used.
        aside: names and places that are not considered.
    """

    trials: Trials
    candidates: tuple[type[Effect], ...]
    aside: frozenset[Key] = frozenset()
    _simulated: dict[Offer, Swinging] = field(default_factory=dict)

    @property
    def at_once(self) -> Self:
        """The same among causes that act at once: no link is simulated for them."""
        return replace(self, candidates=tuple(c for c in self.candidates if not deflects(c)))

    @property
    def yielding(self) -> Self:
        """The same among gears that yield."""
        return replace(self, candidates=tuple(c for c in self.candidates if deflects(c)))

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
        search, atoms = self._screened(h, self.candidates, exclude, near)
        start = Subset((), search.error(()))
        found = search.grow([start])
        offers: list[Offer] = []
        least = found[0].error if found else start.error
        # The screen is linear: leave room for what the fit may still gain over it.
        doubt = _SCREEN_ERROR * (start.error - least) + _SCREEN_NOISE
        worst = max(least, enough) + doubt
        # Beside the best group of places stands the best single one.
        single = next((s for s in found if len(s.atoms) == 1), None)
        seen: set[tuple[Key, ...]] = set()
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
            offers.append((*h.effects, *search.effects(subset)))
        # A wrong drawing is imitated by many that explain a part each: it is tried beside them all.
        for subset in _drawn(search, atoms) if not enough and not h.swings else ():
            if tuple(atoms[k].key for k in subset.atoms) not in seen:
                offers.append((*h.effects, *search.effects(subset)))
        if h.swings:
            robot = self.trials.fit(h).robot
            offers += [(*h.effects, e) for e in _swinging_too(robot, atoms, seen)]
        return offers

    def pairs_beside(self, h: Hypothesis, count: int) -> list[Offer]:
        """Return the effects of a hypothesis with two more that explain most together.

        They may hide one another: damping makes a delay look negative, neither is possible alone.
        """
        offered = [c for c in self.candidates if not deflects(c)]
        if not offered:
            return []
        search, _ = self._screened(h, offered)
        offers: dict[tuple[Key, ...], Offer] = {}
        for subset in search.pairs(_AMONG):
            if not np.isfinite(subset.error) or len(offers) == count:
                break
            effects = search.effects(subset)
            offers.setdefault(tuple(sorted(e.key for e in effects)), effects)
        return [(*h.effects, *effects) for effects in offers.values()]

    def _screened(
        self,
        h: Hypothesis,
        offered: Sequence[type[Effect]],
        exclude: Sequence[Key] = (),
        near: Nearby | None = None,
    ) -> tuple[BeamSearch, list[Atom]]:
        taken = {*h.keys, *exclude, *self.aside}
        # One gear yields in one way: play before a spring is play with soft flanks.
        yielding = [e.where for e in h.effects if deflects(e)]
        yielding += self._calm_joints(h)
        taken |= {(c.name, joint) for c in offered if deflects(c) for joint in yielding}
        simulated = self._simulated.setdefault(h.effects, {})
        while len(self._simulated) > _REMEMBERED:
            del self._simulated[next(iter(self._simulated))]
        fit = self.trials.fit(h)
        failures = self.trials.failures
        return screen(self.trials.problem, fit, offered, taken, simulated, near, failures)

    def _calm_joints(self, h: Hypothesis) -> list[str]:
        """Return the joints at which a gear that yields is not sought: little is left there.

        Every joint is a simulation of its link per trial; of many, those with most left are tried.
        """
        problem = self.trials.problem
        joints = problem.robot.transmission.joints
        judged = [k for k in range(len(joints)) if k not in problem.floor.aside]
        order = np.argsort(-h.outputs[: len(judged)])
        return [joints[judged[k]] for k in order[_SIMULATED:]]


def _drawn(search: BeamSearch, atoms: Sequence[Atom]) -> list[Subset]:
    """Return the best of every effect that is drawn to what is usual."""
    best: dict[type[Effect], Subset] = {}
    for k, atom in enumerate(atoms):
        if not atom.usual.any():
            continue
        subset = Subset((k,), search.error((k,)))
        known = best.get(atom.effect)
        if np.isfinite(subset.error) and (known is None or subset.error < known.error):
            best[atom.effect] = subset
    return list(best.values())


def _swinging_too(robot: Robot, atoms: Sequence[Atom], seen: set[tuple[Key, ...]]) -> list[Effect]:
    """Return the best of every link that may swing, but those seen.

    Two links that swing shake one another: no sum of columns says how both would move.
    """
    best = {atom.key: atom for atom in reversed(atoms) if deflects(atom.effect)}
    effects = [atom.build(robot, np.ones(1)) for key, atom in best.items() if (key,) not in seen]
    return [effect for effect in effects if effect is not None]
