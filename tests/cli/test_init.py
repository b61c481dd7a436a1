"""`wbc init`: from a stranger's files to a verdict, on recorded sets and on a generated log."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from tests.outside import ROOT, outside
from wbc import load_robot
from wbc.cli import main
from wbc.identification.readings.first_guess import guess_ratios
from wbc.measurement import Log, load_log, save_log
from wbc.samples import sample_logs

PENDULUM = """
<robot name="pendulum">
  <link name="world"/>
  <link name="arm">
    <inertial><origin xyz="0 0 -0.4338"/><mass value="0.675"/>
      <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.001"/></inertial>
  </link>
  <joint name="pivot" type="revolute">
    <parent link="world"/><child link="arm"/><axis xyz="0 1 0"/>
    <limit lower="-20" upper="20" effort="10" velocity="50"/>
  </joint>
</robot>
"""


@pytest.mark.parametrize(
    ("model", "log", "part", "joints"),
    [
        (
            "double_pendulum/double_pendulum.urdf",
            "dfki_double_pendulum/double_pendulum.parquet",
            "#A.0/trajectory_00",
            ("shoulder", "elbow"),
        ),
        ("emps/emps.urdf", "emps/emps_estimation.parquet", "", ("slide",)),
        ("", "simple_pendulum/direct_collocation.parquet", "", ("pivot",)),
    ],
)
def test_a_strangers_files_become_a_verdict(
    model: str,
    log: str,
    part: str,
    joints: tuple[str, ...],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    path = str(outside(log))
    given = ROOT / "robots" / model if model else tmp_path / "pendulum.urdf"
    if not model:
        given.write_text(PENDULUM)
    assert main(["init", str(given), path, "--out", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    robot, columns = str(tmp_path / "robot.toml"), str(tmp_path / "columns.toml")
    assert f"next: wbc check {path} --robot {robot} --columns {columns}" in said
    assert "guess: " in Path(columns).read_text()
    assert "guess: not in the model file" in Path(robot).read_text()
    assert load_robot(robot).transmission.joints == joints
    read = [f"{path}{part}", "--robot", robot, "--columns", columns]
    assert f"look up in {robot}: gears." in said.replace("\n", " ")
    assert main(["check", *read]) == 0
    assert "still guesses of `wbc init`" in capsys.readouterr().out
    # One of the three with every effect there is, as a stranger would, and all of its answer.
    depth = ["--quiet", "--add", "coulomb_friction,viscous_friction"] if model else []
    code = main(["diagnose", *read, *depth])
    assert code in (0, 1)
    answer = capsys.readouterr().out
    assert answer.index("still guesses of `wbc init`") < answer.index("verdict: ")
    assert "do this now: " in answer
    assert len(answer.splitlines()) < 60


@pytest.mark.parametrize(("first", "second", "sign"), [("a", "b", 1.0), ("knee", "hip", -1.0)])
def test_units_sides_signs_and_joints_are_guessed_from_the_rows(
    first: str,
    second: str,
    sign: float,
    excited_log: Callable[..., Log],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    log = excited_log(duration=6.0)
    foreign = {"t": 1e3 * log.time}
    for theirs, ours in ((first, "knee"), (second, "hip")):
        foreign[f"ang_{theirs}_deg"] = np.degrees(log.column(f"{ours}.position"))
        foreign[f"speed_{theirs}"] = 20.0 * log.column(f"{ours}.velocity")
        foreign[f"trq_{theirs}"] = 20.0 * log.column(f"{ours}.rotor_torque")
    foreign[f"trq_{first}"] *= sign
    path = tmp_path / "run.parquet"
    pq.write_table(pa.table(foreign), path)
    assert main(["init", "planar_leg_fixed", str(path), "--out", str(tmp_path)]) == 0
    table = tomllib.loads((tmp_path / "columns.toml").read_text())
    assert table["time"] == {"from": "t", "unit": "ms"}
    ratios = dict.fromkeys(("hip", "knee"), 20.0)
    mended = load_log(path, tmp_path / "columns.toml", gear_ratios=ratios)
    for joint in ratios:
        for quantity in ("position", "velocity"):
            name = f"{joint}.{quantity}"
            np.testing.assert_allclose(mended.column(name), log.column(name), atol=1e-9)
        torque = 20.0 * log.column(f"{joint}.rotor_torque")
        np.testing.assert_allclose(mended.column(f"{joint}.motor_torque"), torque, atol=1e-9)
    assert "(probability" in capsys.readouterr().out


def bench_log(path: Path, **columns: np.ndarray) -> Path:
    t = np.arange(0.0, 8.0, 0.01)
    swing = np.sin(2.0 * t) + 0.4 * np.sin(5.3 * t)
    rate = 2.0 * np.cos(2.0 * t) + 0.4 * 5.3 * np.cos(5.3 * t)
    given = {"time": t, "swing_pos": swing, "swing_vel": rate, "swing_torque": 9.0 * np.sin(swing)}
    pq.write_table(pa.table(given | columns), path)
    return path


def test_a_ratio_is_guessed_where_a_log_holds_both_sides_of_a_gear(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The motor's speed stands first and turns backwards, in noise; it tells N = 50 still."""
    (tmp_path / "pendulum.urdf").write_text(PENDULUM)
    joint = "pivot"
    rng = np.random.default_rng(0)
    run = bench_log(tmp_path / "plain.parquet")
    assert guess_ratios(run, [joint]) == {}
    rate = pq.read_table(run)["swing_vel"].to_numpy()
    noise = 0.02 * rng.standard_normal(len(rate))
    both = {"swing_vel": rate + noise, "motor_swing_vel": -50.0 * rate + noise}
    run = bench_log(tmp_path / "run.parquet", **both)
    told = guess_ratios(run, [joint])[joint]
    assert told.value == pytest.approx(50.0, rel=2e-3)
    assert main(["init", str(tmp_path / "pendulum.urdf"), str(run), "--out", str(tmp_path)]) == 0
    text = (tmp_path / "robot.toml").read_text()
    assert "guess: not in the model file; look it up; from the rows: 'motor_swing_vel'" in text
    robot = load_robot(tmp_path / "robot.toml")
    assert robot.transmission.gear_ratio[0] == told.value
    columns = tomllib.loads((tmp_path / "columns.toml").read_text())["columns"]
    assert columns[f"{joint}.velocity"]["from"] == "swing_vel"
    assert "gear_ratio" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "factor", "why"),
    [
        ("swing_motor_vel", 1.0, "a motor's speed in units of the joint tells no ratio"),
        ("swing_motor_vel_rpm", 9.55, "only one of the two names its unit"),
        ("other_motor_vel", 50.0, "another joint's motor"),
        ("swing_motor_vel", 0.0, "a motor that is not recorded"),
    ],
)
def test_what_tells_no_ratio_gives_none(name: str, factor: float, why: str, tmp_path: Path) -> None:
    rate = pq.read_table(bench_log(tmp_path / "a.parquet"))["swing_vel"].to_numpy()
    run = bench_log(tmp_path / "b.parquet", **{name: factor * rate})
    assert guess_ratios(run, ["swing", "lift"]) == {}, why


