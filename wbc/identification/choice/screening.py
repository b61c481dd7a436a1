"""Every single cause as columns beside a fitted model, ready for a search."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence

from wbc.identification.choice.candidate_columns import Atom, Shelf, evidence, make_atoms
from wbc.identification.choice.linear_screen import BeamSearch
from wbc.identification.model.fit import Fit
from wbc.identification.model.problem import Problem
from wbc.identification.model.yielding import deflects
from wbc.robot import Effect, Robot

Nearby = tuple[Robot, Shelf]
"""A robot close to those whose causes are sought, and the columns made of it so far."""

Swinging = dict[type[Effect], list[Atom]]
"""What was simulated beside one model."""

_WIDTH = 40  # sets kept


def screen(
    problem: Problem,
    fit: Fit,
    offered: Sequence[type[Effect]],
    taken: Collection[tuple[str, str]],
    simulated: Swinging,
    near: Nearby | None = None,
    failures: Counter[str] | None = None,
) -> tuple[BeamSearch, list[Atom]]:
    """Return the search over single additions, with the present parameters free to move.

    Args:
        problem: the logs.
        fit: the model that causes are added to.
        offered: effect classes.
        taken: names and places that are not offered.
        simulated: links that swing beside this model; new ones are put there.
        near: whose columns stand for those of effects that act at once.
        failures: errors inside effects are counted there.
    """
    known = evidence(fit.robot, problem.records)
    new = [c for c in offered if deflects(c) and c not in simulated]
    swings = make_atoms(fit.robot, problem.records, new, known, None, failures)
    simulated |= {c: [atom for atom in swings if atom.effect is c] for c in new}
    robot, columns = near or (fit.robot, {})
    direct = [c for c in offered if not deflects(c)]
    atoms = make_atoms(robot, problem.records, direct, known, columns, failures)
    atoms += [atom for c in offered if deflects(c) for atom in simulated[c]]
    order = {c: rank for rank, c in enumerate(offered)}
    kept = sorted((a for a in atoms if a.key not in taken), key=lambda a: order[a.effect])
    noise = problem.row_noise(fit.residual)
    return BeamSearch(fit, kept, problem.whitening, problem.folds, _WIDTH, noise), kept
