"""What pages show of a log: averages and impacts."""

import numpy as np
import pytest

from wbc.measurement import Log
from wbc.robot import Robot
from wbc.view.channels import find_impacts, gear_flow, window_mean


def test_a_jump_stays_sharp_and_a_ramp_stays_a_ramp() -> None:
    ramp = np.arange(40.0)[:, None]
    signal = ramp + np.where(ramp < 17.0, 0.0, 100.0)
    np.testing.assert_allclose(window_mean(signal, 9, (17,)), signal, atol=1e-12)
    assert window_mean(signal, 9)[16, 0] > 30.0


def test_gear_speeds_jump_at_an_impact_of_a_log(leg: Robot, squat: Log) -> None:
    landing = int(np.argmax(squat.column("foot.force.z") > 0.0))
    moving = np.where(np.arange(len(squat)) < landing + 1, 0.0, 5.0)
    log = squat.with_columns({"knee.velocity": moving})
    np.testing.assert_allclose(gear_flow(leg, log).speed[:, 1], moving, atol=1e-12)


TIME = np.arange(0.0, 1.0, 1e-3)
WEIGHT = 100.0


def vertical(*pieces: tuple[float, float, float]) -> np.ndarray:
    force = np.zeros((len(TIME), 3))
    for start, stop, size in pieces:
        force[(start <= TIME) & (stop > TIME), 2] = size
    return force


SLOWLY = vertical()
SLOWLY[:, 2] = np.clip(TIME - 0.2, 0.0, 0.3) / 0.3 * 0.5 * WEIGHT
TWICE = ((0.1, 0.103, 30.0 * WEIGHT), (0.103, 0.5, WEIGHT), (0.6, 1.0, 1.2 * WEIGHT))
CHATTER = ((0.1, 0.11, 500.0), (0.112, 0.12, 400.0), (0.122, 1.0, WEIGHT))


@pytest.mark.parametrize(
    ("forces", "told"),
    [
        ({"it stands from the start": vertical((0.0, 1.0, WEIGHT))}, {}),
        ({"landings of any size": vertical(*TWICE)}, {0.1: 3000.0, 0.6: 120.0}),
        ({"chatter of a millisecond": vertical(*CHATTER)}, {0.1: 500.0}),
        ({"put down gently": SLOWLY, "other": vertical((0.0, 1.0, 0.5 * WEIGHT))}, {}),
    ],
)
def test_impacts_are_told_from_other_forces(
    forces: dict[str, np.ndarray], told: dict[float, float]
) -> None:
    found = {impact.time: impact.force for impact in find_impacts(TIME, forces, WEIGHT)}
    assert found == pytest.approx(told)
