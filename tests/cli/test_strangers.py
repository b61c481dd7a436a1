"""Files as people have them, from public reports: read right, or refused with the reason.

Each folder of the outside data holds a README with the answer that is wanted.
"""

import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from tests.columns import Columns, read_columns, write_columns
from tests.conftest import Told
from tests.outside import outside
from wbc import load_robot
from wbc.identification.readings.first_guess import guess_names
from wbc.identification.readings.mistakes import told_by_rows
from wbc.measurement import load_logs


def stranger(folder: str) -> Path:
    return outside(f"strangers/{folder}")


def described(folder: str) -> list[Path | str]:
    """Return the runs of a folder with its own robot and map, as a command takes them."""
    files = stranger(folder)
    return [*sorted(files.glob("run*.csv")), *read_by(files)]


def arm_urdf() -> Path:
    return stranger("09_degrees_wrapped") / "arm.urdf"


def arm_robot() -> list[str | Path]:
    """Return the options that give the same arm with gears that somebody looked up."""
    return ["--robot", stranger("14_missing_knee_ratio") / "robot.toml"]


def read_by(folder: Path) -> list[str | Path]:
    """Return the options that read logs as the files in a folder say."""
    return ["--robot", folder / "robot.toml", "--columns", folder / "columns.toml"]


def columns_of(folder: Path) -> dict[str, dict[str, object]]:
    return tomllib.loads((folder / "columns.toml").read_text())["columns"]


def test_a_second_log_that_cannot_be_read_leaves_nothing_behind(told: Told, tmp_path: Path) -> None:
    """A robot.toml stayed, and the command that was mended found it there already."""
    files, out = stranger("05_numbered_columns"), tmp_path / "out"
    (tmp_path / "run2.npz").write_text("no archive")
    command = ["init", files / "kuka_lwr4.urdf", files / "run1.npz"]
    assert "run2.npz" in told(*command, tmp_path / "run2.npz", "--out", out, code=2)
    assert not list(out.glob("*"))
    told(*command, "--out", out)


def test_arrays_of_seven_columns_are_seven_joints(told: Told, tmp_path: Path) -> None:
    files = stranger("05_numbered_columns")
    told("init", files / "kuka_lwr4.urdf", files / "run1.npz", "--out", tmp_path)
    (log,) = load_logs([files / "run1.npz"], tmp_path / "columns.toml")
    with np.load(files / "run1.npz") as stored:
        for quantity, name in (("position", "positions"), ("motor_torque", "torques")):
            joints = [f"lwr_{k}_joint" for k in range(7)]
            np.testing.assert_array_equal(log.stack(quantity, joints), stored[name])
    told("check", files / "run1.npz", *read_by(tmp_path))


def test_a_file_without_a_header_is_shown_with_the_map_that_names_its_columns(
    told: Told, tmp_path: Path
) -> None:
    files = stranger("06_headerless")
    command = ["init", files / "two_link.urdf", files / "slow.csv", "--out", tmp_path]
    said = told(*command, code=2)
    assert "has no header line" in said
    assert "1.003190899973560590e-02, -1.576165259552496201e+00" in said
    line = said[said.index("rows.header = ") :]
    assert line.count("column_") == 7  # the first need not be a clock: --rate tells the rows
    for name, theirs in enumerate(("time", "q1", "q2", "dq1", "dq2", "tau1", "tau2"), start=1):
        line = line.replace(f'"column_{name}"', f'"{theirs}"')
    (tmp_path / "known.toml").write_text(line)
    told(*command, "--columns", tmp_path / "known.toml")
    (log,) = load_logs([files / "slow.csv"], tmp_path / "columns.toml")
    assert set(log.with_quantity("motor_torque")) == {"joint1", "joint2"}


def test_torques_without_a_sign_are_refused(told: Told, tmp_path: Path) -> None:
    files = stranger("02_unsigned_torque")
    runs = sorted(files.glob("run*.csv"))
    said = told("init", files / "arm.urdf", *runs, "--out", tmp_path)
    assert "never below zero" in said
    assert "magnitude without sign" in said
    assert "targets" in said
    assert "sign" not in (tmp_path / "columns.toml").read_text()
    for command, refused in (("check", 1), ("diagnose", 2)):
        said = told(command, *runs, *read_by(tmp_path), code=refused)
        assert "magnitude without sign" in said


