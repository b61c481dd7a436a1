from __future__ import annotations

import numpy as np
import pytest

from benchmarks.servo_candidates import CANDIDATES, RIVALS, SPANS, WEIGHT, LoadStribeck, servo
from wbc.effects import CoulombFriction, load_robot
from wbc.robot import Motion
from wbc.robot.dc_drive import DcDrive
from wbc.sim.servo_rollout import servo_rollout
from wbc.sim.servo_run import ServoRun


def test_friction_under_load_is_a_share_of_the_weight_and_fades_with_speed() -> None:
    robot, effect = load_robot("xl330_pendulum"), LoadStribeck("shaft", 0.3, 0.5)
    motion = Motion(np.array([[0.5], [-0.5], [0.5], [0.0]]), np.array([[0.0], [0.0], [0.5], [0.0]]))
    full = 0.3 * WEIGHT * np.sin(0.5)
    level = effect.joint_friction(robot, motion)[:, 0]
    np.testing.assert_allclose(level, [full, full, full / np.e, 0.0], rtol=1e-12)


def test_what_holds_a_resting_arm_lets_a_moving_one_pass() -> None:
    # Coulomb friction alone is too little to hold the arm, and so is what grows with the load.
    def final(share: float, coulomb: float, enabled: float) -> float:
        robot = load_robot("xl330_pendulum").with_effects(
            CoulombFriction("shaft", coulomb), LoadStribeck("shaft", share, 0.05)
        )
        run = ServoRun("", 2.0, np.zeros(200), np.full(200, enabled), np.full(200, 0.4))
        return float(servo_rollout([(robot, DcDrive(7.4))], [run], 0.005)[-1, 0, 0])

    assert final(0.9, 0.03, 0.0) == 0.4
    assert final(0.9, 0.0, 0.0) < 0.2
    assert final(0.0, 0.03, 0.0) < 0.2
    assert abs(final(0.9, 0.03, 1.0)) < 0.05


@pytest.mark.parametrize("name", [*CANDIDATES, *RIVALS])
def test_every_candidate_builds_at_its_starts(name: str) -> None:
    numbers = {key: SPANS[key].start for key in (CANDIDATES | RIVALS)[name]}
    robot, drive = servo(load_robot("xl330_pendulum"), numbers)
    assert robot.transmission.resistance[0] == numbers["resistance"]
    assert drive.source_resistance == numbers.get("source_resistance", 0.0)
    assert ("stribeck_friction" in {e.name for e in robot.effects}) == ("stribeck" in numbers)
