"""The open-loop error: a robot simulated from measured states, held beside the log."""

import json
from pathlib import Path

import numpy as np

from tests.conftest import Told
from tests.moved import STEP, moved, servo, servo_log
from wbc.effects import CoulombFriction, TransmissionEfficiency, load_robot
from wbc.identification.open_loop import HORIZONS, open_loop
from wbc.identification.readings import with_machine
from wbc.measurement import Log
from wbc.samples import sample_logs, sample_paths


def swung(payload: float = 0.0) -> Log:
    """Return targets and positions of a servo as another integrator moves it."""
    time = np.arange(0.0, 8.0, STEP)
    goal = 1.2 * np.sin(1.5 * time) + 0.3 * np.sin(4.1 * time)
    return servo_log(servo(payload=payload), goal)


def test_the_robot_with_its_losses_stays_with_the_log_and_one_without_leaves_it() -> None:
    leg = load_robot("planar_leg_fixed").lossless()
    true = leg.with_effects(TransmissionEfficiency("knee", 0.8, 0.75), CoulombFriction("hip", 0.5))
    right, wrong = open_loop(true, sample_logs()), open_loop(leg, sample_logs())
    assert right.horizons == HORIZONS
    assert right.starts == (12, 12, 12)
    # Sensor noise alone moves the start; a horizon of 0.1 s already shows the losses.
    assert np.all(right.error < 0.02 * right.moved)
    assert np.all(wrong.error > 5.0 * right.error)


def test_a_drive_with_a_target_sees_the_simulated_motion() -> None:
    found = open_loop(servo(), [swung()])
    assert found.reason == ""
    assert np.all(found.error < 2e-3)
    assert np.all(found.moved > 0.05)
    # With the torque that the drive made along the log a heavier arm would fall; held by its
    # drive it misses by the sag of the position loop alone.
    assert 5e-3 < open_loop(servo(payload=0.1), [swung()]).error[0, -1] < 0.2


def test_rows_are_read_along_lines_between_them() -> None:
    """Rows that held until the next one made torques late by half of that time."""
    leg, time = load_robot("planar_leg_fixed").lossless(), np.arange(0.0, 8.0, 0.02)
    waves = np.random.default_rng(0).uniform((0.1, 0.5, 0.0), (0.3, 3.0, 6.0), (2, 3, 3))
    found = open_loop(leg, [moved(leg, time, waves, noise=(0.0, 0.0, 0.0))], [0.1])
    assert np.all(found.error < 2e-3 * found.moved)


def test_a_log_is_simulated_with_its_own_load() -> None:
    log = with_machine(swung(payload=0.2), servo(), servo(payload=0.2))
    assert np.all(open_loop(servo(), [log]).error < 2e-3)
    assert open_loop(servo(), [swung(payload=0.2)]).error[0, -1] > 0.02


def test_what_cannot_be_simulated_says_why() -> None:
    robot, time = load_robot("planar_leg"), np.arange(800) / 200.0
    columns = {f"{name}.position": np.sin(2.2 * time) for name in robot.single_joints}
    columns |= {f"{name}.rotor_torque": 1.0 + 0.0 * time for name in robot.transmission.joints}
    floating = Log(time, columns | {"foot.active": 1.0 + 0.0 * time})
    found = open_loop(robot, [floating])
    assert "forces at foot were not recorded" in found.reason
    assert np.isnan(found.error).all()
    assert found.to_json()["joints"]["hip"]["error"] == [None, None, None]
    forces = {"foot.force.x": 0.0 * time, "foot.force.z": 250.0 + 0.0 * time}
    assert open_loop(robot, [Log(time, columns | forces)]).reason == ""  # none along y


def test_a_short_log_leaves_the_long_horizon_open() -> None:
    found = open_loop(servo(), [swung()[:375]])
    assert np.isfinite(found.error[0, :2]).all()
    assert np.isnan(found.error[0, 2])
    assert found.starts[2] == 0


def test_the_command_prints_and_writes_it(tmp_path: Path, told: Told) -> None:
    command, result = "diagnose --robot planar_leg_fixed --lossless", tmp_path / "result.json"
    told(*command.split(), "--add", "transmission_efficiency", "--json", result, *sample_paths())
    found = json.loads(result.read_text())["open_loop"]
    before, after = (found[key]["joints"]["knee"]["error"] for key in ("before", "after"))
    assert after[1] < 0.5 * before[1]
