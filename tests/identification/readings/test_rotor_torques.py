"""Every way in which a drive reports torque, and voltages on a winding, end on the rotor."""

from __future__ import annotations

import numpy as np
import pytest

from wbc.effects import load_robot
from wbc.errors import LogError, TransmissionError
from wbc.identification.readings import check_robot, feedback_torques, rotor_torques
from wbc.measurement import Log, LogSource
from wbc.robot import Robot
from wbc.robot.dc_drive import DcDrive
from wbc.sim.servo_rollout import servo_rollout
from wbc.sim.servo_run import ServoRun
from wbc.transmission import Transmission


def test_every_way_a_drive_reports_torque_ends_on_the_rotor() -> None:
    time = np.arange(3.0)
    log = Log(
        time,
        {
            "a.rotor_torque": time,
            "a.motor_torque": 100.0 * time,
            "b.motor_torque": time,
            "c.current": time,
        },
        LogSource(ignored=("tau_x",)),
    )
    gears = Transmission(
        ("a", "b", "c"),
        np.array([20.0, -6.0, 9.0]),
        np.zeros(3),
        torque_constant=np.array([np.nan, np.nan, 0.1]),
    )
    np.testing.assert_allclose(rotor_torques(log, gears)[2], [2.0, -2.0 / 6.0, 0.2])
    with pytest.raises(LogError, match=r"needs torque_constant.* below \[gears\.c\]"):
        rotor_torques(log, gears.replace(torque_constant=np.full(3, np.nan)))
    more = Transmission(("a", "d"), np.ones(2), np.zeros(2))
    with pytest.raises(LogError, match=r"no torque of joint 'd'.*d\.current.*tau_x"):
        rotor_torques(log, more)


GAIN, SUPPLY, STEP = 2.0, 7.4, 0.004
KT, RESISTANCE = 0.387, 4.02


def driven() -> Robot:
    robot = load_robot("xl330_pendulum")
    gears = robot.transmission
    return robot.with_transmission(
        gears.replace(duty_gain=np.array([GAIN]), supply_voltage=np.array([SUPPLY]))
    )


def servo_log(released: bool = False) -> Log:
    """Return targets and positions of a simulated servo that saturates at times."""
    time = np.arange(0.0, 6.0, STEP)
    goal = 1.2 * np.sin(1.5 * time) + 0.5 * np.sign(np.sin(2.0 * time))
    enabled = np.where((time > 3.0) & released, 0.0, 1.0)
    run = ServoRun("run", GAIN, goal, enabled, np.zeros(time.size))
    position = servo_rollout([(load_robot("xl330_pendulum"), DcDrive(SUPPLY))], [run], STEP)
    columns = {"shaft.position": position[:, 0, 0], "shaft.target_position": goal}
    return Log(time, columns | ({"shaft.enabled": enabled} if released else {}))


def test_a_target_and_a_duty_law_make_the_torque_of_the_winding() -> None:
    log = servo_log()
    error = log.column("shaft.target_position") - log.column("shaft.position")
    speed = np.gradient(log.column("shaft.position"), log.time)
    duty = np.clip(GAIN * error, -1.0, 1.0)
    assert (np.abs(duty) == 1.0).any()
    expected = KT * (SUPPLY * duty - KT * speed) / RESISTANCE
    gears = driven().transmission
    np.testing.assert_allclose(rotor_torques(log, gears)[:, 0], expected, atol=1e-12)
    # A recorded duty needs no gain, and a recorded voltage stands before that of the robot.
    told = log.with_columns({"shaft.duty": duty, "shaft.voltage": np.full(len(log), SUPPLY)})
    bare = gears.replace(duty_gain=np.array([np.nan]), supply_voltage=np.array([np.nan]))
    np.testing.assert_allclose(rotor_torques(told, bare)[:, 0], expected, atol=1e-12)


def test_only_what_follows_the_target_is_no_feedback() -> None:
    log, gears = servo_log(), driven().transmission
    feedback = feedback_torques(log, gears)
    assert feedback is not None
    late = rotor_torques(log, gears) - feedback
    error = log.column("shaft.target_position") - log.column("shaft.position")
    free = np.abs(GAIN * error) < 1.0
    wanted = np.where(free, GAIN * log.column("shaft.target_position"), np.sign(error))
    np.testing.assert_allclose(late[:, 0], KT * SUPPLY / RESISTANCE * wanted, atol=1e-12)


def test_a_released_drive_gives_no_torque() -> None:
    log = servo_log(released=True)
    torque = rotor_torques(log, driven().transmission)[:, 0]
    assert np.all(torque[log.time > 3.0] == 0.0)
    assert np.std(torque[log.time < 3.0]) > 0.1


def test_what_a_duty_law_lacks_is_said() -> None:
    log, gears = servo_log(), driven().transmission
    assert not check_robot(log, driven())
    assert {f.kind for f in check_robot(log, load_robot("xl330_pendulum"))} == {"no_drive_gains"}
    with pytest.raises(LogError, match=r"needs supply_voltage(?s:.*)\[gears\.shaft\]"):
        rotor_torques(log, gears.replace(supply_voltage=np.array([np.nan])))
    with pytest.raises(TransmissionError, match="duty_gain"):
        load_robot("xl330_pendulum").with_transmission(gears.replace(duty_gain=np.array([-1.0])))
