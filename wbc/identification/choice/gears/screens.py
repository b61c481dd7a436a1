"""How gears that yield offer themselves beside a model: by what simulated links explain."""

from __future__ import annotations

from collections.abc import Sequence

from wbc.effects.gear.yielding_gear import Side, YieldingGear
from wbc.identification.choice.gears.plays import best_plays
from wbc.identification.choice.gears.springs import best_springs
from wbc.identification.model.residual import link_response, rubbing_responses
from wbc.identification.records.record import Record
from wbc.links import LinkResponse
from wbc.robot import Effect, Evidence, Robot, Screen

_COUNT = 2  # gears offered per joint and side of friction


def screens(
    kind: type[Effect], robot: Robot, where: str, known: Evidence, records: Sequence[Record]
) -> tuple[Screen, ...]:
    """Return the ways in which an effect may explain what a robot leaves of some logs."""
    if issubclass(kind, YieldingGear):
        return gear_screens(kind, robot, where, records)
    return kind.search.screens(kind, robot, where, known)


def gear_screens(
    kind: type[YieldingGear], robot: Robot, where: str, records: Sequence[Record]
) -> tuple[Screen, ...]:
    """Return the gears at a joint that explain most, for each side on which friction may rub."""
    best = best_plays if kind.has_play else best_springs
    found = []
    for side, responses in _by_side(robot, where, records):
        for flanks in best(responses, _COUNT):
            gear = kind.having(where, flanks)
            found.append(Screen.fixed(gear.values, friction_side=side))
    return tuple(found)


def _by_side(
    robot: Robot, joint: str, records: Sequence[Record]
) -> list[tuple[Side, tuple[LinkResponse, ...]]]:
    """Return the sides on which the friction known at a joint may rub, with the link's responses.

    They are those of a link without friction where it rubs at the motor.
    """
    plain = tuple(link_response(robot, record, joint) for record in records)
    rubbing = rubbing_responses(robot, records, joint)
    return [("motor", plain), ("link", rubbing)] if rubbing else [("either", plain)]