def test_angles_in_degrees_that_wrap_are_mapped_in_one_go(told: Told, tmp_path: Path) -> None:
    files = stranger("09_degrees_wrapped")
    runs = sorted(files.glob("run*.csv"))
    told("init", files / "arm.urdf", *runs, "--out", tmp_path)
    columns = columns_of(tmp_path)
    for joint in ARM:
        entry = columns[f"{joint}.position"]
        assert (entry["unit"], entry["unwrap"]) == ("deg", 360)
        assert "sign" not in columns.get(f"{joint}.motor_torque", {})
    assert "unwrap" not in told("check", *runs, *read_by(tmp_path))


def test_lists_in_a_cell_are_the_joints_along_the_chain(told: Told, tmp_path: Path) -> None:
    files = stranger("07_list_cells")
    said = told("init", files / "so101.urdf", files / "state_motor.csv", "--out", tmp_path)
    chain = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
    columns = columns_of(tmp_path)
    for k, joint in enumerate(chain):
        assert columns[f"{joint}.position"]["from"] == f"positions_{k}"
        assert "sign" not in columns[f"{joint}.motor_torque"]
    assert "magnitude without sign" in said


def test_a_clock_that_lost_its_digits_is_refused(told: Told, tmp_path: Path) -> None:
    files = stranger("08_epoch_digits")
    command = ["init", files / "kuka_lwr4.urdf", files / "run1.csv", "--out", tmp_path]
    said = told(*command, code=2)
    assert "398 of 399 rows share a time stamp" in said
    assert "digits of the clock were lost" in said
    assert "--rate" in said
    told(*command, "--rate", 200)


def test_ten_rows_of_one_stamp_are_all_used(told: Told, tmp_path: Path) -> None:
    files = stranger("11_duplicate_stamps")
    runs = sorted(files.glob("run*.csv"))
    told("init", files / "arm.urdf", *runs, "--out", tmp_path)
    assert [len(log) for log in load_logs(runs, tmp_path / "columns.toml")] == [4000, 4000, 4000]
    told("check", *runs, *read_by(tmp_path))


def test_a_held_robot_of_a_file_with_a_free_joint_is_held(told: Told, tmp_path: Path) -> None:
    files = stranger("13_mjcf_freejoint_fixed")
    model, log = files / "go2.xml", files / "a.csv"
    told("init", model, log, "--base", "fixed", "--out", tmp_path)
    assert not load_robot(tmp_path / "robot.toml").has_free_flyer
    assert "base" not in told("check", log, *read_by(tmp_path))


def test_a_torque_of_another_ratio_is_asked_about_with_its_factor(told: Told) -> None:
    """Reported over 1.917: a gear ratio, a torque constant or masses, the check cannot tell."""
    said = told("check", *described("14_missing_knee_ratio"))
    assert "all 3 logs: warning: torques of elbow are 0.5" in said
    factor = float(said.partition("torques of elbow are ")[2].partition(" times")[0])
    assert factor == pytest.approx(1.0 / 1.917, rel=0.1)
    assert "Check gear_ratio and torque constant in robot.toml" in said


def test_an_inertia_that_no_body_has_is_an_error(told: Told) -> None:
    said = told("check", *described("15_impossible_inertia"), code=2)
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
    said = told("init", folder / "so101.urdf", *logs, "--out", tmp_path)
    assert "left out, magnitudes without sign; the targets make the torque" in said
    columns = columns_of(tmp_path)
    assert columns["elbow_flex.motor_torque"] is False
    assert columns["elbow_flex.target_position"]["from"] == "control_positions_2"
    said = told("check", *logs, *read_by(tmp_path))
    # What is alike in all joints and logs is said once.
    assert said.count("samples) behind the position") == 1
    assert "all 2 logs: warning: shoulder_pan.velocity, shoulder_lift.velocity, " in said
    log = load_logs(logs[:1], tmp_path / "columns.toml")[0]
    assert 40.0 < 1.0 / log.sample_time < 60.0
    target, position = (log.column(f"elbow_flex.{q}") for q in ("target_position", "position"))
    assert np.std(target - position) < 0.2


ARM = ("yaw", "shoulder", "elbow")


def changed_runs(
    source: Path, folder: Path, change: Callable[[Columns, int], object]
) -> list[Path]:
    """Write the runs of a folder, each with its columns changed."""
    paths = []
    for k in (1, 2, 3):
        columns = read_columns(source / f"run{k}.csv")
        change(columns, k)
        paths.append(write_columns(columns, folder / f"run{k}.csv"))
    return paths


