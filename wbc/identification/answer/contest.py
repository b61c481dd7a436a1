"""Several robots on the same logs: which is nearest, and whether the others can be told from it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import IdentificationError
from wbc.files import as_json
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.residual import condensed_residual
from wbc.identification.records.folds import block_means
from wbc.measurement import Log
from wbc.robot import Robot

_STANDARD_ERRORS = 2.0


@dataclass(frozen=True)
class Contestant:
    """One robot beside the best one.

    Attributes:
        name: as given.
        rank: 1 for the smallest error.
        error: root mean square of all outputs in noise floors.
        difference: mean square minus that of the best robot [floors^2].
        deviation: standard error of the difference, blocks of the logs being the observations.
        parameters: how many numbers its effects hold; more are believed less easily.
        standing: `best`, `worse`, or `not distinguishable` from the best.
        warnings: effects with a number at its bound.
    """

    name: str
    rank: int
    error: float
    difference: float
    deviation: float
    parameters: int
    standing: str
    warnings: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Return plain texts and numbers."""
        return dict(as_json(self))


def rank_robots(robots: Mapping[str, Robot], logs: Sequence[Log]) -> tuple[Contestant, ...]:
    """Return robots by their error on logs, best first; nothing is fitted.

    All are judged in the same band, by the same weights and the noise floor of the first one. Where
    drives follow targets, the times that the first of them states are those of all. The comparison
    is fair only on logs that none of them was fitted to.

    Args:
        robots: by name; they have the same joints in the same order.
        logs: of one machine.

    Raises:
        IdentificationError: no robot, or robots with different joints.
        LogError: a channel is missing.
    """
    if not robots:
        raise IdentificationError("no robot was given to rank.")
    first, *others = robots.items()
    for name, robot in others:
        if robot.model.names.tolist() != first[1].model.names.tolist():
            raise IdentificationError(
                f"'{name}' and '{first[0]}' have different joints and cannot be compared: "
                f"{', '.join(robot.model.names)} and {', '.join(first[1].model.names)}."
            )
    reference = first[1]
    drives = [robot.transmission for robot in robots.values()]
    if known := [gears for gears in drives if np.isfinite(gears.target_delay).any()]:
        times = known[0].target_delay, known[0].velocity_lag
        reference = reference.with_drive_times(*times)
    problem = EstimationProblem.from_logs(reference, logs)
    squares = {name: _squares(problem, robot) for name, robot in robots.items()}
    order = sorted(squares, key=lambda name: float(squares[name].mean()))
    return tuple(
        _beside(problem, name, robots[name], rank, squares, order[0])
        for rank, name in enumerate(order, start=1)
    )


def _squares(problem: EstimationProblem, robot: Robot) -> FloatArray:
    records = [record.believing(robot) for record in problem.records]
    return np.asarray((condensed_residual(robot, records) @ problem.whitening) ** 2)


def _beside(
    problem: EstimationProblem,
    name: str,
    robot: Robot,
    rank: int,
    squares: Mapping[str, FloatArray],
    best: str,
) -> Contestant:
    own, beside = squares[name], squares[best]
    blocks = block_means((own - beside).mean(axis=1), problem.blocks)
    deviation = float(np.std(blocks, ddof=1) / np.sqrt(blocks.size))
    difference = float(own.mean() - beside.mean())
    clear = difference > _STANDARD_ERRORS * deviation
    standing = "best" if name == best else "worse" if clear else "not distinguishable"
    at_bound = tuple(
        f"{p.name} of {effect.name} at {effect.where} is at its bound"
        for effect in robot.effects
        for p in effect.parameters
        if effect.values[p.name] in (p.low, p.high) and effect.values[p.name] != p.null
    )
    return Contestant(
        name=name,
        rank=rank,
        error=float(np.sqrt(own.mean())),
        difference=difference,
        deviation=deviation,
        parameters=sum(effect.search.freedom(effect) for effect in robot.effects),
        standing=standing,
        warnings=at_bound,
    )
