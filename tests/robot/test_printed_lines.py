"""Every line of robot.toml that a message prints is copied into the file, and works."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from wbc.control import JouleHeatEffort
from wbc.effects import CoulombFriction, load_robot
from wbc.errors import WbcError
from wbc.identification import compare
from wbc.identification.readings import check_log
from wbc.identification.records.drives import drive_torques
from wbc.measurement import Log
from wbc.robot import Robot

ROOT = Path(__file__).resolve().parents[2]
LEG = ROOT / "robots" / "planar_leg" / "planar_leg.urdf"
HEAD = f'name = "leg"\nmodel = "{LEG}"\nbase = "fixed"\n'
LOCK = 'lock = ["base_x", "base_z", "base_pitch"]\n'
GEAR = """
[gears.{joint}]
gear_ratio = {{ value = 20.0, unit = "1", source = "test" }}
rotor_inertia = {{ value = 6.7e-5, unit = "kg m^2", source = "test" }}
"""
GEARS = GEAR.format(joint="hip") + GEAR.format(joint="knee")
_TIME = np.arange(400) * 0.005
_PLACES = {joint: np.sin((4.0 + k) * _TIME) for k, joint in enumerate(("hip", "knee"))}


def log_of(**channels: float) -> Log:
    """Return a log of the leg in motion with some constant channels of both joints."""
    columns = {f"{joint}.position": q for joint, q in _PLACES.items()}
    for quantity, size in channels.items():
        for joint, q in _PLACES.items():
            columns[f"{joint}.{quantity}"] = size * (q + 0.1)
    return Log(_TIME, columns)


def torques(log: Log) -> Callable[[Robot], object]:
    return lambda robot: drive_torques(log, robot.transmission).torque


def checked(log: Log) -> Callable[[Robot], object]:
    def action(robot: Robot) -> None:
        wrong = [f for f in check_log(log, robot).findings if f.severity == "error"]
        if wrong:
            raise WbcError(wrong[0].way_out)

    return action


TARGETS = log_of(target_position=1.1)
DUTY = 'duty_gain = { value = 1.0, unit = "1/rad", source = "test" }'
CASES: dict[str, tuple[str, Callable[[Robot], object]]] = {
    "targets without gains": (LOCK + GEARS, torques(TARGETS)),
    "targets without gains, checked": (LOCK + GEARS, checked(TARGETS)),
    "currents without constant": (LOCK + GEARS, torques(log_of(current=1.0))),
    "currents without constant, checked": (LOCK + GEARS, checked(log_of(current=1.0))),
    "duty without a winding": (
        LOCK + GEARS.replace("\nrotor", f"\n{DUTY}\nrotor"),
        torques(TARGETS),
    ),
    "heat without resistance": (LOCK + GEARS, JouleHeatEffort(weight=1.0).weights),
    "positions that the log lacks": (GEARS, checked(log_of(motor_torque=1.0))),
    "no gears": (LOCK, lambda robot: compare(robot, [log_of(motor_torque=1.0)])),
}


def with_printed(text: str, message: str) -> str:
    """Return a robot.toml with the lines of a message where it says that they go."""
    message = message.replace("VALUE", "0.5")
    for joint, printed in re.findall(r"below \[gears\.(\w+)\].*:\n((?: {4}.*(?:\n|$))+)", message):
        text = text.replace(f"[gears.{joint}]\n", f"[gears.{joint}]\n{printed.rstrip()}\n")
    if found := re.search(r"top of robot\.toml:\n {4}(.*)", message):
        text = f"{found[1]}\n{text}"
    if found := re.search(r"joint in robot\.toml:\n((?: {4}.*(?:\n|$))+)", message):
        text += "".join(f"\n{found[1].replace('JOINT', joint)}" for joint in _PLACES)
    return text


def refusal(action: Callable[[Robot], object], text: str, path: Path) -> str:
    path.write_text(text)
    robot = load_robot(path)
    try:
        action(robot)
    except WbcError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("name", CASES)
def test_printed_lines_mend_the_description(name: str, tmp_path: Path) -> None:
    rest, action = CASES[name]
    text, path = HEAD + rest, tmp_path / "robot.toml"
    message = refusal(action, text, path)
    assert message
    for _ in range(8):  # each message names one lack, and each of its lines takes one away
        changed = with_printed(text, message)
        assert changed != text, message
        text, message = changed, refusal(action, changed, path)
        if not message:
            return
    raise AssertionError(message)


def test_a_robot_says_in_a_line_what_it_is() -> None:
    """A console showed every array of its gears: a screen and a half."""
    leg = load_robot("planar_leg_fixed").with_effect(CoulombFriction("hip", 0.5))
    assert repr(leg) == (
        "Robot(planar_leg_fixed; driven: hip, knee; contacts: foot; "
        "effects: coulomb_friction at hip)"
    )
    assert len(repr(load_robot("solo12"))) < 200
