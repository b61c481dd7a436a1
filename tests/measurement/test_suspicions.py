"""Suspicions on recorded and simulated logs: none where the columns are right, named where not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.measurement.conftest import outside
from wbc.effects import load_robot
from wbc.measurement import Log, find_suspicions, load_logs, mended, read_logs, suspicions
from wbc.robot import Robot
from wbc.robot.loading.library import robots_directory

LEG = load_robot("planar_leg_fixed").lossless()
RECORDED = {
    "double_pendulum": "dfki_double_pendulum/double_pendulum.parquet#A.0/trajectory*",
    "double_pendulum_c0": "dfki_double_pendulum/double_pendulum.parquet#C.0/*",
    "double_pendulum_c1": "dfki_double_pendulum/double_pendulum.parquet#C.1/*",
    "emps": "emps/emps_estimation.parquet",
    "staubli_tx40": "staubli_tx40/tx40.parquet",
    "tiago": "tiago/tiago.parquet",
}


def recorded(name: str) -> tuple[Robot, tuple[Log, ...]]:
    file, mark, part = RECORDED[name].partition("#")
    path = f"{outside(file)}{mark}{part}"
    robot = load_robot(name)
    gears = robot.transmission
    ratios = dict(zip(gears.joints, map(float, gears.gear_ratio), strict=True))
    return robot, read_logs([path], robots_directory() / name / "columns.toml", gear_ratios=ratios)


@pytest.mark.parametrize("case", range(11))
def test_no_hidden_effect_of_the_practice_leg_looks_like_a_wrong_column(case: int) -> None:
    logs = load_logs([outside(f"practice_leg/case{case:02d}{letter}.csv") for letter in "ac"])
    assert find_suspicions(logs, LEG) == [[], []]


@pytest.mark.parametrize("case", range(4))
def test_nor_of_the_leg_that_stands_on_the_ground(case: int) -> None:
    logs = load_logs([outside(f"practice_leg/float{case:02d}{letter}.csv") for letter in "ab"])
    assert find_suspicions(logs, load_robot("planar_leg").lossless()) == [[], []]


@pytest.mark.parametrize("name", RECORDED)
def test_recorded_machines_are_not_suspected(name: str) -> None:
    robot, logs = recorded(name)
    assert suspicions(robot, logs) == []


@pytest.mark.parametrize(
    ("columns", "kind"),
    [
        ({f"{j}.motor_torque": {"sign": -1} for j in ("shoulder", "elbow")}, "torque_sign"),
        ({"elbow.motor_torque": {"sign": -1}}, "torque_sign"),
        ({f"elbow.{q}": {"sign": -1} for q in ("position", "velocity")}, "position_sign"),
        (
            {
                "shoulder.motor_torque": {"from": "elbow.motor_torque"},
                "elbow.motor_torque": {"from": "shoulder.motor_torque"},
            },
            "exchanged",
        ),
        ({f"{j}.motor_torque": {"scale": 1000} for j in ("shoulder", "elbow")}, "torque_unit"),
    ],
)
def test_wrong_columns_of_a_recorded_arm_are_certain(columns: dict, kind: str) -> None:
    robot, logs = recorded("double_pendulum")
    wrong = [mended(log, {"columns": columns}) for log in logs]
    for log, right, own in zip(wrong, logs, find_suspicions(wrong, robot), strict=True):
        (finding,) = own
        assert (finding.kind, finding.severity) == (kind, "error")
        repaired = mended(log, finding.mend)
        for name, values in right.columns.items():
            np.testing.assert_allclose(repaired.column(name), values, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("ratio", [9.0, 50.0])
def test_the_gear_ratio_of_another_robot_is_told_with_its_true_value(ratio: float) -> None:
    paths = [outside(f"practice_leg/case00{letter}.csv") for letter in "acd"]
    gears = replace(LEG.transmission, gear_ratio=np.full(2, ratio))
    found = find_suspicions(load_logs(paths), replace(LEG, transmission=gears))
    (finding,) = found[0]
    assert (finding.kind, finding.severity) == ("gear_ratio", "error")
    stated = float(finding.text.split("are ")[1].split(" times")[0])
    assert stated * ratio == pytest.approx(20.0, rel=0.05)


def test_forces_a_thousand_times_too_large_are_no_friction() -> None:
    """A slide without gravity: friction of any size explained them."""
    robot, logs = recorded("emps")
    wrong = [mended(log, {"columns": {"slide.motor_torque": {"scale": 1000}}}) for log in logs]
    ((finding,),) = find_suspicions(wrong, robot)
    assert (finding.kind, finding.severity) == ("torque_unit", "error")
    assert "slide.motor_torque holds mN" in finding.text


def test_milliseconds_show_without_velocities_at_a_high_rate() -> None:
    """At 5 kHz the time stamps are 0.2 s apart, which a log may well be."""
    robot, logs = recorded("staubli_tx40")
    ((finding,),) = find_suspicions([replace(logs[0], time=1e3 * logs[0].time)], robot)
    assert (finding.kind, finding.severity) == ("time_unit", "error")


def test_exchanged_torques_are_found_where_one_log_alone_does_not_ask_for_them() -> None:
    robot, logs = recorded("double_pendulum_c1")
    names = ("shoulder.motor_torque", "elbow.motor_torque")
    swap = {a: {"from": b} for a, b in (names, names[::-1])}
    wrong = [mended(log, {"columns": swap}) for log in logs[:3]]
    for own in find_suspicions(wrong, robot):
        (finding,) = own
        assert (finding.kind, finding.severity) == ("exchanged", "error")
        assert set(finding.mend["columns"]) == set(names)


def test_no_map_mends_what_cannot_be_told_from_something_else() -> None:
    robot, logs = recorded("double_pendulum_c1")
    wrong = [mended(log, {"columns": {"elbow.motor_torque": {"sign": -1}}}) for log in logs[:3]]
    for own in find_suspicions(wrong, robot):
        (finding,) = own
        assert finding.severity == "error"
        assert "the sign of elbow.motor_torque is reversed" in finding.text
        assert not finding.mend
        assert finding.likeliest
