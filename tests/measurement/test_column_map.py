"""Column maps: names, units, signs, rows; maps that messages print, upon other maps."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from wbc import load_robot
from wbc.errors import LogError
from wbc.identification.readings import check_robot
from wbc.measurement import load_log, load_logs, merged, parse_column_map, write_map
from wbc.measurement.column_map import lines, read_table


def _write(folder: Path, text: str, rows: str) -> tuple[Path, Path]:
    (folder / "map.toml").write_text(text)
    (folder / "log.csv").write_text(rows)
    return folder / "log.csv", folder / "map.toml"


MAP = """
time = { from = "t_ms", unit = "ms", offset = 1.0 }
[columns."hip.position"]
from = "theta"
unit = "deg"
side = "rotor"
gear_ratio = 20
sign = -1
offset = 0.5
[columns]
hip.velocity = { from = "n", unit = "rpm", side = "rotor", gear_ratio = 20 }
hip.current = { from = "i", unit = "mA" }
hip.rotor_torque = { from = "tau", side = "motor", gear_ratio = 20 }
hip.rotor_position = { from = "theta", unit = "deg" }
"j6.position" = { from = ["m6", "m5"], weights = [1, -1], side = "rotor", gear_ratio = [32, 45] }
knee.motor_torque = { from = "u", side = "rotor" }
knee.velocity = { sign = -1 }
knee.current = "arm.duty"
arm.velocity = false
"""
ROWS = """t_ms,theta,n,i,tau,m5,m6,u,knee.velocity,arm.duty,arm.velocity,a.goal_position,a.voltage
0,0,60,500,40,45,64,1,2,3,4,5,6
2,720,60,500,40,90,64,2,4,5,6,7,nan
"""
MEANT = {
    "hip.position": [0.5, 0.5 - 4 * np.pi / 20],
    "hip.velocity": 2 * np.pi / 20,
    "hip.current": 0.5,
    "hip.rotor_torque": 2.0,
    "hip.rotor_position": [0.0, 4 * np.pi],
    "j6.position": [1.0, 0.0],  # a coupled wrist
    "knee.motor_torque": [-6.0, -12.0],  # by the robot's gear ratio
    "knee.velocity": [-2.0, -4.0],  # a map is a patch: names that are valid pass through
    "knee.current": [3.0, 5.0],  # and the former name does not, too
    "a.target_position": [5.0, 7.0],  # read by its former name
}


def test_names_units_signs_offsets_and_sides_become_ours(tmp_path: Path) -> None:
    files = _write(tmp_path, MAP, ROWS)
    log = load_log(*files, gear_ratios={"knee": -6.0})
    assert set(log.names) == set(MEANT)
    np.testing.assert_allclose(log.time, [1.0, 1.002])
    for column, values in MEANT.items():
        np.testing.assert_allclose(log.column(column), values, atol=1e-15, err_msg=column)
    assert log.has("a.goal_position")
    assert log.source.mapping.endswith("map.toml")
    assert log.source.ignored == ()
    # Only a column that is needed must have no hole.
    with pytest.raises(LogError, match=r"'a.voltage' holds nan at row 1 \(1 such rows of 2"):
        log.column("a.voltage")
    with pytest.raises(LogError, match=r"map\.toml: columns\.knee\.motor_torque.*gear_ratio"):
        load_log(*files)


def test_repeated_stamps_missing_cells_and_files_without_a_clock(tmp_path: Path) -> None:
    text = 'time.repeated = "first"\ncolumns."hip.current" = "i"\n'
    text += 'columns."hip.position" = { from = "q", missing = "drop_rows" }'
    log = load_log(*_write(tmp_path, text, "time,q,i\n0.0,1,\n0.1,2,\n0.1,3,\n0.2,,\n0.3,5,\n"))
    np.testing.assert_array_equal(log.time, [0.0, 0.1, 0.3])
    np.testing.assert_array_equal(log.column("hip.position"), [1.0, 2.0, 5.0])
    assert log.names == ("hip.position",)
    notes = " ".join(log.source.notes)
    assert "hip.current left out" in notes
    assert "2 of 5 rows dropped" in notes
    files = _write(tmp_path, 'time.rate = 50.0\ncolumns."hip.position" = "q"', "q\n1\n2\n3\n")
    np.testing.assert_allclose(load_log(*files).time, [0.0, 0.02, 0.04])


def test_one_file_is_split_into_logs_and_rows_are_chosen(tmp_path: Path) -> None:
    text = """
    [rows]
    split = "run"
    where = { robot = "leg*", run = "?" }
    between = [0.05, 1.0]
    [columns]
    "hip.position" = "q"
    """
    rows = ["run,robot,time,q"]
    for run, robot in (("b", "leg1"), ("a", "leg2"), ("c", "arm"), ("long", "leg1")):
        rows += [f"{run},{robot},{k * 0.1:.1f},{k}" for k in range(4)]
    files = _write(tmp_path, text, "\n".join(rows) + "\n")
    logs = load_logs([files[0]], files[1])
    assert [log.source.part for log in logs] == ["b", "a"]
    np.testing.assert_array_equal(logs[0].column("hip.position"), [1.0, 2.0, 3.0])
    assert load_log(f"{files[0]}#a", files[1]).source.part == "a"
    with pytest.raises(LogError, match=r"holds 2 logs.*There are: b, a"):
        load_log(*files)
    with pytest.raises(LogError, match=r"no log 'z'.*There are: b, a"):
        load_log(f"{files[0]}#z", files[1])
    files[1].write_text(text.replace('"leg*"', '"hand"'))
    with pytest.raises(LogError, match="There are: leg1 with b, leg2 with a, arm with c, leg1"):
        load_log(*files)


RULE = '[columns]\n"hip.position" = '


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[columns", ["cannot read the column map"]),
        ("[time]\nalign_velocity = 1", ["time.align_velocity: true or false"]),
        ("trusted = 1", ["trusted: true or false"]),
        ("[colums]\na = 1", ["Unknown section 'colums'", "Did you mean 'columns'"]),
        (RULE + '{ from = "q", unt = "deg" }', ["columns.hip.position", "Did you mean 'unit'"]),
        (RULE + '{ from = "q", unit = "degs" }', [".position.unit", "Did you mean 'deg'"]),
        (RULE + '{ from = "q", unit = "N m" }', ["measures [N m]", "needs [rad or m]"]),
        (RULE + '{ from = "q", scale = "x" }', ["columns.hip.position.scale", "'x'"]),
        (RULE + '{ from = "q", scale = 0 }', ["must not be 0"]),
        (RULE + '{ from = "q", side = "left", gear_ratio = 2 }', ["side: one of rotor"]),
        (RULE + '{ from = "q", side = "rotor", gear_ratio = 0 }', ["0 is no gear"]),
        (RULE + '{ from = "q", gear_ratio = 20 }', ["gear_ratio without side"]),
        (RULE + '{ from = ["a", "b"], weights = [1] }', ["1 numbers for 2 foreign columns"]),
        (RULE + '{ from = "q", missing = "zero" }', ["missing: one of", "drop_rows"]),
        ('[columns]\n"hip.positon" = "q"', ["Did you mean 'hip.position'"]),
        ('[columns]\n"hip.current" = { from = "q", side = "rotor", gear_ratio = 2 }', ["no side"]),
        (RULE + '"q"\n[time]\nfrm = "t"', ["time", "Did you mean 'from'"]),
        (RULE + '"q"\n[time]\nunit = "m"', ["time.unit", "[m]"]),
        (RULE + '"q"\n[time]\nrate = -1', ["rate above 0"]),
        (RULE + '"q"\n[rows]\nbetween = [2, 1]', ["rows.between"]),
        (RULE + '"angle"', ["Unknown column of", "'angle'", "There are: time, q"]),
        (RULE + '"q"\n[rows]\nsplit = "run"', ["rows", "'run'", "There are: time, q"]),
    ],
)
def test_errors_name_the_map_and_the_key(text: str, words: list[str], tmp_path: Path) -> None:
    files = _write(tmp_path, text, "time,q\n0,1\n0.1,2\n")
    with pytest.raises(LogError) as caught:
        load_log(*files)
    for word in ["map.toml", *words]:
        assert word in str(caught.value)


def test_a_flag_that_comes_back_begins_another_log_and_mixed_rows_are_taken_apart(
    tmp_path: Path,
) -> None:
    def split(flag: np.ndarray, times: np.ndarray) -> tuple[Path, Path]:
        rows = [f"{0.01 * t:.2f},{f},{k}" for k, (t, f) in enumerate(zip(times, flag, strict=True))]
        text = "\n".join(["time,phase,hip.position", *rows, ""])
        return _write(tmp_path, 'rows.split = "phase"', text)

    path, columns = split(np.arange(8) % 2, np.arange(8) // 2)
    for k, log in enumerate(load_logs([path], columns)):
        np.testing.assert_array_equal(log.column("hip.position"), [k, k + 2, k + 4, k + 6])
    files = split(np.repeat([0, 1, 0, 1], 30), np.arange(120))
    logs = load_logs([files[0]], files[1])
    assert [log.source.part for log in logs] == ["0/1", "1/1", "0/2", "1/2"]
    for k, log in enumerate(logs):
        np.testing.assert_array_equal(log.column("hip.position"), np.arange(30 * k, 30 * k + 30))
    assert load_log(f"{files[0]}#0/2", files[1]).time[0] == pytest.approx(0.6)


def test_channels_recorded_at_times_of_their_own_are_bridged(tmp_path: Path) -> None:
    """As PlotJuggler writes topics side by side: no row holds all of them."""
    rows = "time,slide.position,slide.motor_torque\n" + "".join(
        f"{0.01 * k:.3f},{k},\n{0.01 * k + 0.004:.3f},,{k + 0.4}\n" for k in range(20)
    )
    path = _write(tmp_path, "", rows)[0]
    with pytest.raises(LogError, match=r"'slide\.position' holds nan at row 1"):
        load_log(path)
    log = load_logs([path])[0]
    with pytest.raises(LogError, match='missing = "bridge"'):
        log.column("slide.motor_torque")
    (finding,) = check_robot(log, load_robot("emps"))
    assert finding.kind == "missing"
    log = load_log(path, parse_column_map(finding.mend))
    np.testing.assert_allclose(log.time, 0.01 * np.arange(1, 20))
    np.testing.assert_allclose(log.column("slide.position"), np.arange(1, 20))
    np.testing.assert_allclose(log.column("slide.motor_torque"), np.arange(1, 20))


V, Q, KNEE = "hip.velocity", "hip.position", "knee.position"
ROTOR, MOTOR = "hip.rotor_torque", "hip.motor_torque"


@pytest.mark.parametrize(
    ("first", "second", "expected"),
    [
        ({}, {V: {"sign": -1}}, {V: {"sign": -1}}),
        ({V: {"from": "w", "sign": -1}}, {V: {"sign": -1}}, {V: {"from": "w"}}),
        ({ROTOR: "u", Q: "q"}, {MOTOR: {"from": ROTOR}}, {Q: "q", MOTOR: {"from": "u"}}),
        ({Q: "a", KNEE: "b"}, {Q: KNEE, KNEE: Q}, {Q: {"from": "b"}, KNEE: {"from": "a"}}),
        ({"hip": {"position": "q"}}, {V: False}, None),
    ],
)
def test_mends_upon_a_map_become_one_map(first: dict, second: dict, expected: dict | None) -> None:
    table = merged({"time": {"from": "t"}, "columns": first}, {"columns": second})
    if expected is not None:
        assert table == {"time": {"from": "t"}, "columns": expected}
    parse_column_map(table, gear_ratios={"hip": 20.0})


def test_printed_lines_and_written_files_are_toml_of_the_same_meaning(tmp_path) -> None:
    mend = {
        "trusted": True,
        "time": {"unit": "ms"},
        "columns": {"a b.velocity": {"from": 'w"1', "scale": 0.5}, "hip.velocity": False},
    }
    assert tomllib.loads("\n".join(lines(mend))) == mend
    path = write_map(tmp_path / "map.toml", mend, ["guessed"])
    assert read_table(path) == mend
    assert path.read_text().startswith("# guessed\n")
