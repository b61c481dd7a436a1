"""The mistakes that people make with logs: each is named by `wbc check`, most with its mend.

Twenty-two of them, on a leg of two joints whose motion and torques are exact but for noise. Where
a map mends the log, the map that `--fix` writes gives the columns back.
"""

import gzip
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.cli.conftest import LEG, Excited
from tests.columns import Columns, write_columns
from tests.conftest import Told
from tests.outside import recorded
from wbc import load_robot
from wbc.effects import CoulombFriction
from wbc.identification.readings import SuspiciousLogError, check_logs, find_suspicions, suspicions
from wbc.measurement import Log, load_log, load_logs, mended, save_log, together
from wbc.samples import sample_logs

RATIOS = {"hip": 20.0, "knee": 20.0}


@pytest.fixture(scope="module")
def right(excited_log: Excited) -> Log:
    return excited_log((CoulombFriction("hip", 0.4),), duration=6.0)


def scaled(factor: float, *names: str) -> Callable[[Columns], Columns]:
    return lambda columns: {**columns, **{name: factor * columns[name] for name in names}}


def exchanged(
    *quantities: str, joints: tuple[str, str] = ("hip", "knee")
) -> Callable[[Columns], Columns]:
    pairs = [(f"{a}.{q}", f"{b}.{q}") for q in quantities for a, b in (joints, joints[::-1])]
    return lambda columns: {**columns, **{ours: columns[theirs] for ours, theirs in pairs}}


MOTION, TORQUES = ("position", "velocity"), ("hip.rotor_torque", "knee.rotor_torque")
ANGLES = [f"{joint}.{quantity}" for joint in RATIOS for quantity in MOTION]  # hip, then knee
MENDED = [
    ("time in ms", scaled(1e3, "time"), "the time is in ms?"),
    ("torque in N mm", scaled(1e3, *TORQUES), "hold N mm?"),
    ("both torque signs", scaled(-1.0, *TORQUES), "the signs of hip.rotor_torque and knee"),
    ("one torque sign", scaled(-1.0, TORQUES[1]), "the sign of knee.rotor_torque is reversed?"),
    ("a position's sign", scaled(-1.0, *ANGLES[2:]), "the sign of knee.position is reversed?"),
    ("a velocity's sign", scaled(-1.0, "hip.velocity"), "opposite signs?"),
    ("swapped joints", exchanged(*MOTION), "the positions of hip and knee are exchanged?"),
    ("swapped torques", exchanged("rotor_torque"), "the torques of hip and knee are exchanged?"),
    ("speed of the rotor", scaled(20.0, "knee.velocity"), "the velocity is that of the rotor?"),
    ("speed in rpm", scaled(30.0 / np.pi, "hip.velocity"), "the velocity is in rpm?"),
    ("degrees", scaled(180.0 / np.pi, *ANGLES), "hip.position and knee.position hold degrees?"),
    (
        "torque behind the gear",
        scaled(20.0, *TORQUES),
        "the log gives torque after the reduction as hip.rotor_torque and knee.rotor_torque",
    ),
]


@pytest.mark.parametrize(("change", "says"), [m[1:] for m in MENDED], ids=[m[0] for m in MENDED])
def test_a_wrong_column_is_named_and_the_map_that_fix_writes_mends_it(
    change: Callable[[Columns], Columns], says: str, right: Log, told: Told, tmp_path: Path
) -> None:
    fix = tmp_path / "map.toml"
    path = write_columns(change({"time": right.time, **right.columns}), tmp_path / "run.csv")
    printed = told("check", path, *LEG, "--fix", fix, code=1)
    assert says in printed
    assert "Call " not in printed  # one cure, the map's lines, and no second one in words
    mended = load_log(path, fix, gear_ratios=RATIOS)
    np.testing.assert_allclose(mended.time, right.time, atol=1e-9)
    for name, values in right.columns.items():
        np.testing.assert_allclose(mended.column(name), values, rtol=1e-6, atol=1e-9, err_msg=name)
    told("check", path, *LEG, "--columns", fix)
    fix.unlink()
    said = told("diagnose", path, *LEG, "--fix", fix, code=2)
    assert said.startswith("wbc: ")  # before any effect is tried
    assert says in said
    np.testing.assert_allclose(load_log(path, fix, gear_ratios=RATIOS).time, right.time, atol=1e-9)


