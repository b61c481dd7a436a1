"""Files as people have them, from public reports: read right, or refused with the reason.

Each folder of the outside data holds a README with the answer that is wanted.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from tests.outside import outside
from wbc import load_robot
from wbc.cli import main
from wbc.identification.readings.robot_checks import told_by_rows
from wbc.measurement import load_logs
from wbc.measurement.guess import guess_names

Told = Callable[..., tuple[int, str]]


def stranger(folder: str) -> Path:
    return outside(f"strangers/{folder}")


def described(folder: str) -> list[Path | str]:
    """Return the runs of a folder with its own robot and map, as a command takes them."""
    files = stranger(folder)
    runs = sorted(files.glob("run*.csv"))
    return [*runs, "--robot", files / "robot.toml", "--columns", files / "columns.toml"]


@pytest.fixture
def told(capsys: pytest.CaptureFixture[str]) -> Told:
    """Run a command; return its exit code and what it printed, on one line."""

    def run(*arguments: object) -> tuple[int, str]:
        code = main([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        return code, " ".join((captured.out + captured.err).split())

    return run


def read_by(folder: Path) -> list[str | Path]:
    """Return the options that read logs as `wbc init` wrote them down in a folder."""
    return ["--robot", folder / "robot.toml", "--columns", folder / "columns.toml"]


def columns_of(folder: Path) -> dict[str, dict[str, object]]:
    return tomllib.loads((folder / "columns.toml").read_text())["columns"]


def test_a_second_log_that_cannot_be_read_leaves_nothing_behind(told: Told, tmp_path: Path) -> None:
    """A robot.toml stayed, and the command that was mended found it there already."""
    files, out = stranger("05_numbered_columns"), tmp_path / "out"
    (tmp_path / "run2.npz").write_text("no archive")
    command = ["init", files / "kuka_lwr4.urdf", files / "run1.npz"]
    code, said = told(*command, tmp_path / "run2.npz", "--out", out)
    assert code
    assert "run2.npz" in said
    assert not list(out.glob("*"))
    assert told(*command, "--out", out)[0] == 0


def test_arrays_of_seven_columns_are_seven_joints(told: Told, tmp_path: Path) -> None:
    files = stranger("05_numbered_columns")
    code, _ = told("init", files / "kuka_lwr4.urdf", files / "run1.npz", "--out", tmp_path)
    assert code == 0
    (log,) = load_logs([files / "run1.npz"], tmp_path / "columns.toml")
    with np.load(files / "run1.npz") as stored:
        for quantity, name in (("position", "positions"), ("motor_torque", "torques")):
            joints = [f"lwr_{k}_joint" for k in range(7)]
            np.testing.assert_array_equal(log.stack(quantity, joints), stored[name])
    assert told("check", files / "run1.npz", *read_by(tmp_path))[0] == 0


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
    for command, refused in (("check", 1), ("diagnose", 2)):
        code, said = told(command, *runs, *read_by(tmp_path))
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


def test_a_torque_of_another_ratio_is_asked_about_with_its_factor(told: Told) -> None:
    """Reported over 1.917: a gear ratio, a torque constant or masses, the check cannot tell."""
    code, said = told("check", *described("14_missing_knee_ratio"))
    assert code == 0
    assert "all 3 logs: warning: torques of elbow are 0.5" in said
    factor = float(said.partition("torques of elbow are ")[2].partition(" times")[0])
    assert factor == pytest.approx(1.0 / 1.917, rel=0.1)
    assert "Check gear_ratio and torque constant in robot.toml" in said


def test_an_inertia_that_no_body_has_is_an_error(told: Told) -> None:
    code, said = told("check", *described("15_impossible_inertia"))
    assert code == 2
    assert "the inertia of link 'l2' is not positive definite" in said
    assert "-0.03466, 0.06866, 0.12 kg m^2" in said


def test_targets_in_a_file_beside_make_the_torque_where_currents_have_no_sign(
    told: Told, tmp_path: Path
) -> None:
    """The recorded SO-101 as published: states and targets in a file each, lists in cells."""
    folder = outside("so101_sage")
    logs = [
        f"{folder}/{run}.state_motor.csv.gz+{folder}/{run}.control.csv.gz"
        for run in ("multisine", "friction_gravity")
    ]
    code, said = told("init", folder / "so101.urdf", *logs, "--out", tmp_path)
    assert code == 0
    assert "left out, magnitudes without sign; the targets make the torque" in said
    columns = columns_of(tmp_path)
    assert columns["elbow_flex.motor_torque"] is False
    assert columns["elbow_flex.target_position"]["from"] == "control_positions_2"
    read = ["--robot", tmp_path / "robot.toml", "--columns", tmp_path / "columns.toml"]
    code, said = told("check", *logs, *read)
    assert code == 0
    # What is alike in all joints and logs is said once.
    assert said.count("samples) behind the position") == 1
    assert "all 2 logs: warning: shoulder_pan.velocity, shoulder_lift.velocity, " in said
    log = load_logs(logs[:1], tmp_path / "columns.toml")[0]
    assert 40.0 < 1.0 / log.sample_time < 60.0
    assert (
        np.std(log.column("elbow_flex.target_position") - log.column("elbow_flex.position")) < 0.2
    )


def arm_runs(folder: Path, change: Callable[[np.ndarray], np.ndarray]) -> list[str]:
    """Write the three runs of a right arm, changed; rows are time, then position and torque."""
    paths = []
    for source in sorted(stranger("15_impossible_inertia").glob("run*.csv")):
        header = source.read_text().partition("\n")[0]
        table = change(np.loadtxt(source, delimiter=",", skiprows=1))
        path = folder / source.name
        np.savetxt(path, table, delimiter=",", header=header, comments="", fmt="%.9g")
        paths.append(str(path))
    return paths


def with_sign_bits(table: np.ndarray) -> np.ndarray:
    """Positions as counts of 4096 a turn whose bit 15 is the sign."""
    counts = np.round(table[:, 1::2] * 4096 / (2.0 * np.pi))
    table[:, 1::2] = np.where(counts < 0.0, 32768 - counts, counts)
    return table


def test_the_torque_tells_how_many_counts_with_a_bit_of_sign_make_a_turn(
    told: Told, tmp_path: Path
) -> None:
    runs = arm_runs(tmp_path, with_sign_bits)
    model = stranger("09_degrees_wrapped") / "arm.urdf"
    code, said = told("init", model, *runs, "--out", tmp_path)
    assert code == 0
    assert "bit 15 is a sign" in said
    assert "hold counts of an encoder of 4096 a turn?" in said
    assert "degrees" not in said
    read = ["--robot", tmp_path / "robot.toml", "--columns", tmp_path / "columns.toml"]
    assert told("check", *runs, *read)[0] == 0


def test_counts_of_which_no_torque_says_more_are_asked_for(told: Told, tmp_path: Path) -> None:
    def without_torque(table: np.ndarray) -> np.ndarray:
        table[:, 1::2] = np.round(table[:, 1::2] * 4096 / (2.0 * np.pi))
        table[:, 2::2] = np.random.default_rng(0).normal(size=table[:, 2::2].shape)
        return table

    runs = arm_runs(tmp_path, without_torque)
    code, said = told("check", *runs, "--robot", stranger("14_missing_knee_ratio") / "robot.toml")
    assert code == 1
    assert "encoder counts" in said
    for joint in ("yaw", "shoulder", "elbow"):
        assert f'columns."{joint}.position" = {{ scale = 0.001533980788 }}' in said


@pytest.mark.parametrize("every", ["second", "run"])
def test_after_the_check_says_so_rows_with_holes_are_dropped(
    every: str, told: Told, tmp_path: Path
) -> None:
    def holed(table: np.ndarray) -> np.ndarray:
        table[slice(0, None, 2) if every == "second" else slice(300, 360), 4] = np.nan
        return table

    runs = arm_runs(tmp_path, holed)
    model = stranger("09_degrees_wrapped") / "arm.urdf"
    assert told("init", model, *runs[:1], "--out", tmp_path)[0] == 0
    read = ["--robot", tmp_path / "robot.toml"]
    code, said = told("check", *runs, *read, "--fix", tmp_path / "fix.toml")
    assert code == 1
    assert "shoulder.motor_torque is needed" in said
    assert told("check", *runs, *read, "--columns", tmp_path / "fix.toml")[0] == 0


ARM = ("yaw", "shoulder", "elbow")
JOINT_STATES = ("name", "position", "effort")


def written(
    folder: Path,
    head: list[str],
    row: Callable[[float, np.ndarray, np.ndarray, np.ndarray], list[str]],
    mark: str = ",",
    above: str = "",
) -> list[str]:
    """Write three runs of a right arm as others would: a row of time, q, dq and torque."""
    paths = []
    for source in sorted(stranger("15_impossible_inertia").glob("run*.csv")):
        table = np.loadtxt(source, delimiter=",", skiprows=1)
        speed = np.gradient(table[:, 1::2], table[:, 0], axis=0)
        rows = zip(table[:, 0], table[:, 1::2], speed, table[:, 2::2], strict=True)
        lines = [mark.join(head), *(mark.join(row(*each)) for each in rows)]
        path = folder / source.name
        path.write_text(above + "\n".join(lines) + "\n", encoding="utf-8")
        paths.append(str(path))
    return paths


def cells(*parts: object) -> list[str]:
    return [f"{number:.9g}" for number in np.concatenate([np.atleast_1d(part) for part in parts])]


def of_a_bag(folder: Path) -> list[str]:
    """Nested names, joints in alphabetical order, named in cells."""
    order = [2, 1, 0]
    names = [f"/joint_states/{kind}[{k}]" for kind in JOINT_STATES for k in range(3)]
    return written(
        folder,
        ["__time", *names],
        lambda t, q, dq, tau: [
            f"{1.7e9 + t:.6f}", *(ARM[k] for k in order), *cells(q[order], tau[order])
        ],
    )  # fmt: skip


def of_a_vendor(folder: Path) -> list[str]:
    kinds = ("ActPos (deg)", "ActVel (deg/s)", "ActTorque (Nm)")
    return written(
        folder,
        ["Time (s)", *(f"J{k}_{kind}" for kind in kinds for k in (1, 2, 3))],
        lambda t, q, dq, tau: cells(t, np.degrees(q), np.degrees(dq), tau),
    )


def with_dates(folder: Path) -> list[str]:
    """A line of a spreadsheet, semicolons, decimal commas; ISO dates in a nameless column."""
    start = np.datetime64("2024-05-03T12:01:02.000000")
    return written(
        folder,
        [
            "Messpunkt",
            *(f"Position {k}" for k in (1, 2, 3)),
            *(f"Drehmoment {k}" for k in (1, 2, 3)),
        ],
        lambda t, q, dq, tau: [
            str(start + np.timedelta64(round(1e6 * t), "us")),
            *(cell.replace(".", ",") for cell in cells(q, tau)),
        ],
        mark=";",
        above="sep=;\n",
    )


def with_microseconds(folder: Path) -> list[str]:
    names = [f"joint_{kind}_{k}" for kind in ("pos", "torque") for k in range(3)]
    return written(
        folder,
        ["timestamp_us", *names],
        lambda t, q, dq, tau: [str(1714737662000000 + round(1e6 * t)), *cells(q, tau)],
        above="# robot: arm 3\n# operator: night shift\n",
    )


def from_one(folder: Path) -> list[str]:
    return written(
        folder,
        ["t", *(f"{kind}{k}" for kind in ("q", "dq", "tau") for k in (1, 2, 3))],
        lambda t, q, dq, tau: cells(t, q, dq, tau),
    )


def with_american_dates(folder: Path) -> list[str]:
    start = datetime(2025, 3, 14, 13, 59, 50)
    return written(
        folder,
        ["When", *(f"{joint} [°]" for joint in ARM), *(f"{joint}_Nm" for joint in ARM)],
        lambda t, q, dq, tau: [
            (start + timedelta(seconds=1 + t)).strftime("%m/%d/%Y %I:%M:%S.%f %p"),
            *cells(np.degrees(q), tau),
        ],
    )


def of_a_topic(folder: Path) -> list[str]:
    """The stamp in two columns; what all columns are called says nothing about the joint."""
    names = [f"/arm/joint_states/{j}/{kind}" for kind in ("position", "effort") for j in ARM[::-1]]
    return written(
        folder,
        [*(f"/arm/joint_states/header/stamp/{part}" for part in ("sec", "nanosec")), *names],
        lambda t, q, dq, tau: [
            f"{1700000001 + int(t // 1.0)}",
            f"{round(1e9 * (t % 1.0))}",
            *cells(q[::-1], tau[::-1]),
        ],
    )


def with_a_row_for_each_motor(folder: Path) -> list[str]:
    """As buses are read: the motors of a stamp one after another, named by a column."""
    return written(
        folder,
        ["Time(ms)", "ID", "Position (rad)", "Torque (Nm)"],
        lambda t, q, dq, tau: [
            "\n".join(f"{1e3 * t:.0f},{k + 1},{q[k]:.9g},{tau[k]:.9g}" for k in range(3))
        ],
    )


def with_lines_about_the_file(folder: Path) -> list[str]:
    """A trace of a cabinet: lines without columns, a blank line, decimal commas between tabs."""
    kinds = ("AxisAct.A{} [deg]", "MotTorque.A{} [Nm]")
    return written(
        folder,
        ["Zeit [s]", *(kind.format(k) for kind in kinds for k in (1, 2, 3))],
        lambda t, q, dq, tau: [cell.replace(".", ",") for cell in cells(t, np.degrees(q), tau)],
        mark="\t",
        above="Robot Trace;C4\nDate;2024-03-01\n\n",
    )


KINDS = [
    with_a_row_for_each_motor,
    with_lines_about_the_file,
    of_a_bag,
    of_a_vendor,
    with_dates,
    with_microseconds,
    from_one,
    with_american_dates,
    of_a_topic,
]


@pytest.mark.parametrize("write", KINDS)
def test_files_of_nine_kinds_become_the_same_logs(
    write: Callable[[Path], list[str]], told: Told, tmp_path: Path
) -> None:
    runs = write(tmp_path)[:1]
    model = stranger("09_degrees_wrapped") / "arm.urdf"
    code, said = told("init", model, *runs, "--out", tmp_path / "out")
    assert code == 0
    assert "elbow: motion and torque alone tell its columns with 100 %" in said
    columns = tmp_path / "out" / "columns.toml"
    source = sorted(stranger("15_impossible_inertia").glob("run*.csv"))[0]
    right, (log,) = load_logs([source])[0], load_logs(runs, columns)
    np.testing.assert_allclose(log.time - log.time[0], right.time - right.time[0], atol=1e-6)
    for quantity in ("position", "motor_torque"):
        np.testing.assert_allclose(
            log.stack(quantity, ARM), right.stack(quantity, ARM), rtol=1e-7, atol=1e-9
        )
    read = ["--robot", tmp_path / "out/robot.toml", "--columns", columns]
    assert told("check", *runs, *read)[0] == 0


def test_init_says_that_a_joint_mimics_another(told: Told, tmp_path: Path) -> None:
    source = stranger("09_degrees_wrapped") / "arm.urdf"
    mimic = tmp_path / "mimic.urdf"
    text = source.read_text()
    joint = text.index('<joint name="elbow"')
    end = text.index("</joint>", joint)
    mimic.write_text(f'{text[:end]}<mimic joint="shoulder" multiplier="1"/>{text[end:]}')
    runs = from_one(tmp_path)
    code, said = told("init", mimic, *runs, "--out", tmp_path / "out")
    assert code == 0
    assert "joint 'elbow' mimics 'shoulder'" in said


def shortened(table: np.ndarray) -> np.ndarray:
    return table[:40]


def with_losses(table: np.ndarray) -> np.ndarray:
    """Of every second 0.6 s are missing."""
    return table[table[:, 0] % 1.0 < 0.4]


def beyond_its_stops(table: np.ndarray) -> np.ndarray:
    table[:, 3] += 60.0
    return table


def of_noise(table: np.ndarray) -> np.ndarray:
    table[:, 6] = np.random.default_rng(0).normal(0.0, table[:, 6].std(), len(table))
    return table


@pytest.mark.parametrize("change", [shortened, with_losses, beyond_its_stops, of_noise])
def test_what_a_comparison_refuses_the_check_does_not_approve(
    change: Callable[[np.ndarray], np.ndarray], told: Told, tmp_path: Path
) -> None:
    runs = arm_runs(tmp_path, change)
    read = ["--robot", stranger("14_missing_knee_ratio") / "robot.toml"]
    code, said = told("check", *runs, *read)
    assert code == 1, said
    assert told("compare", *runs, *read)[0] == 2


def foreign_runs(
    case: str, folder: Path, change: Callable[[dict[str, np.ndarray], int], object]
) -> tuple[list[str], list[Path | str]]:
    """Write the runs of another robot, changed; return them and how they are read."""
    source, paths = outside(f"foreign/{case}"), []
    for k in (1, 2, 3):
        with (source / f"run{k}.csv").open(encoding="utf-8") as file:
            names = file.readline().strip().split(",")
            columns = dict(zip(names, np.loadtxt(file, delimiter=",").T, strict=True))
        change(columns, k)
        path = folder / f"run{k}.csv"
        table = np.column_stack(list(columns.values()))
        np.savetxt(path, table, delimiter=",", header=",".join(columns), comments="", fmt="%.9g")
        paths.append(str(path))
    return paths, ["--robot", source / "robot.toml", "--columns", source / "columns.toml"]


KINOVA, UR5, XARM = "24_kinova_outside_wind", "27_ur5_null", "26_xarm7_outside_belt"


def held_still(columns: dict[str, np.ndarray], _: int) -> None:
    """One value, .199993, has a deviation of rounding: gear ratios were accused for certain."""
    for name in columns:
        if name != "time":
            columns[name][:] = columns[name][0]


def of_another_robot(columns: dict[str, np.ndarray], k: int) -> None:
    """None follows its need, which no likelihood of one joint alone refuses."""
    table = np.loadtxt(outside(f"foreign/{XARM}/run{k}.csv"), delimiter=",", skiprows=1)
    for joint in (1, 2, 3):
        told = np.interp(columns["time"], table[:, 0], table[:, 3 * joint])
        columns[f"j2s6s200_joint_{joint}.motor_torque"] = told


def turned(columns: dict[str, np.ndarray], _: int) -> None:
    """The first joint turns about the vertical and leaves most of its torque: friction and wind."""
    columns["j2s6s200_joint_3.position"] += np.pi / 2.0


def late(columns: dict[str, np.ndarray], _: int) -> None:
    time = columns["time"]
    torques = [name for name in columns if name.endswith("torque")]
    columns |= {name: np.interp(time - 0.05, time, columns[name]) for name in torques}


@pytest.mark.parametrize(
    ("case", "change", "says"),
    [
        (XARM, held_still, "no joint moves"),
        (KINOVA, of_another_robot, "does not follow what the links need"),
        (KINOVA, turned, "perhaps the zero of j2s6s200_joint_3.position is off by 90 degrees"),
        (KINOVA, late, "lag by 50 ms"),
    ],
)
def test_what_is_wrong_with_foreign_runs_is_said_and_nothing_else(
    case: str, change: Callable[..., None], says: str, told: Told, tmp_path: Path
) -> None:
    runs, read = foreign_runs(case, tmp_path, change)
    code, said = told("check", *runs, *read)
    assert says in said
    assert "gear ratios" not in said
    assert code == (change in (held_still, of_another_robot))
    if code:
        assert told("compare", *runs, *read)[0] == 2


def test_a_wrist_with_a_rotor_that_nobody_described_is_no_stranger(
    told: Told, tmp_path: Path
) -> None:
    """Behind a gear of 101 the rotor of a wrist is most of its torque; the check refused it."""
    source = outside(f"foreign/{UR5}")
    runs = [source / f"run{k}.csv" for k in (1, 2, 3)]
    assert told("init", source / "robot.urdf", *runs, "--out", tmp_path)[0] == 0
    read = ["--robot", tmp_path / "robot.toml", "--columns", tmp_path / "columns.toml"]
    code, said = told("check", *runs, *read)
    assert code == 0, said


def test_one_log_whose_zero_is_another_one_gets_a_map_of_its_own(
    told: Told, tmp_path: Path
) -> None:
    def moved(columns: dict[str, np.ndarray], k: int) -> None:
        columns["joint3.position"] += 0.3 * (k == 2)

    runs, read = foreign_runs(XARM, tmp_path, moved)
    code, said = told("check", *runs, *read, "--fix", tmp_path / "fix.toml")
    assert code == 1
    assert "run2.csv: error: joint3.position: the zero of joint3.position is off" in said
    assert "LOG@MAP.toml" in said
    assert not (tmp_path / "fix.toml").exists()  # the other logs are right
    offset = said.partition("{ offset = ")[2].partition(" }")[0]
    assert float(offset) == pytest.approx(-0.3, abs=0.02)
    line = f'columns."joint3.position" = {{ offset = {offset} }}'
    (tmp_path / "own.toml").write_text(line)
    mended = [runs[0], f"{runs[1]}@{tmp_path / 'own.toml'}", runs[2]]
    assert told("check", *mended, *read)[0] == 0


@pytest.mark.parametrize("pause", [30.0, 0.004])
def test_two_runs_of_one_file_are_two(pause: float, told: Told, tmp_path: Path) -> None:
    """The clock pauses, or just goes on while the joints leap: that was taken for a counter."""
    source = outside(f"foreign/{XARM}")
    header = (source / "run1.csv").read_text().partition("\n")[0]
    both = [
        np.loadtxt(source / f"run{k}.csv", delimiter=",", skiprows=1)[start:2400]
        for k, start in ((1, 0), (2, 700))
    ]
    both[1][:, 0] += both[0][-1, 0] + pause - both[1][0, 0]
    path = tmp_path / "both.csv"
    np.savetxt(path, np.vstack(both), delimiter=",", header=header, comments="", fmt="%.9g")
    read = ["--robot", source / "robot.toml", "--columns", source / "columns.toml"]
    code, said = told("check", path, *read)
    assert code == 0, said
    assert "jumps" not in said
    shares = told_by_rows(load_robot(read[1]), load_logs([path], read[3]))
    assert len(shares) == 4
    assert np.min(np.round([*shares.values()], 2)) >= 0.99
    assert told("compare", path, *read)[0] == 0


def test_a_series_shorter_than_the_chain_is_named_as_a_whole(told: Told, tmp_path: Path) -> None:
    """q_0 to q_3 of joint1 to joint7: three were named by their numbers, and q_0 the fourth."""
    source = outside(f"foreign/{XARM}")
    table = np.loadtxt(source / "run1.csv", delimiter=",", skiprows=1)
    arrays = {"t": table[:, 0], "q": table[:, 1::3], "tau": table[:, 3::3]}
    np.savez(tmp_path / "run.npz", allow_pickle=False, **arrays)
    command = ["init", source / "robot.urdf", tmp_path / "run.npz", "--out", tmp_path]
    code, said = told(*command)
    assert code == 0
    assert "exchanged" not in said
    for k in range(4):
        assert columns_of(tmp_path)[f"joint{k + 1}.position"]["from"] == f"q_{k}"


def test_vectors_whose_name_says_nothing_are_asked_about_with_lines_that_work(
    told: Told, tmp_path: Path
) -> None:
    def listed(t: float, q: np.ndarray, dq: np.ndarray, tau: np.ndarray) -> list[str]:
        return [f"{t:.6f}", *(f"[{' '.join(cells(values))}]" for values in (q, tau))]

    runs = written(tmp_path, ["stamp", "measurement", "torque"], listed)
    model = stranger("09_degrees_wrapped") / "arm.urdf"
    code, said = told("init", model, *runs, "--out", tmp_path / "out")
    assert code == 2
    assert "If measurement_0 to measurement_2 are yaw.position and so on" in said
    lines = said.partition("(--columns MAP.toml): ")[2].replace(" columns.", "\ncolumns.")
    (tmp_path / "known.toml").write_text(lines)
    known = ["--columns", tmp_path / "known.toml"]
    assert told("init", model, *runs, "--out", tmp_path / "out", *known)[0] == 0
    read = ["--robot", tmp_path / "out/robot.toml", "--columns", tmp_path / "out/columns.toml"]
    assert told("check", *runs, *read)[0] == 0


def test_messages_echoed_without_a_header_are_rows(told: Told, tmp_path: Path) -> None:
    """Names among the numbers made a header of the first message, and numbers of it a series."""

    def echoed(t: float, q: np.ndarray, dq: np.ndarray, tau: np.ndarray) -> list[str]:
        return [f"{1700000001 + int(t)}", f"{round(1e9 * (t % 1.0))}", *ARM, *cells(q, tau)]

    runs = written(tmp_path, [], echoed)
    for run in map(Path, runs):
        run.write_text(run.read_text().lstrip("\n"))
    code, said = told("check", *runs, "--robot", stranger("14_missing_knee_ratio") / "robot.toml")
    assert code == 2
    assert "has no header line" in said
    names = ["sec", "nanosec", "a", "b", "c"]
    names += [f"{joint}.{q}" for q in ("position", "motor_torque") for joint in ARM]
    (tmp_path / "known.toml").write_text(f"rows.header = {names}\ntime.from = 'stamp'")
    (log, *_) = load_logs(runs, tmp_path / "known.toml")
    assert log.sample_time == pytest.approx(0.01)


def test_numbers_that_differ_tell_the_joints_and_those_that_do_not_are_names(
    tmp_path: Path,
) -> None:
    """Positions and currents of a board with three axes are called after two units of it."""
    kinds = ("encoder.pos_estimate", "motor.current_control.Iq_measured")
    names = [f"odrv0.axis{k}.{kind}" for k in range(3) for kind in kinds]
    path = written(tmp_path, ["t_ms", *names], lambda t, q, dq, tau: cells(1e3 * t, q, tau))[0]
    guess = guess_names(path, ARM)
    assert guess.driven == ARM
    assert guess.table["columns"]["elbow.current"]["from"] == names[-1]