def arm_runs(folder: Path, change: Callable[[Columns, int], object]) -> list[Path]:
    return changed_runs(stranger("15_impossible_inertia"), folder, change)


def without_torque(columns: Columns, _: int) -> None:
    random = np.random.default_rng(0)
    for joint in ARM:
        columns[f"{joint}.position"] = np.round(columns[f"{joint}.position"] * 4096 / (2.0 * np.pi))
        columns[f"{joint}.motor_torque"] = random.normal(size=len(columns["time"]))


def with_sign_bits(columns: Columns, _: int) -> None:
    """Positions as counts of 4096 a turn whose bit 15 is the sign."""
    for joint in ARM:
        counts = np.round(columns[f"{joint}.position"] * 4096 / (2.0 * np.pi))
        columns[f"{joint}.position"] = np.where(counts < 0.0, 32768 - counts, counts)


def test_the_torque_tells_how_many_counts_with_a_bit_of_sign_make_a_turn(
    told: Told, tmp_path: Path
) -> None:
    runs = arm_runs(tmp_path, with_sign_bits)
    said = told("init", arm_urdf(), *runs, "--out", tmp_path)
    assert "bit 15 is a sign" in said
    assert "hold counts of an encoder of 4096 a turn?" in said
    assert "degrees" not in said
    told("check", *runs, *read_by(tmp_path))


def test_counts_of_which_no_torque_says_more_are_asked_for(told: Told, tmp_path: Path) -> None:
    said = told("check", *arm_runs(tmp_path, without_torque), *arm_robot(), code=1)
    assert "encoder counts" in said
    for joint in ARM:
        assert f'columns."{joint}.position" = {{ scale = 0.001533980788 }}' in said


@pytest.mark.parametrize("rows", [slice(0, None, 2), slice(300, 360)])
def test_after_the_check_says_so_rows_with_holes_are_dropped(
    rows: slice, told: Told, tmp_path: Path
) -> None:
    def holed(columns: Columns, _: int) -> None:
        columns["shoulder.motor_torque"][rows] = np.nan

    runs = arm_runs(tmp_path, holed)
    told("init", arm_urdf(), *runs[:1], "--out", tmp_path)
    read = ["--robot", tmp_path / "robot.toml"]
    said = told("check", *runs, *read, "--fix", tmp_path / "fix.toml", code=1)
    assert "shoulder.motor_torque is needed" in said
    told("check", *runs, *read, "--columns", tmp_path / "fix.toml")


JOINT_STATES = ("name", "position", "effort")


@dataclass(frozen=True)
class Writing:
    """How somebody writes a run: column names, a row of time, q, dq and torque, and what else."""

    head: list[str]
    row: Callable[[float, np.ndarray, np.ndarray, np.ndarray], list[str]]
    mark: str = ","
    above: str = ""

    def runs(self, folder: Path) -> list[Path]:
        """Write the three runs of a right arm."""
        paths = []
        for source in sorted(stranger("15_impossible_inertia").glob("run*.csv")):
            time, *others = read_columns(source).values()
            q, tau = np.stack(others[0::2], axis=1), np.stack(others[1::2], axis=1)
            rows = zip(time, q, np.gradient(q, time, axis=0), tau, strict=True)
            lines = [self.mark.join(self.head), *(self.mark.join(self.row(*each)) for each in rows)]
            paths.append(folder / source.name)
            paths[-1].write_text(self.above + "\n".join(lines) + "\n", encoding="utf-8")
        return paths


def cells(*parts: object) -> list[str]:
    return [f"{number:.9g}" for number in np.concatenate([np.atleast_1d(part) for part in parts])]


def with_commas(*parts: object) -> list[str]:
    return [cell.replace(".", ",") for cell in cells(*parts)]


def named(name: str, *kinds: str) -> list[str]:
    """Return the names of three joints' columns, kind after kind."""
    return [name.format(kind, k) for kind in kinds for k in (1, 2, 3)]


