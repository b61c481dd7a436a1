"""What a user of a step should know, found in its stages."""

from __future__ import annotations

from wbc.compiled import Dense, OutDense, Row, ask, compiled, inner
from wbc.mechanics.linear import copy_to
from wbc.sim.step.books import MADE, survey
from wbc.sim.step.solution import MISSED
from wbc.sim.step.tables import BOOK, LENGTH, TOUCH, Opened

ENERGY, COARSE, TAKEN_BACK, UNSETTLED, OVERLAP, SUNK = range(6)
"""Kinds of events, see `StepEvent`; of those that are coarse, in TAKEN_BACK speeds were changed."""

_ROUNDING = 1e-8  # of the energy in play: laws hold to 1e-10 of the speeds
_COARSE = 0.01  # share of the energy in play


@inner
def survey_of(plant: Opened, stage: Row) -> tuple[float, float, int]:
    """Return what `survey` finds where a stage starts; the memory holds the stage then."""
    now = plant.now
    copy_to(stage[: len(now.words)], now.words)
    copy_to(stage[len(now.words) :], plant.end.words)
    if plant.forces.asked != 0:
        length, now.numbers[LENGTH] = now.numbers[LENGTH], 0.0
        ask(plant.forces.asked)
        now.numbers[LENGTH] = length
    return survey(plant, now.position, now.velocity, now.deflection, now.motor_speed)


@inner
def tell(told: OutDense, count: int, kind: int, stage: int, size: float, what: float) -> int:
    """Write an event; return how many there are then."""
    told[count, 0], told[count, 1], told[count, 2], told[count, 3] = kind, stage, size, what
    return count + 1


@compiled
def find_events(plant: Opened, stages: Dense, flow: Row, told: OutDense) -> int:
    """Write what there is to tell of a step; return how many events.

    Args:
        plant: whose memory is free.
        stages: (s + 1, w) of the step.
        flow: (13,) work and losses, with those of effects that Python evaluates; empty without.
        told: (3 s + 2, 4) to write: kind, stage, size, and what it is about.
    """
    count, last, most, taken, depth = 0, len(stages) - 1, 0.0, 0.0, 0.0
    had, _, _ = survey_of(plant, stages[0])
    books, end = plant.end.books, plant.end
    for stage in range(last):
        copy_to(stages[stage, len(plant.now.words) :], end.words)
        if stages[stage, LENGTH] > 0.0:
            depth = end.deepest[0]
            if depth > 0.0:
                count = tell(told, count, OVERLAP, stage, depth, end.deepest[1])
        made, cause = books[BOOK.normal], BOOK.normal
        for i in range(BOOK.mesh, BOOK.impact + 1):
            if -books[i] > made:
                made, cause = -books[i], i
        if made > _ROUNDING * (books[BOOK.kinetic] + books[BOOK.traffic]) + 1e-12:
            count = tell(told, count, ENERGY, stage, made, cause)
        if end.work[MISSED] > 0.0:
            count = tell(told, count, UNSETTLED, stage, end.work[MISSED], 0.0)
        most, taken = max(most, books[BOOK.kinetic]), taken + books[BOOK.taken]
    has, gap, lowest = survey_of(plant, stages[last])
    # Contacts may be as deep as a step leaves them.
    hovers = len(plant.placed.bases) > 0 and len(plant.obstacles.contacts) > 0
    if hovers and gap < -max(TOUCH, depth):
        count = tell(told, count, SUNK, last - 1, -gap, lowest)
    work, lost, all_of = 0.0, 0.0, flow if len(flow) else plant.now.flow
    for i in range(BOOK.bent):
        work += all_of[i]
    for i in range(BOOK.mesh, BOOK.impact + 1):
        lost += all_of[i]
    play, gain = most + abs(work) + lost, has - had + all_of[BOOK.bent] + lost - work
    if taken > 0.0 or gain > min(_COARSE * play, MADE * play + lost) + 1e-9:
        kind = TAKEN_BACK if taken > 0.0 else COARSE
        count = tell(told, count, kind, last - 1, max(gain, taken), play)
    return count
