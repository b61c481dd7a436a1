"""Every single cause as columns beside a fitted model, ready for a search."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from wbc.arrays import FloatArray
from wbc.identification.choice.screening.candidate_columns import (
    Regressor,
    Shelf,
    ShelfKey,
    alone_on,
    evidence,
    make_regressors,
    shelf_key,
)
from wbc.identification.choice.screening.linear_screen import LinearScreen
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.fit import Fit
from wbc.identification.model.yielding import deflects
from wbc.robot import Effect, Robot

Nearby = tuple[Robot, Shelf]
"""A robot close to those whose causes are sought, and the columns made of it so far."""

Swinging = dict[type[Effect], list[Regressor]]
"""What was simulated beside one model."""

_WHOLE = "robot"  # where effects sit that have no place


def screen(
    problem: EstimationProblem,
    fit: Fit,
    offered: Sequence[type[Effect]],
    taken: Collection[tuple[str, str]],
    simulated: Swinging,
    near: Nearby | None = None,
    failures: Counter[str] | None = None,
    common: Shelf | None = None,
) -> tuple[LinearScreen, list[Regressor]]:
    """Return the search over single additions, with the present parameters free to move.

    Args:
        problem: the logs.
        fit: the model that causes are added to.
        offered: effect classes.
        taken: names and places that are not offered.
        simulated: links that swing beside this model; new ones are put there.
        near: whose columns stand for those of effects that act at once.
        failures: errors inside effects are counted there.
        common: columns that do not depend on the model; new ones are put there.
    """
    known = evidence(fit.robot, problem.records)
    new = [c for c in offered if deflects(c) and c not in simulated]
    swings = make_regressors(fit.robot, problem.records, new, known, None, failures)
    simulated |= {c: [regressor for regressor in swings if regressor.effect is c] for c in new}
    robot, columns = near or (fit.robot, {})
    direct = [c for c in offered if not deflects(c)]
    shared = common if alone_on(robot, problem.robot) else None
    regressors = make_regressors(
        robot, problem.records, direct, known, columns, failures, common=shared
    )
    regressors += [regressor for c in offered if deflects(c) for regressor in simulated[c]]
    order = {c: rank for rank, c in enumerate(offered)}
    free = [
        regressor
        for regressor in regressors
        if regressor.key not in taken and not _drawn_twice(fit, regressor)
    ]
    free = [regressor for regressor in free if _felt(problem, regressor)]
    kept = sorted(free, key=lambda a: order[a.effect])
    noise = float(np.min(problem.row_noise(fit.residual)))  # of the output that says most
    return LinearScreen(fit, kept, problem.whitening, problem.folds, noise), kept


def screen_instead(
    problem: EstimationProblem,
    fit: Fit,
    offered: Sequence[type[Effect]],
    failures: Counter[str] | None = None,
    common: Shelf | None = None,
) -> tuple[LinearScreen, list[Regressor]]:
    """Return the search over what could stand in the place of causes of a model.

    One set of columns serves for all of them: what a small effect adds hardly depends on one cause
    more or less. Shapes that follow the data are those that show with all causes, and at the place
    of each cause those that show without it.

    Args:
        problem: the logs.
        fit: the model.
        offered: effect classes that act at once.
        failures: errors inside effects are counted there.
        common: columns that do not depend on the model; new ones are put there.
    """
    columns: Shelf = {}
    shared = common if alone_on(fit.robot, problem.robot) else None
    taken = {effect.key for effect in fit.effects}
    found: dict[ShelfKey, Regressor] = {}

    def make(robot: Robot, places: Sequence[str] | None) -> None:
        known = evidence(robot, problem.records)
        regressors = make_regressors(
            fit.robot, problem.records, offered, known, columns, failures, places, shared
        )
        for regressor in regressors:
            if regressor.key not in taken:
                found.setdefault(
                    shelf_key(regressor.effect, regressor.where, regressor.screen), regressor
                )

    make(fit.robot, None)
    for gone in fit.effects:
        rest = problem.robot.with_effects(*(e for e in fit.effects if e is not gone))
        make(rest, [gone.where])
    order = {c: rank for rank, c in enumerate(offered)}
    kept = sorted(found.values(), key=lambda regressor: order[regressor.effect])
    kept = [
        regressor
        for regressor in kept
        if not _drawn_twice(fit, regressor) and _felt(problem, regressor)
    ]
    noise = float(np.min(problem.row_noise(fit.residual)))
    return LinearScreen(fit, kept, problem.whitening, problem.folds, noise), kept


def screen_in_shares(
    problem: EstimationProblem, fit: Fit, regressors: Sequence[Regressor], share: FloatArray
) -> LinearScreen:
    """Return a search in which every output counts in a unit of its own.

    Args:
        problem: the logs.
        fit: the model that causes are added to.
        regressors: the causes.
        share: (judged outputs,) what one floor of each output counts.
    """
    scaled = replace(fit, residual=fit.residual * share, jacobian=fit.jacobian * share[:, None])
    noise = float(np.min(problem.row_noise(fit.residual) * share**2))
    whitening = problem.whitening * share
    return LinearScreen(scaled, regressors, whitening, problem.folds, noise)


def _felt(problem: EstimationProblem, regressor: Regressor) -> bool:
    """Whether an output that is judged feels a cause; those of drives set aside do not count."""
    return bool(problem.whitening[regressor.columns.outputs].any())


def _drawn_twice(fit: Fit, regressor: Regressor) -> bool:
    """Whether a drawing would be wrong once as a whole and once in one of its links."""
    places = {effect.where for effect in fit.effects if effect.search.departures(effect).size}
    return bool(places and regressor.usual.any()) and _WHOLE in {*places, regressor.where}