BERLIN, DENVER = np.datetime64("2024-05-03T12:01:02.000000"), datetime(2025, 3, 14, 13, 59, 51)
FROM_ONE = Writing(["t", *named("{}{}", "q", "dq", "tau")], cells)
WRITINGS = {
    # As buses are read: the motors of a stamp one after another, named by a column.
    "a row for each motor": Writing(
        ["Time(ms)", "ID", "Position (rad)", "Torque (Nm)"],
        lambda t, q, dq, tau: [
            "\n".join(f"{1e3 * t:.0f},{k + 1},{q[k]:.9g},{tau[k]:.9g}" for k in range(3))
        ],
    ),
    # A trace of a cabinet: lines without columns, a blank line, decimal commas between tabs.
    "lines about the file": Writing(
        [
            "Zeit [s]",
            *(f"AxisAct.A{k} [deg]" for k in (1, 2, 3)),
            *(f"MotTorque.A{k} [Nm]" for k in (1, 2, 3)),
        ],
        lambda t, q, dq, tau: with_commas(t, np.degrees(q), tau),
        mark="\t",
        above="Robot Trace;C4\nDate;2024-03-01\n\n",
    ),
    # Nested names, joints in alphabetical order, named in cells.
    "a bag": Writing(
        ["__time", *(f"/joint_states/{q}[{k}]" for q in JOINT_STATES for k in range(3))],
        lambda t, q, dq, tau: [f"{1.7e9 + t:.6f}", *ARM[::-1], *cells(q[::-1], tau[::-1])],
    ),
    "a vendor": Writing(
        ["Time (s)", *named("J{1}_{0}", "ActPos (deg)", "ActVel (deg/s)", "ActTorque (Nm)")],
        lambda t, q, dq, tau: cells(t, np.degrees(q), np.degrees(dq), tau),
    ),
    # A line of a spreadsheet, semicolons, decimal commas; ISO dates in a nameless column.
    "dates": Writing(
        ["Messpunkt", *named("{} {}", "Position", "Drehmoment")],
        lambda t, q, dq, tau: [
            str(BERLIN + np.timedelta64(round(1e6 * t), "us")),
            *with_commas(q, tau),
        ],
        mark=";",
        above="sep=;\n",
    ),
    "microseconds": Writing(
        ["timestamp_us", *(f"joint_{q}_{k}" for q in ("pos", "torque") for k in range(3))],
        lambda t, q, dq, tau: [str(1714737662000000 + round(1e6 * t)), *cells(q, tau)],
        above="# robot: arm 3\n# operator: night shift\n",
    ),
    "numbers from one": FROM_ONE,
    "American dates": Writing(
        ["When", *(f"{joint} [°]" for joint in ARM), *(f"{joint}_Nm" for joint in ARM)],
        lambda t, q, dq, tau: [
            f"{DENVER + timedelta(seconds=t):%m/%d/%Y %I:%M:%S.%f %p}",
            *cells(np.degrees(q), tau),
        ],
    ),
    # The stamp in two columns; what all columns are called says nothing about the joint.
    "a topic": Writing(
        [
            *(f"/arm/joint_states/header/stamp/{part}" for part in ("sec", "nanosec")),
            *(f"/arm/joint_states/{j}/{q}" for q in ("position", "effort") for j in ARM[::-1]),
        ],
        lambda t, q, dq, tau: [
            f"{1700000001 + int(t)}",
            f"{round(1e9 * (t % 1.0))}",
            *cells(q[::-1], tau[::-1]),
        ],
    ),
}


@pytest.mark.parametrize("kind", WRITINGS)
def test_files_of_nine_kinds_become_the_same_logs(kind: str, told: Told, tmp_path: Path) -> None:
    runs = WRITINGS[kind].runs(tmp_path)[:1]
    said = told("init", arm_urdf(), *runs, "--out", tmp_path / "out")
    assert "elbow: motion and torque alone tell its columns with 100 %" in said
    columns = tmp_path / "out" / "columns.toml"
    right = load_logs([stranger("15_impossible_inertia") / "run1.csv"])[0]
    (log,) = load_logs(runs, columns)
    np.testing.assert_allclose(log.time - log.time[0], right.time - right.time[0], atol=1e-6)
    for quantity in ("position", "motor_torque"):
        np.testing.assert_allclose(
            log.stack(quantity, ARM), right.stack(quantity, ARM), rtol=1e-7, atol=1e-9
        )
    told("check", *runs, *read_by(tmp_path / "out"))