OTHER = """
robot = "planar_leg_fixed"
lossless = true
[gears.hip]
gear_ratio = { value = RATIO, unit = "1", source = "another robot" }
[gears.knee]
gear_ratio = { value = RATIO, unit = "1", source = "another robot" }
"""


@pytest.mark.parametrize("ratio", [9.0, 50.0])
def test_gear_ratios_of_another_robot_are_named(
    ratio: float, right: Log, excited_log: Excited, told: Told, tmp_path: Path
) -> None:
    (tmp_path / "robot.toml").write_text(OTHER.replace("RATIO", str(ratio)))
    more = excited_log((CoulombFriction("hip", 0.4),), seed=1, duration=8.0)
    paths = [save_log(log, tmp_path / f"run{k}.csv") for k, log in enumerate((right, more))]
    said = told("check", *paths, "--robot", tmp_path / "robot.toml", code=1)
    stated = said.partition("the gear ratios of the robot are ")[2].partition(" times")[0]
    assert float(stated) * ratio == pytest.approx(20.0, rel=0.05)
    assert "gear_ratio in robot.toml" in said
    said = told("diagnose", *paths, "--robot", tmp_path / "robot.toml", code=2)
    assert said.startswith(f"wbc: the gear ratios of the robot are {stated}")


def test_other_joints_and_logs_without_torque_are_named(
    right: Log, told: Told, tmp_path: Path
) -> None:
    path, fix = tmp_path / "run.csv", tmp_path / "map.toml"

    def both(check: str, diagnosis: str) -> None:
        """The diagnosis stops, before it prints anything, for what the check names."""
        assert check in told("check", path, *LEG, "--fix", fix, code=1)
        fix.unlink(missing_ok=True)
        said = told("diagnose", path, *LEG, "--fix", fix, code=2)
        assert said.startswith("wbc: ")
        assert diagnosis in said

    save_log(right.select([name for name in right.names if "torque" not in name]), path)
    both("no torque of hip, knee", "no torque of hip, knee")
    strange = {n.replace("hip", "b").replace("knee", "a"): v for n, v in right.columns.items()}
    for columns in (strange, dict(sorted(strange.items()))):  # torques tell the order
        save_log(Log(right.time, columns), path)
        both("no position of hip, knee", "no position of hip, knee")
        mended = load_log(path, fix)
        np.testing.assert_array_equal(mended.column("knee.position"), right.column("knee.position"))


def test_how_a_file_is_written_is_read_and_named(right: Log, told: Told, tmp_path: Path) -> None:
    text = save_log(right, tmp_path / "right.csv").read_text()
    header, _, rows = text.partition("\n")
    units = ",".join(["s", *("rad", "rad/s", "N m") * 2])
    assert header.replace('"', "").startswith("time,hip.position,hip.velocity,hip.rotor_torque")

    def said(content: bytes, name: str = "run.csv") -> str:
        (tmp_path / name).write_bytes(content)
        (log,) = load_logs([tmp_path / name])
        for column in ("hip.position", "knee.velocity"):
            np.testing.assert_array_equal(log.column(column), right.column(column))
        return told("check", tmp_path / name, *LEG)

    assert "the line above the rows gives units" in said(f"{header}\n{units}\n{rows}".encode())
    assert "1 comment lines above the header" in said(f"# a run\n{text}".encode())
    assert "the file is UTF-16" in said(text.encode("utf-16"))
    said(gzip.compress(text.encode()), "run.csv.gz")
    twenty = {f"{joint}.rotor_torque": 20.0 for joint in RATIOS}
    behind = right.with_columns({n: f * right.column(n) for n, f in twenty.items()})
    efforts = save_log(behind, tmp_path / "b.csv").read_text().replace("rotor_torque", "effort")
    assert "hip.effort is taken for hip.motor_torque" in said(efforts.encode())
    # What the user says is no guess.
    (tmp_path / "map.toml").write_text('columns."hip.motor_torque" = "hip.effort"\n')
    answer = told("check", tmp_path / "run.csv", *LEG, "--columns", tmp_path / "map.toml")
    assert "hip.effort is taken for" not in answer
    assert "knee.effort is taken for knee.motor_torque" in answer


