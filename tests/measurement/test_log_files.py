"""Files of logs: written and read, and bad ones; units and vectors as people write them."""

import tempfile
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings, strategies as st
from hypothesis.extra.numpy import arrays

from wbc.cli import main
from wbc.errors import LogError
from wbc.identification.readings.first_guess import guess_names
from wbc.measurement import Log, load_log, load_logs, save_log
from wbc.measurement.names import guess_name

FINITE = st.floats(allow_nan=False, allow_infinity=False, width=64)


@st.composite
def logs(draw: st.DrawFn) -> Log:
    rows = draw(st.integers(2, 30))
    steps = draw(arrays(np.float64, rows, elements=st.floats(1e-4, 0.01)))
    name = st.from_regex(r"[a-z_][a-z0-9_. ,]{0,8}[a-z]", fullmatch=True)
    names = st.lists(name, min_size=1, unique=True)
    values = arrays(np.float64, rows, elements=FINITE)
    return Log(np.cumsum(steps), {f"{name}.current": draw(values) for name in draw(names)[:4]})


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".npz"])
@settings(max_examples=40, deadline=None)
@given(log=logs())
def test_what_is_written_is_read_back_bit_by_bit(suffix: str, log: Log) -> None:
    with tempfile.TemporaryDirectory() as folder:
        read = load_log(save_log(log, Path(folder) / f"log{suffix}"))
    np.testing.assert_array_equal(read.time, log.time)
    assert read.names == log.names
    for name in log.names:
        np.testing.assert_array_equal(read.column(name), log.column(name))


def test_a_failed_write_leaves_the_old_file(swing: Log, tmp_path: Path) -> None:
    path = save_log(swing, tmp_path / "log.csv")
    before = path.read_bytes()
    with pytest.raises(LogError, match=r"\.csv, \.parquet, \.npz"):
        save_log(swing, tmp_path / "log.mat")
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["log.csv"]


GOOD = "time,hip.position,mood\n0.0,1.0,good\n0.1,2.0,bad\n0.2,3.0,good\n"


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.csv", b"", ["is empty"]),
        ("a.csv", b"time,hip.position\n", ["is empty", "no rows"]),
        ("a.csv", b"time,hip.position\n0.0,1.0\n0.1\n0.2,1\n", ["Expected 2 columns, got 1"]),
        ("a.csv", b"time,hip.position\n0.0,1.0\n0.1,abc\n", ["holds 'abc' at row 1"]),
        ("a.csv", b"time;hip.position\n0;1,2,3\n", ["holds '1,2,3' at row 0"]),
        ("a.csv", b"time,hip.position\n0,0,1,5\n0,1,1,5\n", ["decimal commas between commas?"]),
        ("a.csv", b"time,hip.position\n0.0,1.0\n0.1,\n", ["'hip.position' holds nan at row 1"]),
        ("a.csv", b"time,hip.position\n0.0,1\n0.1,1\n0.1,2\n", ["repeats at row 2", "repeated"]),
        ("a.csv", b"t,hip.position\n0,1\n", ["'time'", "are: t, hip.position", "time.from"]),
        ("a.csv", b"time,hip.positon\n0.0,1.0\n", ["'hip.positon' looks like 'hip.position'"]),
        ("a.csv", b"time,q1,q2\n0.0,1.0,2.0\n", ["wbc init", "time, q1, q2"]),
        ("a.csv", b"time,a.current,a.current\n0,1,2\n", ["called 'a.current'", "rows.header = "]),
        ("run 1.csv", b"time,x\n0,1\n1,2\n2,3\n", ["`wbc init MODEL '/", "run 1.csv'`"]),
        ("a.csv", b"\xff\x00\x01", ["cannot read", "as CSV"]),
        ("a.parquet", b"PAR1 and then nothing", ["cannot read", "Parquet", "damaged"]),
        ("a.npz", b"PK and then nothing", ["cannot read", "NPZ"]),
        ("a.xlsx", b"anything", ["'.xlsx' is not read", ".parquet"]),
    ],
)
def test_bad_files_say_what_is_wrong(
    name: str, content: bytes, words: list[str], tmp_path: Path
) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(LogError) as caught:
        load_log(path)
    for word in [str(path), *words]:
        assert word in str(caught.value)


