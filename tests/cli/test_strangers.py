"""Files as people have them, from public reports: read right, or refused with the reason.

Each folder of the outside data holds a README with the answer that is wanted.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from wbc import load_robot
from wbc.cli import main
from wbc.measurement import load_logs

DATA = Path(__file__).resolve().parents[3] / "shared" / "data" / "strangers"
Told = Callable[..., tuple[int, str]]


def stranger(folder: str) -> Path:
    if not (DATA / folder).exists():
        pytest.skip(f"the outside data '{folder}' is not beside this repository")
    return DATA / folder


@pytest.fixture
def told(capsys: pytest.CaptureFixture[str]) -> Told:
    """Run a command; return its exit code and what it printed, on one line."""

    def run(*arguments: object) -> tuple[int, str]:
        code = main([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        return code, " ".join((captured.out + captured.err).split())

    return run


def columns_of(folder: Path) -> dict[str, dict[str, object]]:
    return tomllib.loads((folder / "columns.toml").read_text())["columns"]


def test_arrays_of_seven_columns_are_seven_joints(told: Told, tmp_path: Path) -> None:
    files = stranger("05_numbered_columns")
    code, _ = told("init", files / "kuka_lwr4.urdf", files / "run1.npz", "--out", tmp_path)
    assert code == 0
    (log,) = load_logs([files / "run1.npz"], tmp_path / "columns.toml")
    with np.load(files / "run1.npz") as stored:
        for quantity, name in (("position", "positions"), ("motor_torque", "torques")):
            joints = [f"lwr_{k}_joint" for k in range(7)]
            np.testing.assert_array_equal(log.stack(quantity, joints), stored[name])
    robot = tmp_path / "robot.toml"
    read = ["--robot", robot, "--columns", tmp_path / "columns.toml"]
    assert told("check", files / "run1.npz", *read)[0] == 0


def test_a_file_without_a_header_is_shown_with_the_map_that_names_its_columns(
    told: Told, tmp_path: Path
) -> None:
    files = stranger("06_headerless")
    command = ["init", files / "two_link.urdf", files / "slow.csv", "--out", tmp_path]
    code, said = told(*command)
    assert code == 2
    assert "has no header line" in said
    assert "1.003190899973560590e-02, -1.576165259552496201e+00" in said
    line = said[said.index("rows.header = ") :]
    assert line.count("column_") == 6
    for name, theirs in enumerate(("q1", "q2", "dq1", "dq2", "tau1", "tau2"), start=2):
        line = line.replace(f'"column_{name}"', f'"{theirs}"')
    (tmp_path / "known.toml").write_text(line)
    code, said = told(*command, "--columns", tmp_path / "known.toml")
    assert code == 0
    (log,) = load_logs([files / "slow.csv"], tmp_path / "columns.toml")
    assert set(log.with_quantity("motor_torque")) == {"joint1", "joint2"}


def test_torques_without_a_sign_are_refused(told: Told, tmp_path: Path) -> None:
    files = stranger("02_unsigned_torque")
    runs = sorted(files.glob("run*.csv"))
    code, said = told("init", files / "arm.urdf", *runs, "--out", tmp_path)
    assert code == 0
    assert "never below zero" in said
    assert "magnitude without sign" in said
    assert "targets" in said
    assert "sign" not in (tmp_path / "columns.toml").read_text()
    read = ["--robot", tmp_path / "robot.toml", "--columns", tmp_path / "columns.toml"]
    for command, refused in (("check", 1), ("diagnose", 2)):
        code, said = told(command, *runs, *read)
        assert code == refused
        assert "magnitude without sign" in said


def test_angles_in_degrees_that_wrap_are_mapped_in_one_go(told: Told, tmp_path: Path) -> None:
    files = stranger("09_degrees_wrapped")
    runs = sorted(files.glob("run*.csv"))
    assert told("init", files / "arm.urdf", *runs, "--out", tmp_path)[0] == 0
    columns = columns_of(tmp_path)
    for joint in ("yaw", "shoulder", "elbow"):
        entry = columns[f"{joint}.position"]
        assert (entry["unit"], entry["unwrap"]) == ("deg", 360)
        assert "sign" not in columns.get(f"{joint}.motor_torque", {})
    read = ["--robot", tmp_path / "robot.toml", "--columns", tmp_path / "columns.toml"]
    code, said = told("check", *runs, *read)
    assert code == 0
    assert "unwrap" not in said


def test_lists_in_a_cell_are_the_joints_along_the_chain(told: Told, tmp_path: Path) -> None:
    files = stranger("07_list_cells")
    code, said = told("init", files / "so101.urdf", files / "state_motor.csv", "--out", tmp_path)
    assert code == 0
    chain = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
    columns = columns_of(tmp_path)
    for k, joint in enumerate(chain):
        assert columns[f"{joint}.position"]["from"] == f"positions_{k}"
        assert "sign" not in columns[f"{joint}.motor_torque"]
    assert "magnitude without sign" in said


def test_a_clock_that_lost_its_digits_is_refused(told: Told, tmp_path: Path) -> None:
    files = stranger("08_epoch_digits")
    command = ["init", files / "kuka_lwr4.urdf", files / "run1.csv", "--out", tmp_path]
    code, said = told(*command)
    assert code == 2
    assert "398 of 399 rows share a time stamp" in said
    assert "digits of the clock were lost" in said
    assert "--rate" in said
    assert told(*command, "--rate", 200)[0] == 0


def test_ten_rows_of_one_stamp_are_all_used(told: Told, tmp_path: Path) -> None:
    files = stranger("11_duplicate_stamps")
    runs = sorted(files.glob("run*.csv"))
    assert told("init", files / "arm.urdf", *runs, "--out", tmp_path)[0] == 0
    logs = load_logs(runs, tmp_path / "columns.toml")
    assert [len(log) for log in logs] == [4000, 4000, 4000]
    read = ["--robot", tmp_path / "robot.toml", "--columns", tmp_path / "columns.toml"]
    assert told("check", *runs, *read)[0] == 0


def test_a_held_robot_of_a_file_with_a_free_joint_is_held(told: Told, tmp_path: Path) -> None:
    files = stranger("13_mjcf_freejoint_fixed")
    model, log = files / "go2.xml", files / "a.csv"
    assert told("init", model, log, "--base", "fixed", "--out", tmp_path)[0] == 0
    assert not load_robot(tmp_path / "robot.toml").has_free_flyer
    read = ["--robot", tmp_path / "robot.toml", "--columns", tmp_path / "columns.toml"]
    code, said = told("check", log, *read)
    assert code == 0
    assert "base" not in said


def test_an_inertia_that_no_body_has_is_an_error(told: Told) -> None:
    files = stranger("15_impossible_inertia")
    runs = sorted(files.glob("run*.csv"))
    read = ["--robot", files / "robot.toml", "--columns", files / "columns.toml"]
    code, said = told("check", *runs, *read)
    assert code == 2
    assert "the inertia of link 'l2' is not positive definite" in said
    assert "-0.03466, 0.06866, 0.12 kg m^2" in said
