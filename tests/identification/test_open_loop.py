"""The open-loop error: a robot simulated from measured states, held beside the log."""

from __future__ import annotations

import json

import numpy as np
import pytest

from wbc.cli import main
from wbc.effects import CoulombFriction, PayloadMass, TransmissionEfficiency, load_robot
from wbc.identification.open_loop import HORIZONS, open_loop
from wbc.identification.readings import with_machine
from wbc.measurement import Log, save_log
from wbc.robot import Robot
from wbc.robot.dc_drive import DcDrive
from wbc.samples import sample_logs
from wbc.sim.servo_rollout import servo_rollout
from wbc.sim.servo_run import ServoRun

GAIN, SUPPLY, STEP = 2.0, 7.4, 0.004


def servo(payload: float = 0.0) -> Robot:
    robot = load_robot("xl330_pendulum")
    if payload:
        robot = robot.with_effect(PayloadMass(robot.bodies[-1], mass=payload))
    gears = robot.transmission
    return robot.with_transmission(
        gears.replace(duty_gain=np.array([GAIN]), supply_voltage=np.array([SUPPLY]))
    )


def servo_log(payload: float = 0.0) -> Log:
    """Return targets and positions of a servo as another integrator moves it."""
    time = np.arange(0.0, 8.0, STEP)
    goal = 1.2 * np.sin(1.5 * time) + 0.3 * np.sin(4.1 * time)
    run = ServoRun("run", GAIN, goal, np.ones(time.size), np.zeros(time.size))
    moved = servo_rollout([(servo(payload), DcDrive(SUPPLY))], [run], STEP)[:, 0, 0]
    return Log(time, {"shaft.position": moved, "shaft.target_position": goal})


def test_the_robot_with_its_losses_stays_with_the_log_and_one_without_leaves_it() -> None:
    given = load_robot("planar_leg_fixed").lossless()
    true = given.with_effects(
        TransmissionEfficiency("knee", forward_efficiency=0.8, backward_efficiency=0.75),
        CoulombFriction("hip", level=0.5),
    )
    right, wrong = open_loop(true, sample_logs()), open_loop(given, sample_logs())
    assert right.horizons == HORIZONS
    assert right.starts == (12, 12, 12)
    # Sensor noise alone moves the start; a horizon of 0.1 s already shows the losses.
    assert np.all(right.error < 0.02 * right.moved)
    assert np.all(wrong.error > 5.0 * right.error)


def test_a_drive_with_a_target_sees_the_simulated_motion() -> None:
    found = open_loop(servo(), [servo_log()])
    assert found.reason == ""
    assert np.all(found.error < 2e-3)
    assert np.all(found.moved > 0.05)
    # With the torque that the drive made along the log a heavier arm would fall; held by its
    # drive it misses by the sag of the position loop alone.
    heavy = open_loop(servo(payload=0.1), [servo_log()])
    assert 5e-3 < heavy.error[0, -1] < 0.2


def test_a_log_is_simulated_with_its_own_load() -> None:
    log = with_machine(servo_log(payload=0.2), servo(), servo(payload=0.2))
    assert np.all(open_loop(servo(), [log]).error < 2e-3)
    assert open_loop(servo(), [servo_log(payload=0.2)]).error[0, -1] > 0.02


def test_what_cannot_be_simulated_says_why() -> None:
    robot = load_robot("planar_leg")
    columns = {f"{name}.position": np.sin(np.arange(800) / 90.0) for name in robot.single_joints}
    torque = {f"{name}.rotor_torque": np.ones(800) for name in robot.transmission.joints}
    flags = {"foot.active": np.ones(800)}
    floating = Log(np.arange(800) / 200.0, columns | torque | flags)
    found = open_loop(robot, [floating])
    assert "forces at foot were not recorded" in found.reason
    assert np.isnan(found.error).all()
    assert found.to_json()["joints"]["hip"]["error"] == [None, None, None]


def test_a_short_log_leaves_the_long_horizon_open() -> None:
    whole = servo_log()
    short = Log(whole.time[:375], {k: v[:375] for k, v in whole.columns.items()})
    found = open_loop(servo(), [short])
    assert np.isfinite(found.error[0, :2]).all()
    assert np.isnan(found.error[0, 2])
    assert found.starts[2] == 0


@pytest.mark.parametrize("command", ["compare", "diagnose"])
def test_commands_print_and_write_it(command, tmp_path, capsys) -> None:
    paths = []
    for k, log in enumerate(sample_logs()[:2]):
        paths.append(str(save_log(log, tmp_path / f"run{k}.csv")))
    result = tmp_path / "result.json"
    leg = ["--robot", "planar_leg_fixed", "--lossless"]
    add = ["--add", "transmission_efficiency"] if command == "diagnose" else []
    main([command, *paths, *leg, *add, "--json", str(result)])
    assert "open loop" in capsys.readouterr().out
    found = json.loads(result.read_text())["open_loop"]
    if command == "diagnose":
        before, after = (found[key]["joints"]["knee"]["error"] for key in ("before", "after"))
        assert after[1] < 0.5 * before[1]
    else:
        assert found["horizons"] == [0.1, 0.5, 2.0]
        assert found["joints"]["knee"]["error"][1] > 0.1