@pytest.mark.parametrize(
    "head",
    [
        "%time,field.position0,field.name0\n",  # `rostopic echo -p`
        "# run 7\n# time field.position0 field.name0\n",
        "time,field,field\n,position0,name0\n",  # pandas, columns with two levels
        "joint,field,field\nkind,position0,name0\ntime,,\n",  # ... and a named index
        "time,field,field\n,position0,name0\ns,rad,\n",
        "Bench 4.2\nmade by: x, on: y\n\ntime,field.position0,field.name0\n",
    ],
)
def test_names_stand_in_comments_or_in_several_lines(head: str, tmp_path: Path) -> None:
    path, columns = tmp_path / "run.csv", tmp_path / "map.toml"
    path.write_text(head + "0,1.5,hip\n0.1,1.6,hip\n0.2,1.7,hip\n")
    between = "." if "field.position0" in head else " "
    columns.write_text(f'columns."hip.position" = "field{between}position0"')
    log = load_log(path, columns)
    np.testing.assert_array_equal(
        [log.time, log.column("hip.position")], [[0, 0.1, 0.2], [1.5, 1.6, 1.7]]
    )


def test_a_parquet_cut_off_in_the_middle_is_an_error(swing: Log, tmp_path: Path) -> None:
    path = save_log(swing, tmp_path / "log.parquet")
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(LogError, match="damaged"):
        load_log(path)
    damaged = bytearray(whole)
    damaged[200:2000] = bytes(1800)
    path.write_bytes(bytes(damaged))
    with pytest.raises(LogError, match=r"log\.parquet"):
        load_log(path)
    pq.write_table(pa.table({"time": [0.0, 1.0], "hip.position": ["a", "b"]}), path)
    with pytest.raises(LogError, match="holds 'a' at row 0 instead of numbers"):
        load_log(path)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (np.arange(4.0), r"differ in length: time 3, hip\.position 4"),
        (np.array([{}, {}, {}]), "Python objects"),
        (np.array(["a", "b", "c"]), "instead of numbers"),
        (np.zeros((3, 2)), "shape"),
        (np.zeros((3, 2, 2)), r"'hip.position' has shape \(3, 2, 2\), expected \(rows,\) or"),
    ],
    ids=["ragged", "pickled", "text", "two columns", "three axes"],
)
def test_arrays_that_are_no_columns_are_refused(
    values: np.ndarray, words: str, tmp_path: Path
) -> None:
    path = tmp_path / "log.npz"
    np.savez(path, **{"time": np.arange(3.0), "hip.position": values})
    with pytest.raises(LogError, match=words):
        load_log(path)


