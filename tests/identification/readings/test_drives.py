"""What drives report ends on the rotor; logs of one robot with other drives: `LOG@ROBOT`."""

from functools import cache

import numpy as np
import pytest

from tests.moved import STEP, SUPPLY, servo, servo_log
from wbc.effects import CoulombFriction, GravityDirection, PayloadMass, load_robot
from wbc.errors import LogError, TransmissionError
from wbc.identification import compare, diagnose
from wbc.identification.readings import check_robot, with_machine
from wbc.identification.records.drives import drive_torques
from wbc.measurement import Log, LogSource
from wbc.transmission import Transmission

KT, RESISTANCE, GAIN = 0.387, 4.02, 2.0
TIME = np.arange(0.0, 6.0, STEP)


def test_every_way_a_drive_reports_torque_ends_on_the_rotor() -> None:
    time, constants = np.arange(3.0), np.array([np.nan, np.nan, 0.1])
    columns = {name: time for name in ("a.rotor_torque", "b.motor_torque", "c.current")}
    columns["a.motor_torque"] = 100.0 * time
    log = Log(time, columns, LogSource(ignored=("tau_x",)))
    ratios, joints = np.array([20.0, -6.0, 9.0]), ("a", "b", "c")
    gears = Transmission(joints, ratios, np.zeros(3), torque_constant=constants)
    np.testing.assert_allclose(drive_torques(log, gears).torque[2], [2.0, -2.0 / 6.0, 0.2])
    with pytest.raises(LogError, match=r"needs torque_constant.* below \[gears\.c\]"):
        drive_torques(log, gears.replace(torque_constant=np.full(3, np.nan)))
    more = Transmission(("a", "d"), np.ones(2), np.zeros(2))
    with pytest.raises(LogError, match=r"'d\.motor_torque'.*tau_x"):
        drive_torques(log, more)


def saturating(released: float = np.inf) -> Log:
    """Return targets and positions of a simulated servo that saturates at times."""
    goal = 1.2 * np.sin(1.5 * TIME) + 0.5 * np.sign(np.sin(2.0 * TIME))
    return servo_log(servo(GAIN), goal, released)


def test_a_target_and_a_duty_law_make_the_torque_of_the_winding() -> None:
    log, gears = saturating(), servo(GAIN).transmission
    target, position = log.column("shaft.target_position"), log.column("shaft.position")
    speed, wanted = np.gradient(position, log.time), GAIN * (target - position)
    duty = np.clip(wanted, -1.0, 1.0)
    assert (np.abs(duty) == 1.0).any()
    expected = KT * (SUPPLY * duty - KT * speed) / RESISTANCE
    torque = drive_torques(log, gears).torque
    np.testing.assert_allclose(torque[:, 0], expected, atol=1e-12)
    # A recorded duty needs no gain, and a recorded voltage stands before that of the robot.
    told = log.with_columns({"shaft.duty": duty, "shaft.voltage": np.full(len(log), SUPPLY)})
    bare = gears.replace(duty_gain=np.array([np.nan]), supply_voltage=np.array([np.nan]))
    np.testing.assert_allclose(drive_torques(told, bare).torque[:, 0], expected, atol=1e-12)
    # Only what follows the target is no feedback.
    feedback = drive_torques(log, gears).feedback
    told_duty = np.where(np.abs(wanted) < 1.0, GAIN * target, np.sign(wanted))
    late = KT * SUPPLY / RESISTANCE * told_duty
    np.testing.assert_allclose((torque - feedback)[:, 0], late, atol=1e-12)
    # A released drive gives no torque.
    log = saturating(released=3.0)
    torque = drive_torques(log, gears).torque[:, 0]
    assert np.all(torque[log.time > 3.0] == 0.0)
    assert np.std(torque[log.time < 3.0]) > 0.1


def test_what_a_duty_law_lacks_is_said() -> None:
    log, gears, plain = saturating(), servo(GAIN).transmission, load_robot("xl330_pendulum")
    assert not check_robot(log, servo(GAIN))
    assert {f.kind for f in check_robot(log, plain)} == {"no_drive_gains"}
    with pytest.raises(LogError, match=r"needs supply_voltage(?s:.*)\[gears\.shaft\]"):
        drive_torques(log, gears.replace(supply_voltage=np.array([np.nan])))
    with pytest.raises(TransmissionError, match="duty_gain"):
        plain.with_transmission(gears.replace(duty_gain=np.array([-1.0])))


LEVEL = 0.06
LOADS = {"light": (1.5, 0.0), "stiff": (6.0, 0.0), "heavy": (4.0, 0.3)}  # of `servo`


@cache
def runs() -> dict[str, Log]:
    """Return a run of one servo per load; it rubs by `LEVEL`, which no description says."""
    goal, logs = 1.0 * np.sin(1.5 * TIME) + 0.4 * np.sin(5.0 * TIME), {}
    for k, (name, load) in enumerate(LOADS.items()):
        log = servo_log(servo(*load).with_effect(CoulombFriction("shaft", LEVEL)), goal)
        noise = 2e-5 * np.random.default_rng(k).standard_normal(TIME.size)
        logs[name] = log.with_columns({"shaft.position": log.column("shaft.position") + noise})
    return logs


def test_logs_with_their_own_gains_and_payloads_share_one_answer() -> None:
    base = servo(*LOADS["light"])
    logs = [with_machine(log, base, servo(*LOADS[name])) for name, log in runs().items()]
    found = diagnose(base, logs, [CoulombFriction, PayloadMass])
    assert [(e.name, e.where) for e in found.effects] == [("coulomb_friction", "shaft")]
    assert found.effects[0].values["level"] == pytest.approx(LEVEL, rel=0.05)
    # Taken as one machine, the same logs hold a false cause or a large error.
    true = base.with_effect(CoulombFriction("shaft", LEVEL))
    assert compare(true, logs).outputs[0].rms < 0.01
    assert compare(true, list(runs().values())).outputs[0].rms > 0.1


def test_a_payload_of_one_log_weighs_in_gravity_that_is_tilted() -> None:
    base = servo(LOADS["heavy"][0])
    heavy = with_machine(runs()["heavy"], base, servo(*LOADS["heavy"]))
    tilt = GravityDirection("robot", 0.0, 0.1)
    ours = compare(base.with_effect(tilt), [heavy]).outputs[0].rms
    theirs = compare(servo(*LOADS["heavy"]).with_effect(tilt), [runs()["heavy"]]).outputs[0].rms
    assert ours == pytest.approx(theirs, rel=1e-6)


def test_what_logs_must_share_is_said() -> None:
    base, log = servo(1.0), runs()["light"]
    gears = base.transmission.replace(resistance=np.array([5.0]))
    with pytest.raises(LogError, match=r"differs from 'xl330_pendulum' in resistance"):
        with_machine(log, base, base.with_transmission(gears))
    with pytest.raises(LogError, match=r"differs from .* in coulomb_friction at shaft"):
        with_machine(log, base, base.with_effect(CoulombFriction("shaft", 0.1)))