def test_init_says_that_a_joint_mimics_another(told: Told, tmp_path: Path) -> None:
    mimic, text = tmp_path / "mimic.urdf", arm_urdf().read_text()
    end = text.index("</joint>", text.index('<joint name="elbow"'))
    mimic.write_text(f'{text[:end]}<mimic joint="shoulder" multiplier="1"/>{text[end:]}')
    said = told("init", mimic, *FROM_ONE.runs(tmp_path), "--out", tmp_path / "out")
    assert "joint 'elbow' mimics 'shoulder'" in said


KINOVA, UR5, XARM = "24_kinova_outside_wind", "27_ur5_null", "26_xarm7_outside_belt"


def shortened(columns: Columns, _: int) -> None:
    columns |= {name: values[:40] for name, values in columns.items()}


def with_losses(columns: Columns, _: int) -> None:
    """Of every second 0.6 s are missing."""
    kept = columns["time"] % 1.0 < 0.4
    columns |= {name: values[kept] for name, values in columns.items()}


def beyond_its_stops(columns: Columns, _: int) -> None:
    columns["shoulder.position"] += 60.0


def of_noise(columns: Columns, _: int) -> None:
    torque = columns["elbow.motor_torque"]
    torque[:] = np.random.default_rng(0).normal(0.0, torque.std(), len(torque))


def held_still(columns: Columns, _: int) -> None:
    """One value, .199993, has a deviation of rounding: gear ratios were accused for certain."""
    columns |= {n: v if n == "time" else np.full(len(v), v[0]) for n, v in columns.items()}


def of_another_robot(columns: Columns, k: int) -> None:
    """None follows its need, which no likelihood of one joint alone refuses."""
    other = read_columns(outside(f"foreign/{XARM}/run{k}.csv"))
    for joint in (1, 2, 3):
        told = np.interp(columns["time"], other["time"], other[f"joint{joint}.motor_torque"])
        columns[f"j2s6s200_joint_{joint}.motor_torque"] = told


def turned(columns: Columns, _: int) -> None:
    """The first joint turns about the vertical and leaves most of its torque: friction and wind."""
    columns["j2s6s200_joint_3.position"] += np.pi / 2.0


def late(columns: Columns, _: int) -> None:
    time = columns["time"]
    torques = [name for name in columns if name.endswith("torque")]
    columns |= {name: np.interp(time - 0.05, time, columns[name]) for name in torques}


@pytest.mark.parametrize(
    ("case", "change", "refused", "says"),
    [
        ("", shortened, 1, "0.39 s with 40 rows are too"),
        ("", with_losses, 1, "samples are missing"),
        ("", beyond_its_stops, 1, "the zero of shoulder.position"),
        ("", of_noise, 1, "the torque of elbow does not follow"),
        (XARM, held_still, 1, "no joint moves"),
        (KINOVA, of_another_robot, 1, "does not follow what the links need"),
        (KINOVA, turned, 0, "perhaps the zero of j2s6s200_joint_3.position is off by 90 degrees"),
        (KINOVA, late, 0, "lag by 50 ms"),
    ],
)
def test_what_is_wrong_is_said_and_what_a_comparison_refuses_the_check_does_not_approve(
    case: str, change: Callable[..., None], refused: int, says: str, told: Told, tmp_path: Path
) -> None:
    source = outside(f"foreign/{case}") if case else stranger("15_impossible_inertia")
    runs, read = changed_runs(source, tmp_path, change), read_by(source) if case else arm_robot()
    said = told("check", *runs, *read, code=refused)
    assert says in said
    assert "gear ratios" not in said
    if refused:
        told("compare", *runs, *read, code=2)


def test_a_wrist_with_a_rotor_that_nobody_described_is_no_stranger(
    told: Told, tmp_path: Path
) -> None:
    """Behind a gear of 101 the rotor of a wrist is most of its torque; the check refused it."""
    source = outside(f"foreign/{UR5}")
    runs = [source / f"run{k}.csv" for k in (1, 2, 3)]
    told("init", source / "robot.urdf", *runs, "--out", tmp_path)
    told("check", *runs, *read_by(tmp_path))


