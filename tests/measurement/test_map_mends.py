"""What a message prints as a way out is a column map that works, alone and upon another map."""

from __future__ import annotations

import tomllib

import pytest

from wbc.measurement import merged, parse_column_map, write_map
from wbc.measurement.findings import lines, read_table


@pytest.mark.parametrize(
    ("first", "second", "expected"),
    [
        ({}, {"hip.velocity": {"sign": -1}}, {"hip.velocity": {"sign": -1}}),
        (
            {"hip.velocity": {"from": "w", "unit": "rpm", "sign": -1}},
            {"hip.velocity": {"sign": -1}},
            {"hip.velocity": {"from": "w", "unit": "rpm"}},
        ),
        (
            {"hip.rotor_torque": "u", "hip.position": "q"},
            {"hip.motor_torque": {"from": "hip.rotor_torque"}},
            {"hip.position": "q", "hip.motor_torque": {"from": "u"}},
        ),
        (
            {"hip.position": "a", "knee.position": "b"},
            {"hip.position": "knee.position", "knee.position": "hip.position"},
            {"hip.position": {"from": "b"}, "knee.position": {"from": "a"}},
        ),
        ({"hip": {"position": "q"}}, {"hip.velocity": False}, None),
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