def test_a_hash_picks_a_log_only_where_a_map_splits_the_file(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(GOOD)
    with pytest.raises(LogError, match=r"nothing splits the file. Leave .#part. out"):
        load_logs([f"{path}#part"])
    odd = tmp_path / "log#1.csv"
    odd.write_text(GOOD)
    log = load_log(odd)
    assert (len(log), log.names, log.source.ignored) == (3, ("hip.position",), ("mood",))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time;hip.position\n0;1,25\n0,5;-2,5e-1\n", "decimal commas"),
        ("time hip.position\n0   1.25\n 0.5 -0.25\n", "blanks stand between"),
        ("time\thip.position\n0\t1.25\n0.5\t-0.25\n0.6\n", "the last row was cut off"),
        ("# t in s\n# time hip.position\n0 1.25\n0.5 -0.25\n", "2 comment lines"),
        ("time,hip.position,\n0,1.25,\n# a lap\n0.5,-0.25,\n", ""),
        ("time,hip.position,note\n0,1.25,f\u00fcr\n0.5,-0.25,\n", "read as Latin-1"),
        ("time, hip.position\n2024-03-01T12:00:00Z, 1.25\n2024-03-01T12:00:00.5Z, -0.25\n", ""),
        ("time,hip.position\n2024-03-01 12:00:00,1.25\n2024-03-01 12:00:00.5,-0.25\n", ""),
        ("time;hip.position\n01.03.2024 12:00:00,0;1,25\n01.03.2024 12:00:00,5;-0,25\n", ""),
    ],
)
def test_what_stands_between_and_above_the_numbers_is_found(
    text: str, said: str, tmp_path: Path
) -> None:
    path = tmp_path / "log.csv"
    for encoding in ("latin-1",) if "Latin" in said else ("utf-8", "utf-8-sig", "utf-16"):
        path.write_text(text, encoding=encoding)
        log = load_log(path)
        np.testing.assert_allclose(log.column("hip.position"), [1.25, -0.25])
        np.testing.assert_allclose(log.time, [0.0, 0.5])
        assert said in " ".join(log.source.notes)


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".npz"])
def test_a_file_larger_than_memory_is_refused(
    suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    time = np.arange(5000) * 0.01
    path = save_log(Log(time, {"hip.position": np.sin(time)}), tmp_path / f"log{suffix}")
    monkeypatch.setattr("wbc.measurement.formats.memory", lambda: 100_000)
    with pytest.raises(LogError, match="too large for the memory: cut it, or keep every n-th"):
        load_log(path)


@pytest.mark.parametrize(
    ("unit", "factor"),
    [("mNm", 1e-3), ("N mm", 1e-3), ("Nmm", 1e-3), ("N*mm", 1e-3), ("Ncm", 1e-2), ("Nm", 1.0)],
)
def test_a_torque_in_any_spelling_of_its_unit(unit: str, factor: float, tmp_path: Path) -> None:
    """A line of units below the header named Nmm, and the torque was taken for N m."""
    path, fix = tmp_path / "run.csv", tmp_path / "map.toml"
    path.write_text("time,hip.rotor_torque\n0,100\n0.1,200\n")
    fix.write_text(f'columns."hip.rotor_torque" = {{ unit = "{unit}" }}\n')
    mapped = load_log(path, fix).column("hip.rotor_torque")
    np.testing.assert_allclose(mapped, [100.0 * factor, 200.0 * factor])
    path.write_text(f"time,hip.rotor_torque\n[s],[{unit}]\n0,100\n0.1,200\n")
    np.testing.assert_allclose(load_log(path).column("hip.rotor_torque"), mapped)
    path.write_text(f"time,hip.rotor_torque\n[ms],[{unit}]\n0,100\n100,200\n")
    np.testing.assert_allclose(load_log(path).time, [0.0, 0.1])


@pytest.mark.parametrize(
    ("name", "quantity", "unit", "owner"),
    [
        ("hip_torque_mNm", "motor_torque", "mN m", "hip"),
        ("hip_torque [N mm]", "motor_torque", "N mm", "hip"),
        ("tau1_Nmm", "motor_torque", "N mm", "1"),
        ("hipTorqueMNm", "motor_torque", "mN m", "hip"),
        ("hip_current_mA", "current", "mA", "hip"),
        ("hip_vel_mm/s", "velocity", "mm/s", "hip"),
        ("hip_v", "velocity", "", "hip"),
        ("hip_temp [deg C]", "temperature", "deg C", "hip"),
        ("q_1", "position", "", "1"),
        ("Position [rev] 1", "position", "rev", "1"),
        ("q[1] [deg]", "position", "deg", "1"),
        ("pos_deg_1", "position", "deg", "1"),
        ("position_reference", "target_position", "", ""),
        ("torque_measurement", "motor_torque", "", ""),
        ("vel_deg_per_s_1", "velocity", "deg/s", "1"),
        ("axis0.motor.current_control.Iq_measured", "current", "", "axis_0_iq"),
        ("tau_ext_hat_filtered[0]", "", "", "ext_hat_filtered_0"),
    ],
)
def test_the_unit_in_a_name_is_read_whole(name: str, quantity: str, unit: str, owner: str) -> None:
    """The m of mNm and mA went to the joint's name, and the torque was a thousand times too large.

    `wbc init` wrote a map that read mN m as N m.
    """
    found = guess_name(name)
    assert (found.quantity, found.unit, found.owner) == (quantity, unit, owner)


def test_torques_of_another_topic_are_those_of_the_joint_that_is_named(tmp_path: Path) -> None:
    """A joint without any beside others with one got no gear, and nobody said so."""
    path = tmp_path / "run.csv"
    names = ["/joint_states/hip/position", "/joint_states/knee/position", "/torques/hip/effort"]
    path.write_text(",".join(["time", *names]) + "\n0,1,2,3\n0.1,1,2,3\n")
    guess = guess_names(path, ("hip", "knee"))
    assert guess.table["columns"]["hip.motor_torque"] == {"from": "/torques/hip/effort"}
    assert guess.driven == ("hip",)
    assert "knee: no torque or current" in guess.reasons[-1]


def test_joints_of_a_bag_are_the_same_for_motion_and_effort(tmp_path: Path) -> None:
    """Where the joints of the robot have other names, the efforts were not found."""
    path = tmp_path / "run.csv"
    names = [f"fer_joint{k}.{q}" for k in (1, 2) for q in ("position", "velocity", "effort")]
    path.write_text(",".join(["time", *names]) + "\n0,1,2,3,4,5,6\n0.1,1,2,3,4,5,6\n")
    joints = ("arm_joint1", "arm_joint2", "arm_finger_joint1", "arm_finger_joint2")
    guess = guess_names(path, joints)
    assert guess.table["columns"]["arm_joint2.motor_torque"] == {"from": "fer_joint2.effort"}
    assert guess.driven == ("arm_joint1", "arm_joint2")


TIME = np.arange(300) / 30.0
MODEL = """<mujoco><worldbody>
<body name="a"><joint name="pan" axis="0 0 1"/>
<geom type="capsule" fromto="0 0 0 0 0 .2" size=".02"/>
<body name="b" pos="0 0 .2"><joint name="lift" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0 0 .2" size=".02"/></body></body></worldbody></mujoco>"""


def test_the_files_of_a_lerobot_dataset_are_read_as_its_vectors(tmp_path: Path) -> None:
    """Two episodes in one file, whose clock starts again; no map is needed."""
    (tmp_path / "arm.xml").write_text(MODEL)
    state = np.stack([np.sin(TIME), 0.5 * np.cos(2.0 * TIME)], axis=1)
    vectors = {"observation.state": state, "action": 1.01 * state}
    pair = pa.list_(pa.float64(), 2)
    columns = {name: pa.array(list(np.tile(rows, (2, 1))), pair) for name, rows in vectors.items()}
    path = tmp_path / "episodes.parquet"
    pq.write_table(pa.table({**columns, "timestamp": np.tile(TIME, 2)}), path)
    assert main(["init", str(tmp_path / "arm.xml"), str(path), "--out", str(tmp_path / "out")]) == 0
    first, second = load_logs([path], tmp_path / "out" / "columns.toml")
    joints = ["pan", "lift"]
    np.testing.assert_array_equal(second.stack("position", joints), state)
    np.testing.assert_array_equal(first.stack("target_position", joints), 1.01 * state)


@pytest.mark.parametrize("order", ["C", "F"])
def test_arrays_of_two_axes_and_two_runs_of_one_file_are_taken_apart(
    order: str, tmp_path: Path
) -> None:
    path, names = tmp_path / "run.npz", tmp_path / "map.toml"
    positions = np.array(np.stack([np.sin(TIME), np.cos(TIME)], axis=1), order=order)
    np.savez(path, time=np.tile(TIME, 2), q=np.array(np.tile(positions, (2, 1)), order=order))
    names.write_text('columns."hip.position" = "q_0"\ncolumns."knee.position" = "q_1"\n')
    assert [log.source.part for log in load_logs([path], names)] == ["run1", "run2"]
    log = load_log(f"{path}#run2", names)
    np.testing.assert_array_equal(log.stack("position", ["hip", "knee"]), positions)
