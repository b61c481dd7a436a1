"""Gears that yield: flanks of a coarse grid are simulated, and the best are fitted."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import astuple, replace
from itertools import product

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects.gear_losses import JointCompliance, Side, YieldingGear
from wbc.identification.choice.evidence import LEAST_ASKED, Offer
from wbc.identification.choice.trials import Trials
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.fit import Fit
from wbc.identification.model.residual import IMPOSSIBLE, evaluate, link_response, rubbing_response
from wbc.identification.model.yielding import deflects, plays
from wbc.identification.records.record import Record, by_log
from wbc.links import LinkResponse, deflections
from wbc.robot import Robot
from wbc.transmission import Flanks

# Of stiffness, damping and play: what is tried around the best of what was tried before.
_Factors = tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]

_SWINGS = np.geomspace(2.0, 70.0, 22)  # [Hz] of a link behind a spring ...
_DAMPING = (0.02, 0.1, 0.4)  # ... that is damped by these shares of the critical one
_NEAR_SPRINGS: tuple[_Factors, ...] = (
    ((0.8, 0.87, 0.93, 1.0, 1.07, 1.15, 1.25), (0.4, 1.0), (1.0,)),
)
_PLAYS = np.geomspace(5e-4, 0.12, 16)  # [rad] ...
_FLANK, _FLANK_DAMPING = 30.0, 0.3  # ... between flanks of this frequency [Hz] and damping
_NEAR_PLAYS: tuple[_Factors, ...] = (
    ((0.25, 1.0, 4.0), (0.3, 1.0, 3.0), (1.0,)),
    ((0.4, 1.0, 2.5), (1.0,), (0.83, 1.0, 1.2)),
)
_COARSE = (0.004, 0.006, 0.009, 0.014, 0.02, 0.03, 0.045)  # [rad], where two gears are tried ...
_COARSE_FLANK, _COARSE_SWINGS = 25.0, (3.5, 7.0, 14.0)  # ... and their frequencies [Hz]
_PAIRED = 0.8  # of the squares, that one or two gears of a grid must leave at most ...
_ALONE = 0.5  # ... and one that stands for known causes, which leave ...
_KNOWN = 0.0016  # ... this share at most
# Share of what is unexplained that the best of a grid leaves, above which none is fitted: the play
# of the practice leg leaves 0.83 on the coarse grid, gears of robots without one 0.99 or more.
_HOPELESS = 0.9
_FOLLOWED = 3  # of a grid, that are followed fully
_OFFERS = 6  # gears that are fitted for one addition
# [s] of a log on which they are ranked: 5 s led a recorded arm into a soft gear, and into minutes.
_SCREENED = 10.0
_ROUGHLY = 5.0  # times what the best of them leaves, from which on one cannot catch up
_SOFTEST = next(p.low for p in JointCompliance.parameters if p.name == "stiffness")
_COUNT = 2  # gears offered per joint, kind and side of friction
_JOINTS, _JOINTS_OF_TWO = 4, 2  # with the largest residuals, at which gears are tried


def gears_beside(
    trials: Trials, fit: Fit, known: Fit, kinds: Sequence[type[YieldingGear]]
) -> list[Offer]:
    """Return the effects of a fit with a gear more, those that leave least first.

    They are ranked on the beginning of the log that leaves most, and fitted to all. A gear must
    explain a share of what is left beside all that is known, half of it where that is nearly all.
    None is tried where even leaving noise alone would not pay for one.

    Args:
        trials: on the logs.
        fit: of the effects.
        known: that explains most so far.
        kinds: gears that may be used.

    Raises:
        OutOfTime: there is none for all of them.
    """
    problem = trials.problem
    offers: list[tuple[float, Offer]] = []
    record, rows = _loudest(problem)
    taken = {effect.where for effect in fit.effects if deflects(effect)}
    left = np.mean(fit.residual**2, axis=0)
    if _to_gain(problem, fit, left) < LEAST_ASKED:
        return []
    for joint, output in _loudest_joints(problem, left)[:_JOINTS]:
        if joint in taken:
            continue
        floor = float(problem.floor.values[output]) ** 2
        for side, whole_log in _by_side(fit.robot, joint, record).items():
            response = whole_log.beginning(_SCREENED)
            count = len(response.rows)
            noise = float(fit.residual[rows][:count].size)
            before, rival = (
                max(float(np.sum(one.residual[rows][:count] ** 2)) - noise, 0.0)
                for one in (fit, known)
            )
            # Where little is known, the best of a coarse grid of plays may still leave more.
            sought = fit is not known or not known.effects
            most = (_HOPELESS if sought else _PAIRED) * before
            most = _ALONE * before if rival < _KNOWN * before else most
            whole = _squares(response)
            for kind in kinds:
                for unexplained, flanks in best_gears(response, kind.has_play, _COUNT, trials.ask):
                    rest = max(before + float(unexplained - whole) / floor, 0.0)
                    if rest <= most:
                        gear = kind.having(joint, flanks).with_friction_at(side)
                        offers.append((rest + noise, (*fit.effects, gear)))
    offers.sort(key=lambda pair: pair[0])
    return [offer for rest, offer in offers[:_OFFERS] if rest <= _ROUGHLY * offers[0][0]]


def _to_gain(problem: EstimationProblem, fit: Fit, left: FloatArray) -> float:
    """Return the log density [nats] that a fit lacks, which leaves (outputs,), if all was noise."""
    samples = len(fit.residual) * problem.independent_samples(fit.residual)
    return float(0.5 * samples @ np.log(np.maximum(left, 1.0)))


def two_gears(trials: Trials, kinds: Sequence[type[YieldingGear]]) -> list[Offer]:
    """Return two gears that yield at once, at least one of them loose: the best of every way first.

    Two links that move behind their gears shake one another, so that alone none of them explains
    what both do: they are simulated together, on the log that leaves most. Empty where they
    promise little.

    Args:
        trials: on the logs.
        kinds: gears that may be used.

    Raises:
        OutOfTime: there is none for all of them.
    """
    problem = trials.problem
    record, _ = _loudest(problem)
    joints = _loudest_joints(problem, problem.first)[:_JOINTS_OF_TWO]
    links = [link_response(problem.robot, record, joint) for joint, _ in joints]
    floors = np.array([problem.floor.values[output] for _, output in joints])
    ways: dict[tuple[type[YieldingGear], ...], list[tuple[float, Offer]]] = {}
    for pair in product(*(_coarse(link, kinds) for link in links)):
        way = tuple(kind for kind, _ in pair)
        if len(pair) == _JOINTS_OF_TWO and any(kind.has_play for kind in way):
            trials.ask()
            left = _left(links, [flanks for _, flanks in pair], rough=True)
            places = zip(pair, joints, strict=True)
            offer = tuple(kind.having(joint, flanks) for (kind, flanks), (joint, _) in places)
            ways.setdefault(way, []).append((float(np.sum(left / floors**2)), offer))
    nothing, best = _cost(trials, record, ()), []
    for ranked in ways.values():
        ranked.sort(key=lambda pair: pair[0])
        known = [(_cost(trials, record, offer), offer) for _, offer in ranked[:_FOLLOWED]]
        best.append(min(known, key=lambda pair: pair[0]))
    best.sort(key=lambda pair: pair[0])
    return [offer for left, offer in best if left < _PAIRED * nothing]


def _cost(trials: Trials, record: Record, effects: Offer) -> float:
    """Return the squares that effects leave of one log, infinite where they are impossible."""
    trials.ask()
    problem = trials.problem
    try:
        return evaluate(problem.robot, effects, [record], problem.whitening).cost
    except IMPOSSIBLE:
        return np.inf


def best_gears(
    response: LinkResponse,
    has_play: bool,
    count: int,
    ask: Callable[[], None] = lambda: None,
) -> list[tuple[float, Flanks]]:
    """Return what flanks leave unexplained, and them: the `count` that leave least, best first.

    A lightly damped swing keeps its phase for long, and a strike its time: around the best of a
    grid more are tried. Grids are followed roughly; the best of each as well as it can be.
    A link without inertia about the joint (a point on its axis) swings behind nothing: the list is
    empty. So it is where no link stays behind a gear.

    Args:
        response: of the joint, along a log.
        has_play: whether flanks with play are sought.
        count: how many to return.
        ask: called before each is tried; what it raises ends the grid.
    """
    inertia = response.inertia[:, response.row]
    if inertia.min() <= 0.0:
        return []
    typical = float(np.mean(inertia))
    load = float(np.abs(response.load[:, response.row]).max())
    if has_play:
        flank = _swinging(typical, _FLANK, _FLANK_DAMPING)
        tried = [replace(flank, play=float(play)) for play in _PLAYS]
    else:
        tried = [_swinging(typical, *pair) for pair in product(_SWINGS, _DAMPING)]
    roughly: dict[Flanks, float] = {}
    fully: dict[Flanks, float] = {}

    def left(gear: Flanks, rough: bool) -> float:
        ask()
        return float(_left([response], [gear], rough)[0])

    def try_all(gears: Sequence[Flanks]) -> list[Flanks]:
        """Return the best, followed fully, of all that were tried."""
        new = [g for g in gears if g not in roughly and plays(g, load) == has_play]
        roughly.update((g, left(g, rough=True)) for g in new if g.stiffness >= _SOFTEST)
        best = sorted(roughly, key=lambda gear: roughly[gear])[:_FOLLOWED]
        fully.update((gear, left(gear, rough=False)) for gear in best if gear not in fully)
        return sorted(fully, key=lambda gear: fully[gear])

    best = try_all(tried)
    whole = _squares(response)
    for factors in _NEAR_PLAYS if has_play else _NEAR_SPRINGS:
        if best and fully[best[0]] < _HOPELESS * whole:
            pairs = product(best[:_COUNT], product(*factors))
            near = [Flanks(*np.multiply(astuple(gear), few).tolist()) for gear, few in pairs]
            best = try_all(near)
    return [(fully[gear], gear) for gear in best if np.isfinite(fully[gear])][:count]


def _left(links: Sequence[LinkResponse], gears: Sequence[Flanks], rough: bool) -> FloatArray:
    """Return the squares (n,) that gears of n links leave in a log, infinite where one flies off.

    Args:
        links: along the log.
        gears: in front of them.
        rough: as in `deflections`.
    """
    bent = deflections(links, gears, rough=rough)
    if not bent.finite:
        return np.full(len(links), np.inf)
    torque = np.sum([r.torque(path) for r, path in zip(links, bent.paths, strict=True)], axis=0)
    return np.array([_squares(response, torque[:, response.row]) for response in links])


def _squares(response: LinkResponse, torque: float | FloatArray = 0.0) -> float:
    return float(np.sum(response.left(np.broadcast_to(torque, len(response.load))) ** 2))


def _by_side(robot: Robot, joint: str, record: Record) -> dict[Side, LinkResponse]:
    """Return the sides on which the friction known at a joint may rub, with the link's response.

    It is that of a link without friction where it rubs at the motor.
    """
    plain = link_response(robot, record, joint)
    rubbing = rubbing_response(robot, record, joint)
    return {"either": plain} if rubbing is None else {"motor": plain, "link": rubbing}


def _loudest(problem: EstimationProblem) -> tuple[Record, slice]:
    """Return the log with the largest residual, on which much can be tried in little time.

    With it its rows of all.
    """
    squares = by_log(problem.records, (problem.residual @ problem.whitening) ** 2)
    most = int(np.argmax([part.sum() for part in squares]))
    first = sum(record.rows for record in problem.records[:most])
    return problem.records[most], slice(first, first + len(squares[most]))


def _loudest_joints(problem: EstimationProblem, left: FloatArray) -> list[tuple[str, int]]:
    """Return the judged joints with their outputs, by what (judged outputs,) is left there."""
    joints = problem.robot.transmission.joints
    judged = [k for k in problem.floor.judged.tolist() if k < len(joints)]
    order = np.argsort(-left[: len(judged)])
    return [(joints[judged[k]], judged[k]) for k in order]


def _coarse(
    link: LinkResponse, kinds: Sequence[type[YieldingGear]]
) -> list[tuple[type[YieldingGear], Flanks]]:
    """Return the gears to try in front of one of two links: their flanks go by what it weighs."""
    inertia = float(np.mean(link.inertia[:, link.row]))
    if inertia <= 0.0:
        return []
    swings = [_swinging(inertia, f, _FLANK_DAMPING) for f in _COARSE_SWINGS]
    flank = _swinging(inertia, _COARSE_FLANK, _FLANK_DAMPING)
    bounces = [replace(flank, play=play) for play in _COARSE]
    offers = [(kind, f) for kind in kinds for f in (bounces if kind.has_play else swings)]
    # Behind a light wrist a gear that swings so slowly is softer than any.
    return [(kind, f) for kind, f in offers if f.stiffness >= _SOFTEST]


def _swinging(inertia: float, frequency: float, damping: float) -> Flanks:
    """Return a spring behind which an inertia [kg m^2] swings at a frequency [Hz]."""
    rate = 2.0 * np.pi * frequency
    return Flanks(float(inertia * rate**2), float(2.0 * damping * inertia * rate))
