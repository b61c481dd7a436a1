"""The fit of a servo recovers what a plant of its own was made with."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from wbc.cli import main
from wbc.effects import CoulombFriction, load_robot
from wbc.errors import IdentificationError
from wbc.identification.servo import Span, fit_rollouts, fit_servo
from wbc.measurement import Log, save_log
from wbc.robot import Robot
from wbc.sim.servo_rollout import DcDrive, ServoRun

STEP = 0.004


def followed(
    goal: np.ndarray,
    step: float,
    gain: float,
    mass: float,
    resistance: float,
    coulomb: float,
    sag: float,
) -> np.ndarray:
    """Simulate the servo in plain floats: semi-implicit steps, friction by clipping."""
    q, v, reached, inertia, kt = 0.0, 0.0, [], mass * 0.1**2 + 0.00181, 0.387
    for wanted in goal:
        reached.append(q)
        duty = min(max(gain * (wanted - q), -1.0), 1.0)
        current = (7.4 * duty - kt * v) / (resistance + sag * abs(duty))
        torque = kt * current - mass * 9.81 * 0.1 * np.sin(q)
        free = v + step * torque / inertia
        v = np.sign(free) * max(abs(free) - step * coulomb / inertia, 0.0)
        q += step * v
    return np.array(reached)


def plant(
    resistance: float, coulomb: float, sag: float, amplitude: float, duration: float = 4.0
) -> ServoRun:
    fine = 10
    time = np.arange(0.0, duration, STEP / fine)
    goal = amplitude * np.sin(4.0 * time + 0.5 * time**2)
    reached = followed(goal, STEP / fine, 1.5, 0.49, resistance, coulomb, sag)[::fine]
    return ServoRun("plant", 1.5, goal[::fine], np.ones(reached.size), reached)


def build(values: Mapping[str, float]) -> tuple[Robot, DcDrive]:
    base = load_robot("xl330_pendulum")
    gears = base.transmission.with_values("shaft", {"resistance": values["resistance"]})
    robot = base.with_transmission(gears).with_effect(CoulombFriction("shaft", values["coulomb"]))
    return robot, DcDrive(7.4, values["sag"])


SPANS = {
    "resistance": Span(1.0, 3.0, 10.0),
    "coulomb": Span(0.0, 0.005, 0.2),
    "sag": Span(0.0, 0.3, 5.0),
}


def test_finds_resistance_friction_and_sag() -> None:
    runs = [plant(4.0, 0.03, 1.5, amplitude) for amplitude in (0.4, 1.6)]
    fit = fit_servo(build, SPANS, runs, STEP)
    assert fit.values["resistance"] == pytest.approx(4.0, rel=0.05)
    assert fit.values["coulomb"] == pytest.approx(0.03, rel=0.1)
    assert fit.values["sag"] == pytest.approx(1.5, rel=0.15)
    assert fit.error(runs, STEP).max() < 0.01
    assert fit.at_bound == ()


def test_says_that_a_number_ended_on_its_bound() -> None:
    runs = [plant(4.0, 0.0, 0.0, 0.8)]
    fit = fit_servo(build, {**SPANS, "sag": Span(0.5, 1.0, 5.0)}, runs, STEP)
    assert "sag" in fit.at_bound
    with pytest.raises(IdentificationError, match="at least one"):
        fit_servo(build, {}, [], STEP)


def test_what_the_runs_leave_open_stays_at_its_start() -> None:
    swing = plant(4.0, 0.03, 1.5, 0.8)
    released = ServoRun("off", 1.5, swing.goal, 0.0 * swing.goal, 0.3 + 0.0 * swing.goal)
    spans = {"resistance": Span(1.0, 3.0, 10.0), "sag": Span(0.0, 0.3, 5.0)}
    how = {"starts": [{"sag": 2.0}], "hold": 0.5}
    fit = fit_servo(lambda v: build({**v, "coulomb": 0.03}), spans, [released], STEP, **how)
    assert fit.values["resistance"] == pytest.approx(3.0, rel=1e-3)
    assert fit.values["sag"] == pytest.approx(0.3, abs=1e-3)


LOADS = ((0.8, 0.0), (1.5, 0.2), (3.0, 0.4))
"""Gain of the drive, and mass at the end of the arm [kg], of each setting of one servo."""


def swung(gain: float, more: float, rate: float) -> Log:
    """Return a run of the servo with more mass at the end of its arm."""
    time, fine = np.arange(0.0, 1.5, 0.005 / 10), slice(None, None, 10)
    goal = 1.2 * np.sin(rate * time + 0.7 * time**2)
    reached = followed(goal, 0.005 / 10, gain, 0.49 + more, 5.0, 0.03, 0.0)
    return Log(time[fine], {"shaft.position": reached[fine], "shaft.target_position": goal[fine]})


SETTING = """
robot = "xl330_pendulum"
gears.shaft.duty_gain = {{ value = {}, unit = "1/rad" }}
[[effects]]
effect = "payload_mass"
where = "arm"
parameters = {{ mass = {{ value = {}, unit = "kg" }} }}
"""


def test_several_loads_and_gains_make_one_servo(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    logs, fitted, file = [], tmp_path / "fitted.toml", tmp_path / "found.json"
    for k, (gain, more) in enumerate(LOADS):
        (tmp_path / f"{k}.toml").write_text(SETTING.format(gain, more))
        save_log(swung(gain, more, 2.0 + k), tmp_path / f"{k}.npz")
        logs.append(f"{tmp_path}/{k}.npz@{tmp_path}/{k}.toml")
    how = ["--robot", "xl330_pendulum", "--save", str(fitted), "--json", str(file)]
    assert main(["rollout", *logs, *how]) == 0
    assert "Coulomb and viscous friction chosen" in " ".join(
        word for word in capsys.readouterr().out.split() if not word[0].isdigit()
    )
    found = json.loads(file.read_text())
    assert found["best"] == "Coulomb and viscous friction"
    assert found["models"][0]["held_out"] == pytest.approx([0.0] * 3, abs=0.004)
    assert found["given"] > 0.03
    # Without a torque only their ratio is told: viscous friction brakes as the back-EMF does.
    robot = load_robot(fitted)
    gears = robot.transmission
    ratio = float(gears.torque_constant[0] / gears.resistance[0])
    assert ratio == pytest.approx(0.0774, rel=0.05)
    levels = {effect.name: effect.values for effect in robot.effects}
    assert levels["coulomb_friction"]["level"] == pytest.approx(0.03, rel=0.15)


@pytest.mark.parametrize(
    ("robot", "says"),
    [
        ("xl330_pendulum", "a rollout needs the duty_gain.*LOG@ROBOT"),
        ("planar_leg_fixed", "for one driven joint"),
        ("sts3250_pendulum", "supply_voltage; put the number in place of VALUE"),
    ],
)
def test_a_rollout_without_a_gain_says_where_to_state_it(robot: str, says: str) -> None:
    logs = [swung(gain, more, 2.0) for gain, more in LOADS]
    with pytest.raises(IdentificationError, match=f"(?s){says}"):
        fit_rollouts(load_robot(robot), logs)