def test_an_mjcf_model_gives_its_armature(tmp_path: Path) -> None:
    (tmp_path / "arm.xml").write_text(
        '<mujoco><worldbody><body name="arm"><joint name="pivot" axis="0 1 0" range="-3 3" '
        'limited="true" armature="0.01"/><geom type="capsule" fromto="0 0 0 0 0 -0.5" size="0.02"/>'
        "</body></worldbody></mujoco>"
    )
    time = np.arange(400) * 0.005
    rows = np.column_stack([time, np.sin(4.0 * time), np.cos(4.0 * time)])
    header = "time,pivot_pos,pivot_torque_Nm"
    np.savetxt(tmp_path / "run.csv", rows, delimiter=",", header=header, comments="")
    files = [str(tmp_path / "arm.xml"), str(tmp_path / "run.csv")]
    assert main(["init", *files, "--out", str(tmp_path / "out")]) == 0
    table = tomllib.loads((tmp_path / "out" / "robot.toml").read_text())
    assert table["gears"]["pivot"]["rotor_inertia"]["value"] == 0.01
    assert table["gears"]["pivot"]["rotor_inertia"]["source"] == "the model file"


def test_joints_without_positions_are_held_still(
    excited_log: Callable[..., Log], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = save_log(excited_log((), duration=2.0), tmp_path / "run.csv")
    model = ROOT / "robots" / "planar_leg" / "planar_leg.urdf"
    assert main(["init", str(model), str(log), "--out", str(tmp_path)]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "no column with the position of base_x, base_z, base_pitch: lock in" in said
    robot = tomllib.loads((tmp_path / "robot.toml").read_text())
    assert robot["lock"] == ["base_x", "base_z", "base_pitch"]
    assert set(robot["gears"]) == {"hip", "knee"}
    assert load_robot(tmp_path / "robot.toml").single_joints == ("hip", "knee")


def test_a_guessed_gear_ratio_is_no_reason_to_suspect_columns(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """With a ratio of one the torque is too small for the motion, and degrees explained that."""
    model = Path(__file__).parents[2] / "robots" / "planar_leg" / "planar_leg.urdf"
    logs = [str(save_log(log, tmp_path / f"run{k}.csv")) for k, log in enumerate(sample_logs())]
    assert main(["init", str(model), *logs, "--out", str(tmp_path)]) == 0
    files = ["--robot", str(tmp_path / "robot.toml"), "--columns", str(tmp_path / "columns.toml")]
    capsys.readouterr()
    assert main(["check", *logs, *files]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "degrees" not in said
    assert "still guesses of `wbc init`" in said
    assert "gears.hip.gear_ratio" in said
    # What is wrong is found all the same.
    first = sample_logs()[0]
    wrong = first.with_columns({"knee.rotor_torque": -first.column("knee.rotor_torque")})
    save_log(wrong, logs[0])
    assert main(["check", logs[0], *files]) == 1
    assert "the sign of knee.rotor_torque is reversed" in " ".join(capsys.readouterr().out.split())


def test_what_the_logs_lack_is_said_with_the_way_to_add_it(
    excited_log: Callable[..., Log], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A log without a torque got files without a word, and the next command was refused."""
    log = excited_log((), duration=2.0)
    columns = {n: v for n, v in log.columns.items() if n != "knee.rotor_torque"}
    run = {"row": log.time, **columns, "load_of_knee": log.column("knee.rotor_torque")}
    pq.write_table(pa.table(run), tmp_path / "run.parquet")
    files = ["init", "planar_leg_fixed", str(tmp_path / "run.parquet"), "--out"]
    assert main([*files, str(tmp_path / "a")]) == 2
    assert "the rows per second: --rate HZ" in capsys.readouterr().err
    assert main([*files, str(tmp_path / "b"), "--rate", "500"]) == 0
    said = capsys.readouterr().out
    found = said[said.index("not found: ") : said.index("next: ")]
    assert "no torque of knee" in found
    assert "Record what the drive reports" in " ".join(found.split())
    assert "'load_of_knee'" in found
    line = next(line for line in found.splitlines() if line.startswith("    columns."))
    fix = tmp_path / "b" / "columns.toml"
    fix.write_text(fix.read_text() + line.replace("COLUMN", "load_of_knee") + "\n")
    read = load_log(tmp_path / "run.parquet", fix)
    np.testing.assert_array_equal(read.column("knee.motor_torque"), log.column("knee.rotor_torque"))
    assert read.sample_time == pytest.approx(0.002)


def test_the_pose_of_a_free_base_and_the_forces_of_its_contacts_are_asked_for(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    robot = load_robot("solo12")
    time = np.arange(0.0, 1.0, 0.01)
    log = {"time": time, **{f"{j}.position": np.sin(time) for j in robot.single_joints}}
    log |= {f"{j}.rotor_torque": np.cos(time) for j in robot.single_joints}
    log |= {f"base.position.{axis}": 0.0 * time for axis in "xyz"}
    pq.write_table(pa.table(log), tmp_path / "run.parquet")
    files = ["solo12", str(tmp_path / "run.parquet")]
    assert main(["init", *files, "--out", str(tmp_path / "out")]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "not found: no orientation of the base of 'solo12'" in said
    assert "unit quaternion" in said
    check = ["check", files[1], "--robot", "solo12"]
    assert main(check) == 1
    assert "no orientation of the base" in " ".join(capsys.readouterr().out.split())
    assert main(["compare", *check[1:]]) == 2
    assert "no orientation of the base" in capsys.readouterr().err
    upright = {f"base.orientation.{axis}": float(axis == "w") + 0.0 * time for axis in "xyzw"}
    pq.write_table(pa.table(log | upright), tmp_path / "run.parquet")
    assert main(["init", *files, "--out", str(tmp_path / "more")]) == 0
    said = " ".join(capsys.readouterr().out.split())
    first = robot.contacts[0].name
    assert f"no force and no flag of the contacts {first}" in said
    assert f"{first}.active, 1 while it touches" in said
    # Its feet move: what a comparison refuses the check does not approve.
    assert main(check) == 1
    assert f"In this one '{first}' moves by" in " ".join(capsys.readouterr().out.split())
    assert main(["compare", *check[1:]]) == 2
    assert f"'{first}' moves by" in " ".join(capsys.readouterr().err.split())
    held = {f"{contact.name}.active": 1.0 + 0.0 * time for contact in robot.contacts}
    pq.write_table(pa.table(log | upright | held), tmp_path / "run.parquet")
    assert main(["init", *files, "--out", str(tmp_path / "all")]) == 0
    assert "not found" not in capsys.readouterr().out


def test_a_model_without_logs_becomes_a_robot_with_one_table_of_gears(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = tmp_path / "pendulum.urdf"
    model.write_text(PENDULUM)
    assert main(["init", str(model), "--out", str(tmp_path)]) == 0
    assert "gears.*.gear_ratio" in capsys.readouterr().out
    written = tmp_path / "robot.toml"
    assert list(tomllib.loads(written.read_text())["gears"]) == ["*"]
    assert not (tmp_path / "columns.toml").exists()
    assert load_robot(written).transmission.joints == ("pivot",)
    # What is described already needs logs.
    assert main(["init", str(written), "--out", str(tmp_path / "new")]) == 2
    assert "give logs" in capsys.readouterr().err