def test_one_log_whose_zero_is_another_one_gets_a_map_of_its_own(
    told: Told, tmp_path: Path
) -> None:
    def moved(columns: Columns, k: int) -> None:
        columns["joint3.position"] += 0.3 * (k == 2)

    source = outside(f"foreign/{XARM}")
    runs, read = changed_runs(source, tmp_path, moved), read_by(source)
    said = told("check", *runs, *read, "--fix", tmp_path / "fix.toml", code=1)
    assert "run2.csv: error: joint3.position: the zero of joint3.position is off" in said
    assert "LOG@MAP.toml" in said
    assert not (tmp_path / "fix.toml").exists()  # the other logs are right
    offset = said.partition("{ offset = ")[2].partition(" }")[0]
    assert float(offset) == pytest.approx(-0.3, abs=0.02)
    own = f'columns."joint3.position" = {{ offset = {offset} }}'
    (tmp_path / "own.toml").write_text(own)
    mended = [runs[0], f"{runs[1]}@{tmp_path / 'own.toml'}", runs[2]]
    told("check", *mended, *read)


@pytest.mark.parametrize("pause", [30.0, 0.004])
def test_two_runs_of_one_file_are_two(pause: float, told: Told, tmp_path: Path) -> None:
    """The clock pauses, or just goes on while the joints leap: that was taken for a counter."""
    source = outside(f"foreign/{XARM}")
    first, second = (read_columns(source / f"run{k}.csv") for k in (1, 2))
    second["time"] += first["time"][2399] + pause - second["time"][700]
    both = {name: np.append(first[name][:2400], second[name][700:2400]) for name in first}
    path, read = write_columns(both, tmp_path / "both.csv"), read_by(source)
    assert "jumps" not in told("check", path, *read)
    shares = told_by_rows(load_robot(read[1]), load_logs([path], read[3]))
    assert len(shares) == 4
    assert np.min(np.round([*shares.values()], 2)) >= 0.99
    told("compare", path, *read)


def test_a_series_shorter_than_the_chain_is_named_as_a_whole(told: Told, tmp_path: Path) -> None:
    """q_0 to q_3 of joint1 to joint7: three were named by their numbers, and q_0 the fourth."""
    source = outside(f"foreign/{XARM}")
    time, *others = read_columns(source / "run1.csv").values()
    q, tau = np.stack(others[0::3], axis=1), np.stack(others[2::3], axis=1)
    np.savez(tmp_path / "run.npz", t=time, q=q, tau=tau)
    said = told("init", source / "robot.urdf", tmp_path / "run.npz", "--out", tmp_path)
    assert "exchanged" not in said
    for k in range(4):
        assert columns_of(tmp_path)[f"joint{k + 1}.position"]["from"] == f"q_{k}"


def test_vectors_whose_name_says_nothing_are_asked_about_with_lines_that_work(
    told: Told, tmp_path: Path
) -> None:
    def listed(t: float, q: np.ndarray, dq: np.ndarray, tau: np.ndarray) -> list[str]:
        return [f"{t:.6f}", *(f"[{' '.join(cells(values))}]" for values in (q, tau))]

    runs = Writing(["stamp", "measurement", "torque"], listed).runs(tmp_path)
    said = told("init", arm_urdf(), *runs, "--out", tmp_path / "out", code=2)
    assert "If measurement_0 to measurement_2 are yaw.position and so on" in said
    lines = said.partition("(--columns MAP.toml): ")[2].replace(" columns.", "\ncolumns.")
    (tmp_path / "known.toml").write_text(lines)
    known = ["--columns", tmp_path / "known.toml"]
    told("init", arm_urdf(), *runs, "--out", tmp_path / "out", *known)
    told("check", *runs, *read_by(tmp_path / "out"))


def test_messages_echoed_without_a_header_are_rows(told: Told, tmp_path: Path) -> None:
    """Names among the numbers made a header of the first message, and numbers of it a series."""

    def echoed(t: float, q: np.ndarray, dq: np.ndarray, tau: np.ndarray) -> list[str]:
        return [f"{1700000001 + int(t)}", f"{round(1e9 * (t % 1.0))}", *ARM, *cells(q, tau)]

    runs = Writing([], echoed).runs(tmp_path)
    for run in runs:
        run.write_text(run.read_text().lstrip("\n"))
    assert "has no header line" in told("check", *runs, *arm_robot(), code=2)
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
    writing = Writing(["t_ms", *names], lambda t, q, dq, tau: cells(1e3 * t, q, tau))
    guess = guess_names(writing.runs(tmp_path)[0], ARM)
    assert guess.driven == ARM
    assert guess.table["columns"]["elbow.current"]["from"] == names[-1]