_A, _B = "shoulder", "elbow"
_MOVED = [
    scaled(-1.0, f"{_B}.motor_torque"),
    scaled(-1.0, f"{_A}.motor_torque", f"{_B}.motor_torque"),
    scaled(1e3, f"{_A}.motor_torque", f"{_B}.motor_torque"),
    scaled(-1.0, f"{_B}.position", f"{_B}.velocity"),
    scaled(-1.0, f"{_A}.velocity"),
    scaled(-6.0, f"{_B}.velocity"),
    scaled(30.0 / np.pi, f"{_A}.velocity"),
    scaled(180.0 / np.pi, *(f"{j}.{q}" for j in (_A, _B) for q in MOTION)),
    exchanged(*MOTION, joints=(_A, _B)),
    exchanged("motor_torque", joints=(_A, _B)),
]


def test_mistakes_in_recorded_logs_are_certain_and_their_mends_give_the_columns_back() -> None:
    robot, every = recorded("double_pendulum")
    logs = every[:2]
    assert not any(f.kind != "read" for own in find_suspicions(logs, robot) for f in own)
    ratios = dict(zip(robot.transmission.joints, robot.transmission.gear_ratio, strict=True))
    for k, change in enumerate(_MOVED):
        wrong = [replace(log, columns=change(dict(log.columns))) for log in logs]
        with pytest.raises(SuspiciousLogError) as caught:
            suspicions(robot, wrong)
        mend = together(finding.mend for finding in caught.value.findings)
        for log, other in zip(logs, wrong, strict=True):
            back = mended(other, mend, ratios)
            for name, values in log.columns.items():
                np.testing.assert_allclose(back.column(name), values, atol=1e-9, err_msg=f"{k}")


def test_what_one_recorded_log_cannot_tell_is_said_with_the_truth_among_it() -> None:
    """Of the first 10 s of the double pendulum the robot explains little either way."""
    robot, (log, *_) = recorded("double_pendulum")
    for k, truth in (
        (0, "the sign of elbow.motor_torque is reversed"),
        (8, "the positions of shoulder and elbow are exchanged"),
        (9, "the torques of shoulder and elbow are exchanged"),
    ):
        ((finding,),) = find_suspicions([replace(log, columns=_MOVED[k](dict(log.columns)))], robot)
        assert truth in finding.text
        if finding.severity == "error":  # something is wrong; what, the log leaves open
            assert not finding.mend
            assert "One log cannot tell which." in finding.text
            assert f"If you know that {truth}, say so" in finding.way_out
        more = "Record more logs in which every joint moves"
        assert finding.way_out.startswith(more) == ("ne log cannot tell" in finding.text)


@pytest.mark.parametrize("number", range(3))
def test_exchanged_columns_are_certain_on_one_log_of_five_seconds(number: int) -> None:
    """Exchanged, the third log leaves 9 % at the knee: too little for a screen, not for a test."""
    robot = load_robot("planar_leg_fixed").lossless()
    log = sample_logs()[number]
    assert find_suspicions([log], robot) == [[]]
    for quantities in (("rotor_torque",), MOTION):
        wrong = replace(log, columns=exchanged(*quantities)(dict(log.columns)))
        ((finding,),) = find_suspicions([wrong], robot)
        assert finding.severity == "error"
        back = mended(wrong, finding.mend, RATIOS)
        for name, values in log.columns.items():
            np.testing.assert_array_equal(back.column(name), values, err_msg=name)


@pytest.mark.parametrize("seed", range(6))
def test_drives_that_report_only_noise_are_not_read_as_degrees(seed: int) -> None:
    """Degrees need less torque, so that they explained noise best and were called certain."""
    robot = load_robot("planar_leg_fixed").lossless()
    rng = np.random.default_rng(seed)
    noise = []
    for log in sample_logs():
        noise.append(log.with_columns({name: rng.normal(0.0, 0.3, len(log)) for name in TORQUES}))
    assert [f.text for own in find_suspicions(noise, robot) for f in own] == []


@pytest.mark.parametrize("joints", [("hip",), ("knee",), ("hip", "knee")])
def test_one_joint_in_degrees_is_told_from_all(joints: tuple[str, ...]) -> None:
    """One joint in degrees was read as all in degrees: 24 % of the power, and a wrong map."""
    robot = load_robot("planar_leg_fixed").lossless()
    log = sample_logs()[0]
    names = [f"{joint}.{quantity}" for joint in joints for quantity in MOTION]
    wrong = log.with_columns({name: np.degrees(log.column(name)) for name in names})
    ((finding,),) = find_suspicions([wrong], robot)
    assert finding.severity == "error"
    assert set(finding.mend["columns"]) == set(names)
    quality = check_logs([wrong], robot)[0]
    assert [f.kind for f in quality.findings if f.severity == "error"] == ["degrees"]
