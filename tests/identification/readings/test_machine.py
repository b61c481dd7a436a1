"""Logs of one robot with other drives and loads: `LOG@ROBOT`."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from wbc.effects import CoulombFriction, GravityDirection, PayloadMass, load_robot
from wbc.errors import LogError
from wbc.identification import compare, diagnose
from wbc.identification.readings import with_machine
from wbc.measurement import Log
from wbc.robot import Robot
from wbc.robot.dc_drive import DcDrive
from wbc.sim.servo_rollout import servo_rollout
from wbc.sim.servo_run import ServoRun

SUPPLY, STEP, LEVEL = 7.4, 0.004, 0.06
LOADS = {
    "light": (1.5, 0.0),
    "stiff": (6.0, 0.0),
    "heavy": (4.0, 0.3),
}  # gain [1/rad], payload [kg]


def servo(gain: float, payload: float = 0.0) -> Robot:
    robot = load_robot("xl330_pendulum").with_effect(PayloadMass("arm", payload))
    gears = robot.transmission
    return robot.with_transmission(
        gears.replace(duty_gain=np.array([gain]), supply_voltage=np.array([SUPPLY]))
    )


@cache
def runs() -> dict[str, Log]:
    """Return a run of one servo per load; it rubs by `LEVEL`, which no description says."""
    time = np.arange(0.0, 6.0, STEP)
    goal = 1.0 * np.sin(1.5 * time) + 0.4 * np.sin(5.0 * time)
    logs = {}
    for k, (name, (gain, payload)) in enumerate(LOADS.items()):
        robot = servo(gain, payload).with_effect(CoulombFriction("shaft", LEVEL))
        run = ServoRun(name, gain, goal, np.ones(time.size), np.zeros(time.size))
        reached = servo_rollout([(robot, DcDrive(SUPPLY))], [run], STEP)[:, 0, 0]
        noise = 2e-5 * np.random.default_rng(k).standard_normal(time.size)
        columns = {"shaft.position": reached + noise, "shaft.target_position": goal}
        logs[name] = Log(time, columns)
    return logs


def test_logs_with_their_own_gains_and_payloads_share_one_answer() -> None:
    base = servo(LOADS["light"][0])
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
