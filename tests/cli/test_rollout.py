"""Servo logs of two loads and two gains, from the files to one fitted servo."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from wbc import load_robot
from wbc.cli import main
from wbc.measurement import Log, save_log

STEP = 0.005
RESISTANCE, COULOMB = 5.0, 0.03


def swung(gain: float, more: float, rate: float) -> Log:
    """Return a run of the servo in plain floats, with more mass at the end of its arm."""
    fine = 10
    time = np.arange(0.0, 3.0, STEP / fine)
    goal = 1.2 * np.sin(rate * time + 0.7 * time**2)
    q, v, reached = 0.0, 0.0, []
    mass, constant = 0.49 + more, 0.387
    inertia = mass * 0.1**2 + 0.00181
    for wanted in goal:
        reached.append(q)
        duty = min(max(gain * (wanted - q), -1.0), 1.0)
        torque = constant * (7.4 * duty - constant * v) / RESISTANCE
        torque -= mass * 9.81 * 0.1 * np.sin(q)
        free = v + STEP / fine * torque / inertia
        v = np.sign(free) * max(abs(free) - STEP / fine * COULOMB / inertia, 0.0)
        q += STEP / fine * v
    return Log(
        time[::fine],
        {"shaft.position": np.array(reached)[::fine], "shaft.target_position": goal[::fine]},
    )


def machine(gain: float, more: float) -> str:
    return f"""robot = "xl330_pendulum"
[gears.shaft]
duty_gain = {{ value = {gain}, unit = "1/rad" }}
[[effects]]
effect = "payload_mass"
where = "arm"
parameters = {{ mass = {{ value = {more}, unit = "kg" }} }}
"""


@pytest.fixture
def servo(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return the logs LOG@ROBOT of three settings in the present folder."""
    monkeypatch.chdir(tmp_path)
    given = []
    for k, (gain, more) in enumerate(((0.8, 0.0), (1.5, 0.2), (3.0, 0.4))):
        save_log(swung(gain, more, 2.0 + k), f"run{k}.csv")
        Path(f"robot{k}.toml").write_text(machine(gain, more))
        given.append(f"run{k}.csv@robot{k}.toml")
    return given


def test_several_loads_and_gains_make_one_servo(
    servo: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["rollout", *servo, "--robot", "xl330_pendulum", "--save", "fitted.toml"]
    assert main([*command, "--json", "found.json"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "It needs: Coulomb and viscous friction." in said
    found = json.loads(Path("found.json").read_text())
    assert found["models"][0]["held_out"] == pytest.approx([0.0] * 3, abs=0.004)
    assert found["given"] > 0.03
    fitted = load_robot("fitted.toml")
    # Without a torque only their ratio is told: viscous friction brakes as the back-EMF does.
    gears = fitted.transmission
    ratio = float(gears.torque_constant[0] / gears.resistance[0])
    assert ratio == pytest.approx(0.387 / RESISTANCE, rel=0.05)
    levels = {effect.name: effect.values for effect in fitted.effects}
    assert levels["coulomb_friction"]["level"] == pytest.approx(COULOMB, rel=0.15)


def test_a_rollout_without_a_gain_says_where_to_state_it(
    servo: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    logs = [path.partition("@")[0] for path in servo]
    assert main(["rollout", *logs, "--robot", "xl330_pendulum"]) == 2
    said = capsys.readouterr().err
    assert "run0.csv: a rollout needs the duty_gain" in said
    assert "LOG@ROBOT" in said
    assert main(["rollout", *logs, "--robot", "planar_leg_fixed"]) == 2
    assert "for one driven joint" in capsys.readouterr().err
    assert main(["rollout", *logs, "--robot", "sts3250_pendulum"]) == 2
    said = capsys.readouterr().err
    assert "supply_voltage; put the number in place of VALUE" in said
    assert 'resistance = { value = VALUE, unit = "ohm"' in said
