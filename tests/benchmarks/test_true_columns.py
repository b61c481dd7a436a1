"""Logs whose columns are right: strange physics is no wrong column."""

from __future__ import annotations

import pytest

from benchmarks.corpus.draw import draw_case
from benchmarks.corpus.record import record_cases
from benchmarks.corpus.trial import logs_of, robot_of
from wbc.measurement import find_suspicions

# One joint moves, under a payload; a knee pushes with another joint's speed, more than it carries;
# a body in free fall moves its joints little. Each was refused for a mistake that nobody had made.
REFUSED = (122, 137, 532)


@pytest.fixture(scope="module")
def recorded() -> dict[int, list[dict]]:
    cases = [draw_case(number, 23) for number in REFUSED]
    tables = record_cases([(case, case.excitations) for case in cases])
    return dict(zip(REFUSED, tables, strict=True))


@pytest.mark.parametrize("number", REFUSED)
def test_strange_physics_is_no_wrong_column(number: int, recorded: dict[int, list[dict]]) -> None:
    robot = robot_of(draw_case(number, 23))
    found = find_suspicions(logs_of(recorded[number]), robot)
    assert [f.text for own in found for f in own if f.severity == "error"] == []
