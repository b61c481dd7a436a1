"""The steps of the search: add a cause, drop one, put another in its place, reorder a drive."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from wbc.identification.choice.proposals import Proposer
from wbc.identification.choice.weighing.drop_screen import losses
from wbc.identification.choice.weighing.hypothesis import Hypothesis, Key, without
from wbc.identification.model.yielding import deflects
from wbc.robot import Effect, Robot

_ADDED = 6  # offers that are fitted for one addition
_SWAPPED = 5  # ... in the place of one cause
_PAIRS = 6
# Times the prior's gain, that the derivatives may say a drop loses of the density and be wrong: of
# 172 drops on a recorded arm the true loss was 0.58 to 1.37 times the one they say.
_MISSED = 3.0


def additions(proposer: Proposer, h: Hypothesis, exclude: Sequence[Key] = ()) -> list[Hypothesis]:
    """Return hypotheses with a cause more, at one place or in all gears."""
    trials = proposer.trials
    longer = trials.all_of(proposer.beside(h, _ADDED, exclude))
    # Screens see a drive's causes only as the last to act.
    orders = [offer for one in longer for offer in reordered(one)]
    first = placed_first(h, proposer.candidates, trials.problem.robot)
    kept = [offer for offer in first if not {e.key for e in offer} & {*exclude}]
    return [*longer, *trials.all_of(orders), *trials.all_of(kept)]


def usual(proposer: Proposer, h: Hypothesis) -> list[Hypothesis]:
    """Return, from the robot as given, the hypothesis of all that machines usually have.

    Friction and rotor inertia in every joint are one fit. Found one by one they take a move each,
    and at every move what is still missing is imitated: in twelve joints under position control
    (recorded) the search did not end in 300 s, and torque constants stood for the friction and the
    inertia that it had not tried together. From here it ends in 80 s without them. A recorded
    six-axis arm keeps 1.1 instead of 4.2 N m at its first joint. Of 127 generated logs one
    has a false cause more and one a false cause less.
    """
    robot = proposer.trials.problem.robot
    kinds = [c for c in proposer.candidates if c.search.expected > 0.0 and c.search.one_fit]
    joints = set(robot.transmission.joints)
    offer = tuple(
        kind.at(where, kind.null_values(robot, where))
        for kind in kinds
        for where in kind.places(robot)
        if where in joints
    )
    return [] if h.effects or len(offer) < 2 else proposer.trials.all_of([offer])


def drops(proposer: Proposer, h: Hypothesis) -> list[Hypothesis]:
    """Return hypotheses without one of the causes, or without one name at all its places.

    Those alone are fitted of which the derivatives say that they may win, and one without all the
    causes that say too little.
    """
    trials = proposer.trials
    dropped: list[tuple[Effect, ...]] = [(effect,) for effect in h.effects]
    dropped += [_named(h, name) for name in _repeated(h)]
    # How links move behind gears that yield is no linear matter: without such a gear it is fitted.
    gears = [own for own in dropped if any(map(deflects, own))]
    dropped = [own for own in dropped if own not in gears]
    expected = losses(trials.problem, trials.fit(h), h, dropped)
    pairs = list(zip(dropped, expected, strict=True))
    idle = [own[0] for own, (loss, gain) in pairs if len(own) == 1 and loss < gain]
    dropped = [*gears, *(own for own, (loss, gain) in pairs if loss < _MISSED * gain)]
    dropped = [tuple(idle), *dropped] if len(idle) > 1 else dropped
    return trials.all_of(without(h.effects, *own) for own in dropped)


def swaps(proposer: Proposer, h: Hypothesis) -> Iterator[Hypothesis]:
    """Yield hypotheses with another cause in the place of one.

    What a small effect adds hardly depends on one cause more or less: all screens but those
    beside a link that swings share the columns of the whole hypothesis.
    """
    trials = proposer.trials
    for effect in h.effects:
        rest = trials.of(without(h.effects, effect))
        if rest is None:
            continue
        offers = proposer.instead(h, (effect,), rest, _SWAPPED, (effect.key,))
        if offers is None:
            near = None if deflects(effect) else proposer.near(h)
            offers = proposer.beside(rest, _SWAPPED, (effect.key,), h.error, near)
        yield from trials.rivals_of(h, offers)


def pairs(proposer: Proposer, h: Hypothesis) -> list[Hypothesis]:
    """Return hypotheses with two causes more that may hide one another."""
    return [] if h.swings else proposer.trials.all_of(proposer.pairs_beside(h, _PAIRS))


def _repeated(h: Hypothesis) -> list[str]:
    names = [effect.name for effect in h.effects]
    return [name for name in dict.fromkeys(names) if names.count(name) > 1]


def _named(h: Hypothesis, name: str) -> tuple[Effect, ...]:
    return tuple(effect for effect in h.effects if effect.name == name)


Offer = tuple[Effect, ...]


def reordered(h: Hypothesis) -> list[Offer]:
    """Return the effects with the last drive effect before others that act on the same motor.

    The order in which causes were found is no evidence of the order in which they act. Effects on
    other joints commute.
    """
    drives = [k for k, effect in enumerate(h.effects) if _drives(effect)]
    if not drives or drives[-1] != len(h.effects) - 1:
        return []
    *others, last = h.effects
    places = [k for k in drives[:-1] if _same_drive(others[k], last)]
    return [(*others[:k], last, *others[k:]) for k in places]


def placed_first(h: Hypothesis, candidates: Sequence[type[Effect]], robot: Robot) -> list[Offer]:
    """Return the effects with one drive effect more that acts before those there are.

    Beside a limit, what weakens a drive before it explains nothing where it acts behind it.

    Args:
        h: what one more is put to.
        candidates: effect classes that may be used.
        robot: without effects.
    """
    drives = [k for k, effect in enumerate(h.effects) if _drives(effect)]
    if not drives:
        return []
    offers = []
    for kind in candidates:
        if "drive" not in kind.acts_by:
            continue
        for where in kind.places(robot):
            if (kind.name, where) in h.keys:
                continue
            new = kind.at(where, kind.null_values(robot, where))
            k = next((k for k in drives if _same_drive(h.effects[k], new)), None)
            if k is not None:
                offers.append((*h.effects[:k], new, *h.effects[k:]))
    return offers


def _drives(effect: Effect) -> bool:
    return "drive" in effect.acts_by


def _same_drive(one: Effect, other: Effect) -> bool:
    """Whether both act on one motor; what acts on a joint is at its motor, the rest on all."""
    return one.where == other.where or "robot" in (one.where, other.where)
