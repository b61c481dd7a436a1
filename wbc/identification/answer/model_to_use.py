"""What is believed of a search, and the model to use: the one that predicts best.

The model may hold causes whose names are doubted: their torque predicts all the same.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit
from scipy.stats import sem

from wbc.arrays import FloatArray
from wbc.identification.answer.remainder import Attainable, attainable
from wbc.identification.choice.certainty import EVEN, Odds, Support, odds_of, support_of
from wbc.identification.choice.drop_screen import losses
from wbc.identification.choice.evidence import Hypothesis, Key, without
from wbc.identification.choice.find_causes import SearchResult
from wbc.identification.choice.plain_models import plain_fits, without_idle
from wbc.identification.choice.trials import Trials
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.records.record import output_names
from wbc.robot import Effect

# Times the error of another model, up to which one is as good: by as much recorded machines are
# judged. Of six joints and four plain fits one differs by a standard error by chance: without it a
# wrong link of an arm, found alone, stood behind all links together by 0.2 % at one joint.
_AS_GOOD = 1.02


@dataclass(frozen=True)
class Answer:
    """A model, judged.

    Attributes:
        hypothesis: the causes with their fit.
        odds: of all that was tried beside it.
        level: what it leaves, and how much of that any model could explain.
        support: what speaks for each cause, and for each that is named.
        rivals: what could stand in the place of each.
        more: whether more must be missing.
        named: the hypothesis whose causes are named, that with the most evidence.
    """

    hypothesis: Hypothesis
    odds: Odds
    level: Attainable
    support: dict[Key, Support]
    rivals: dict[Key, tuple[Key, ...]]
    more: bool
    named: Hypothesis


def judged(trials: Trials, h: Hypothesis) -> Answer:
    """Return a hypothesis with what speaks for its causes.

    Args:
        trials: of the search.
        h: the hypothesis.
    """
    odds = odds_of(trials, h)
    level = attainable(trials.problem, trials.fit(h))
    support, more = support_of(trials, h, odds, level.excess)
    rivals = dict(zip(h.keys, odds.rivals(h), strict=True))
    return Answer(h, odds, level, support, rivals, more, h)


def model_to_use(found: SearchResult, classes: Sequence[type[Effect]]) -> Answer:
    """Return the model that predicts held-out data best, with the odds of each of its causes.

    It is the hypothesis with the most evidence, if nothing else leaves less: joint by joint, beyond
    a standard error. Else it is what was found beside the plain fits, or one of these alone. A
    cause that is not believed stays in a model that predicts better with it: its torque is real,
    only its name is not.

    Args:
        found: the search.
        classes: effects that may be used.
    """
    trials = found.trials
    # No move has held against others yet what a search tried that was stopped.
    others = () if found.stopped else (h for h in trials.known if h.believable)
    most = trials.best_of([*others, found.final])
    names = judged(trials, most)
    used = _best(trials, names, classes) if classes else most
    if set(used.keys) < set(most.keys):  # what harms a prediction is no name either
        return judged(trials, used)
    return names if used is most else _doubting(trials, used, names)


def _best(trials: Trials, names: Answer, classes: Sequence[type[Effect]]) -> Hypothesis:
    """Return the first model that no other is better than; else the one least behind.

    What was found comes first. It must match the robot as given and the plain fits. What drives
    report beyond a limit is no error where the limit is believed. Last come the plain fits beside
    what was found, where that is behind them: what they have at the joints where it is, then all.
    Links that swing are simulated: beside them no plain fit is tried.
    """
    problem, end = trials.problem, names.hypothesis
    if end.only_noise(problem):
        return end
    plain = plain_fits(trials, classes)
    rivals = [end, trials.nothing, *plain]
    drives = [names.support[e.key] for e in end.effects if "drive" in e.acts_by]
    own = end.squares if all(one.belief >= EVEN for one in drives) else end.reported

    def most_behind(one: Hypothesis) -> float:
        return float(behind(one).max())

    def behind(one: Hypothesis) -> FloatArray:
        each = [squares_of(other) for other in rivals]
        return np.asarray(np.max([_behind(problem, squares_of(one), e) for e in each], axis=0))

    def squares_of(h: Hypothesis) -> FloatArray:
        return own if h is end else h.reported

    joined = []
    for fit in () if end.swings else plain:
        worse = _judged_outputs(problem)[_behind(problem, own, fit.reported) > _AS_GOOD]
        there = tuple(effect for effect in fit.effects if effect.where in worse)
        sets = (there, fit.effects) if worse.size else ()
        joined += [_joined(problem, end, fit, added) for added in sets]
    longer = (effects for effects in joined if len(effects) > len(end.effects))
    fits = (trials.of(effects) for effects in longer)
    beside = (without_idle(trials, both) for both in fits if both is not None)
    for one in chain([end], beside):
        rivals.append(one)
        if most_behind(one) <= _AS_GOOD:
            return one
    least = min(rivals, key=most_behind)
    return least if least.swings else _without_harm(trials, least, behind)


def _without_harm(
    trials: Trials, h: Hypothesis, behind: Callable[[Hypothesis], FloatArray]
) -> Hypothesis:
    """Return a model without the causes that harm a joint at which it is behind another.

    On a recorded arm load friction and torque constants, added at all joints, paid at five of them
    and left 1.04 times as much at the last one.
    """
    ratios = behind(h)
    worst = str(_judged_outputs(trials.problem)[int(ratios.argmax())])
    for effect in h.effects if ratios.max() > _AS_GOOD else ():
        fewer = trials.of(without(h.effects, effect), h) if effect.where == worst else None
        if fewer is not None and behind(ended := trials.ended(fewer)).max() < ratios.max():
            return _without_harm(trials, ended, behind)
    return h


def _judged_outputs(problem: EstimationProblem) -> NDArray[np.str_]:
    return np.array(output_names(problem.records[0].robot))[problem.floor.judged]


def _joined(
    problem: EstimationProblem, one: Hypothesis, other: Hypothesis, added: Sequence[Effect]
) -> tuple[Effect, ...]:
    """Return the causes of one, and some of the other, as a fit of all of them begins.

    At each joint those of the one that leaves less there have their numbers, the rest begins with
    none: else one torque would be explained twice. On a recorded leg friction and load friction of
    a calf did that, and the fit of all left 1.3 times what one of the two left alone.
    """
    robot, judged = problem.robot, _judged_outputs(problem).tolist()
    ahead = dict(zip(judged, one.outputs <= other.outputs, strict=True))
    mine, theirs = ({effect.key: effect for effect in own} for own in (one.effects, added))

    def begun(effect: Effect) -> Effect:
        where = effect.where
        joint = robot.model.names[robot.body_joint(where)] if where in robot.bodies else where
        best = mine if ahead.get(joint, one.error <= other.error) else theirs
        null = effect.null_values(robot, where)
        return best.get(effect.key) or effect.with_values(null)

    return tuple(begun(effect) for effect in {**mine, **theirs}.values())


def _doubting(trials: Trials, h: Hypothesis, names: Answer) -> Answer:
    """Return the answer with a model that holds more causes than those that are named.

    What came in for its torque is at most as probable as not, and not more than it is beside all
    others: no hypothesis that lacks one of them was tried.
    """
    each = [(np.inf, 0.0)] * len(h.effects)
    if not h.swings:
        each = losses(trials.problem, trials.fit(h), h, [(effect,) for effect in h.effects])
    alone = (EVEN * float(expit(loss - gain)) for loss, gain in each)
    pairs = zip(h.keys, alone, strict=True)
    support = {key: Support(own, own, 0.0, 0.0, explained=True) for key, own in pairs}
    return replace(
        names,
        hypothesis=h,
        odds=odds_of(trials, h),
        level=attainable(trials.problem, trials.fit(h)),
        support=support | names.support,
        rivals=dict.fromkeys(h.keys, ()) | names.rivals,
    )


def _behind(problem: EstimationProblem, mine: FloatArray, theirs: FloatArray) -> FloatArray:
    """Return (outputs,) ratios of two models' errors, less a standard error of the first.

    Args:
        problem: the logs.
        mine, theirs: (B, outputs) mean squares of blocks.
    """
    beside = np.maximum(theirs.mean(axis=0), problem.indistinct)
    ratio = np.maximum(mine.mean(axis=0) - sem(mine - theirs), 0.0) / np.maximum(beside, 1e-300)
    return np.asarray(np.sqrt(ratio))
