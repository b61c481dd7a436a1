from __future__ import annotations

import pytest

from benchmarks.servo_candidates import CANDIDATES, RIVALS, SPANS, servo
from wbc.effects import load_robot


@pytest.mark.parametrize("name", [*CANDIDATES, *RIVALS])
def test_every_candidate_builds_at_its_starts(name: str) -> None:
    numbers = {key: SPANS[key].start for key in (CANDIDATES | RIVALS)[name]}
    robot, drive = servo(load_robot("xl330_pendulum"), numbers)
    assert robot.transmission.resistance[0] == numbers["resistance"]
    assert drive.source_resistance == numbers.get("source_resistance", 0.0)
    assert ("stribeck_friction" in {e.name for e in robot.effects}) == ("stribeck" in numbers)
