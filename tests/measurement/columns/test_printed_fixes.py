"""Every column map that a message prints is copied out of the message, and works."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from wbc.effects import load_robot
from wbc.errors import LogError
from wbc.measurement import Log, check_log, read_logs

Columns = dict[str, np.ndarray]


def printed_map(message: str) -> str:
    """Return the first map in a message: what stands behind the colon, or the lines below it."""
    found = re.search(
        r"\(--columns MAP\.toml\):(?: (\S.*?)(?:;|$)|\n((?: {4}.*\n?)+))", message, re.M
    )
    assert found, message
    return found[1] or found[2]


def write(columns: Columns, path: Path) -> Path:
    table = np.column_stack(list(columns.values()))
    np.savetxt(path, table, delimiter=",", header=",".join(columns), comments="", fmt="%.12g")
    return path


def repeated(columns: Columns) -> Columns:
    time = columns["time"].copy()
    time[100] = time[99]
    return {**columns, "time": time}


def holed(columns: Columns) -> Columns:
    position = columns["hip.position"].copy()
    position[100] = np.nan
    return {**columns, "hip.position": position}


def wrapped(columns: Columns) -> Columns:
    return {**columns, "knee.position": np.mod(4.0 * columns["knee.position"], 2.0 * np.pi)}


def late(columns: Columns) -> Columns:
    time = columns["time"]
    speed = 2.0 * np.cos(4.0 * (time - 0.006)) + 3.3 * np.cos(11.0 * (time - 0.006))
    return {
        **columns,
        "hip.position": 0.5 * np.sin(4.0 * time) + 0.3 * np.sin(11.0 * time),
        "hip.velocity": speed,
    }


def in_degrees(columns: Columns) -> Columns:
    return {**columns, **{n: np.degrees(columns[n]) for n in ("hip.position", "hip.velocity")}}


def misspelt(columns: Columns) -> Columns:
    return {name.replace("hip.position", "hip.positon"): v for name, v in columns.items()}


def refusal(path: Path) -> str:
    """Return what reading says, or what asking for the hip's position says."""
    with pytest.raises(LogError) as caught:
        read_logs([path])[0].column("hip.position")
    return str(caught.value)


def finding(kind: str) -> Callable[[Path], str]:
    def said(path: Path) -> str:
        robot = load_robot("planar_leg_fixed")
        robot.model.lowerPositionLimit[:], robot.model.upperPositionLimit[:] = -3.0, 3.0
        (log,) = read_logs([path])
        found = check_log(log.select([n for n in log.names if "torque" not in n]), robot)
        return found.of_kind(kind)[0].way_out

    return said


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (repeated, refusal),
        (holed, refusal),
        (misspelt, refusal),
        (wrapped, finding("wrap")),
        (late, finding("clock_lag")),
        (in_degrees, finding("range")),
        (lambda c: {**c, "time": 1e3 * c["time"]}, finding("time_unit")),
        (lambda c: {**c, "hip.velocity": -c["hip.velocity"]}, finding("velocity_sign")),
        (lambda c: {**c, "hip.velocity": 20.0 * c["hip.velocity"]}, finding("gear_side")),
    ],
)
def test_a_printed_map_mends_what_it_was_printed_for(
    change: Callable[[Columns], Columns],
    said: Callable[[Path], str],
    swing: Log,
    tmp_path: Path,
) -> None:
    columns = change({"time": swing.time, **swing.columns})
    path, fix = write(columns, tmp_path / "run.csv"), tmp_path / "map.toml"
    fix.write_text(printed_map(said(path)))
    (log,) = read_logs([path], fix, gear_ratios={"hip": 20.0, "knee": 20.0})
    assert log.has("hip.position", "hip.velocity", "knee.position")
    kept = np.isin(np.round(swing.time, 9), np.round(log.time, 9))
    if change in (late, wrapped):
        expected = {late: "hip.velocity", wrapped: "knee.position"}[change]
        slope = np.gradient(log.column(expected.replace("velocity", "position")), log.time)
        seen = log.column(expected.replace("position", "velocity"))
        factor = 4.0 if change is wrapped else 1.0
        assert np.abs(slope - factor * seen)[5:-5].max() < 0.02 * np.abs(slope).max()
        return
    for name in ("hip.position", "hip.velocity", "knee.velocity"):
        np.testing.assert_allclose(log.column(name), swing.column(name)[kept], atol=1e-9)
