"""`wbc init`: from a stranger's files to a verdict, on recorded sets and on a generated log."""

import re
import tomllib
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from tests.cli.conftest import Excited
from tests.columns import write_columns
from tests.conftest import Told
from tests.outside import ROOT, outside
from wbc import load_robot
from wbc.cli import main
from wbc.identification.readings.first_guess import guess_names
from wbc.measurement import load_log, save_log
from wbc.samples import sample_logs

OURS = (ROOT / "robots" / "simple_pendulum" / "simple_pendulum.urdf").read_text(encoding="utf-8")
PENDULUM = OURS.replace("0 -1 0", "0 1 0").replace('joint name="pendulum"', 'joint name="pivot"')


DOUBLE = "dfki_double_pendulum/double_pendulum.parquet#A.0/trajectory_00"


@pytest.mark.parametrize(
    ("model", "log", "joints"),
    [
        ("double_pendulum", DOUBLE, ("shoulder", "elbow")),
        ("emps", "emps/emps_estimation.parquet", ("slide",)),
        ("", "simple_pendulum/direct_collocation.parquet", ("pivot",)),
    ],
)
def test_a_strangers_files_become_a_verdict(
    model: str,
    log: str,
    joints: tuple[str, ...],
    told: Told,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    path, mark, part = str(outside(log)).partition("#")
    given = ROOT / "robots" / model / f"{model}.urdf" if model else tmp_path / "pendulum.urdf"
    if not model:
        given.write_text(PENDULUM)
    said = told("init", given, path, "--out", tmp_path)
    robot, columns = tmp_path / "robot.toml", tmp_path / "columns.toml"
    assert f"next: wbc check {path} --robot {robot} --columns {columns}" in said
    assert "guess: " in columns.read_text()
    assert "guess: not in the model file" in robot.read_text()
    assert load_robot(robot).transmission.joints == joints
    read = [f"{path}{mark}{part}", "--robot", str(robot), "--columns", str(columns)]
    assert f"look up in {robot}: gears." in said
    assert "still guesses in" in told("check", *read)
    # One of the three with every effect there is, as a stranger would, and all of its answer.
    depth = ["--quiet", "--add", "coulomb_friction,viscous_friction"] if model else []
    assert main(["diagnose", *read, *depth]) in (0, 1)
    answer = capsys.readouterr().out
    assert answer.index("still guesses of `wbc init`") < answer.index("verdict: ")
    assert "do this now: " in answer
    assert len(answer.splitlines()) < 60


@pytest.mark.parametrize(("one", "other", "sign"), [("a", "b", 1.0), ("knee", "hip", -1.0)])
def test_units_sides_signs_and_joints_are_guessed_from_the_rows(
    one: str, other: str, sign: float, excited_log: Excited, told: Told, tmp_path: Path
) -> None:
    log = excited_log(duration=6.0)
    foreign = {"t": 1e3 * log.time}
    for theirs, ours in ((one, "knee"), (other, "hip")):
        foreign[f"ang_{theirs}_deg"] = np.degrees(log.column(f"{ours}.position"))
        foreign[f"speed_{theirs}"] = 20.0 * log.column(f"{ours}.velocity")
        foreign[f"trq_{theirs}"] = 20.0 * log.column(f"{ours}.rotor_torque")
    foreign[f"trq_{one}"] *= sign
    path = tmp_path / "run.parquet"
    pq.write_table(pa.table(foreign), path)
    assert "(probability" in told("init", "planar_leg_fixed", path, "--out", tmp_path)
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


def bench_log(path: Path, **columns: np.ndarray) -> Path:
    t = np.arange(0.0, 8.0, 0.01)
    swing = np.sin(2.0 * t) + 0.4 * np.sin(5.3 * t)
    rate = 2.0 * np.cos(2.0 * t) + 0.4 * 5.3 * np.cos(5.3 * t)
    given = {"time": t, "swing_pos": swing, "swing_vel": rate, "swing_torque": 9.0 * np.sin(swing)}
    pq.write_table(pa.table(given | columns), path)
    return path


def test_a_ratio_is_guessed_where_a_log_holds_both_sides_of_a_gear(
    told: Told, tmp_path: Path
) -> None:
    """The motor's speed stands first and turns backwards, in noise; it tells N = 50 still."""
    model, joint = tmp_path / "pendulum.urdf", "pivot"
    model.write_text(PENDULUM)
    run = bench_log(tmp_path / "plain.parquet")
    assert guess_names(run, [joint]).ratios == {}
    rate = pq.read_table(run)["swing_vel"].to_numpy()
    noise = 0.02 * np.random.default_rng(0).standard_normal(len(rate))
    both = {"swing_vel": rate + noise, "motor_swing_vel": -50.0 * rate + noise}
    run = bench_log(tmp_path / "run.parquet", **both)
    ratio, _ = guess_names(run, [joint]).ratios[joint]
    assert ratio == pytest.approx(50.0, rel=2e-3)
    assert "gear_ratio" in told("init", model, run, "--out", tmp_path)
    text = (tmp_path / "robot.toml").read_text()
    assert "guess: not in the model file; look it up; from the rows: 'motor_swing_vel'" in text
    assert load_robot(tmp_path / "robot.toml").transmission.gear_ratio[0] == ratio
    columns = tomllib.loads((tmp_path / "columns.toml").read_text())["columns"]
    assert columns[f"{joint}.velocity"]["from"] == "swing_vel"


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
    assert guess_names(run, ["swing", "lift"]).ratios == {}, why


def test_an_mjcf_model_gives_its_armature(told: Told, tmp_path: Path) -> None:
    (tmp_path / "arm.xml").write_text(
        '<mujoco><worldbody><body name="arm"><joint name="pivot" axis="0 1 0" range="-3 3" '
        'limited="true" armature="0.01"/><geom type="capsule" fromto="0 0 0 0 0 -0.5" size="0.02"/>'
        "</body></worldbody></mujoco>"
    )
    time = np.arange(400) * 0.005
    swings = {"pivot_pos": np.sin(4.0 * time), "pivot_torque_Nm": np.cos(4.0 * time)}
    run = write_columns({"time": time, **swings}, tmp_path / "run.csv")
    told("init", tmp_path / "arm.xml", run, "--out", tmp_path / "out")
    table = tomllib.loads((tmp_path / "out" / "robot.toml").read_text())
    inertia = table["gears"]["pivot"]["rotor_inertia"]
    assert (inertia["value"], inertia["source"]) == (0.01, "the model file")


def test_joints_without_positions_are_held_still(
    excited_log: Excited, told: Told, tmp_path: Path
) -> None:
    log = save_log(excited_log((), duration=2.0), tmp_path / "run.csv")
    model = ROOT / "robots" / "planar_leg" / "planar_leg.urdf"
    said = told("init", model, log, "--out", tmp_path)
    assert "no column with the position of base_x, base_z, base_pitch: lock in" in said
    robot = tomllib.loads((tmp_path / "robot.toml").read_text())
    assert robot["lock"] == ["base_x", "base_z", "base_pitch"]
    assert set(robot["gears"]) == {"hip", "knee"}
    assert load_robot(tmp_path / "robot.toml").single_joints == ("hip", "knee")


def test_a_guessed_gear_ratio_is_no_reason_to_suspect_columns(told: Told, tmp_path: Path) -> None:
    """With a ratio of one the torque is too small for the motion, and degrees explained that."""
    model = ROOT / "robots" / "planar_leg" / "planar_leg.urdf"
    logs = [str(save_log(log, tmp_path / f"run{k}.csv")) for k, log in enumerate(sample_logs())]
    told("init", model, *logs, "--out", tmp_path)
    files = ["--robot", tmp_path / "robot.toml", "--columns", tmp_path / "columns.toml"]
    said = told("check", *logs, *files)
    assert "degrees" not in said
    assert "still guesses in" in said
    assert "gears.hip.gear_ratio" in said
    # What is wrong is found all the same.
    first = sample_logs()[0]
    wrong = first.with_columns({"knee.rotor_torque": -first.column("knee.rotor_torque")})
    save_log(wrong, logs[0])
    said = told("check", logs[0], *files, code=1)
    assert "the sign of knee.rotor_torque is reversed" in said


def test_what_the_logs_lack_is_said_with_the_way_to_add_it(
    excited_log: Excited, told: Told, tmp_path: Path
) -> None:
    """A log without a torque got files without a word, and the next command was refused."""
    log = excited_log((), duration=2.0)
    columns = {n: v for n, v in log.columns.items() if n != "knee.rotor_torque"}
    run = {"row": log.time, **columns, "load_of_knee": log.column("knee.rotor_torque")}
    pq.write_table(pa.table(run), tmp_path / "run.parquet")
    files = ["init", "planar_leg_fixed", str(tmp_path / "run.parquet"), "--out"]
    assert "the rows per second: --rate HZ" in told(*files, tmp_path / "a", code=2)
    said = told(*files, tmp_path / "b", "--rate", 500)
    found = said[said.index("not found: ") : said.index("next: ")]
    assert "no torque of knee" in found
    assert "Record what the drive reports" in found
    assert "'load_of_knee'" in found
    (line,) = re.findall(r"columns\.\S+ = .*COLUMN\S*(?: })?", found)
    fix = tmp_path / "b" / "columns.toml"
    fix.write_text(fix.read_text() + line.replace("COLUMN", "load_of_knee") + "\n")
    read = load_log(tmp_path / "run.parquet", fix)
    np.testing.assert_array_equal(read.column("knee.motor_torque"), log.column("knee.rotor_torque"))
    assert read.sample_time == pytest.approx(0.002)


def test_the_pose_of_a_free_base_and_the_forces_of_its_contacts_are_asked_for(
    told: Told, tmp_path: Path
) -> None:
    robot = load_robot("solo12")
    time = np.arange(0.0, 1.0, 0.01)
    log = {"time": time, **{f"{j}.position": np.sin(time) for j in robot.single_joints}}
    log |= {f"{j}.rotor_torque": np.cos(time) for j in robot.single_joints}
    log |= {f"base.position.{axis}": 0.0 * time for axis in "xyz"}
    pq.write_table(pa.table(log), tmp_path / "run.parquet")
    files = ["solo12", tmp_path / "run.parquet"]
    read = [files[1], "--robot", "solo12"]
    said = told("init", *files, "--out", tmp_path / "out")
    assert "not found: no orientation of the base of 'solo12'" in said
    assert "unit quaternion" in said
    for command, code in (("check", 1), ("compare", 2)):
        assert "no orientation of the base" in told(command, *read, code=code)
    upright = {f"base.orientation.{axis}": float(axis == "w") + 0.0 * time for axis in "xyzw"}
    pq.write_table(pa.table(log | upright), tmp_path / "run.parquet")
    said = told("init", *files, "--out", tmp_path / "more")
    first = robot.contacts[0].name
    assert f"no force and no flag of the contacts {first}" in said
    assert f"{first}.active, 1 while it touches" in said
    # Its feet move: what a comparison refuses the check does not approve.
    assert f"In this one '{first}' moves by" in told("check", *read, code=1)
    assert f"'{first}' moves by" in told("compare", *read, code=2)
    held = {f"{contact.name}.active": 1.0 + 0.0 * time for contact in robot.contacts}
    pq.write_table(pa.table(log | upright | held), tmp_path / "run.parquet")
    assert "not found" not in told("init", *files, "--out", tmp_path / "all")


def test_a_model_without_logs_becomes_a_robot_with_one_table_of_gears(
    told: Told, tmp_path: Path
) -> None:
    model = tmp_path / "pendulum.urdf"
    model.write_text(PENDULUM)
    assert "gears.*.gear_ratio" in told("init", model, "--out", tmp_path)
    written = tmp_path / "robot.toml"
    assert list(tomllib.loads(written.read_text())["gears"]) == ["*"]
    assert not (tmp_path / "columns.toml").exists()
    assert load_robot(written).transmission.joints == ("pivot",)
    # What is described already needs logs.
    assert "give logs" in told("init", written, "--out", tmp_path / "new", code=2)
