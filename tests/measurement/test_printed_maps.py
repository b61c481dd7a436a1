"""Every column map that a message prints is copied out of the message, and works."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from tests.columns import Columns, read_columns, write_columns
from tests.moved import exact_log
from wbc.effects import load_robot
from wbc.errors import IdentificationError, LogError
from wbc.identification import compare
from wbc.identification.readings import check_log, mistakes as suspicions
from wbc.identification.readings.first_guess import guess_names
from wbc.measurement import Log, load_logs
from wbc.robot import Motion

RATIOS = {"hip": 20.0, "knee": 20.0}


def printed_maps(message: str) -> list[str]:
    """Return the maps in a message: the indented lines below each mention of one."""
    return re.findall(r"\(--columns MAP\.toml\):\n((?: {4}.*(?:\n|$))+)", message)


def renamed(old: str, new: str) -> Callable[[Columns], Columns]:
    return lambda columns: {name.replace(old, new): v for name, v in columns.items()}


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


def stale(columns: Columns) -> Columns:
    """Every fiftieth row is one of zeros, from a second publisher."""
    at = np.isin(np.arange(len(columns["time"])), np.arange(25, len(columns["time"]), 50))
    return {n: v if n == "time" else np.where(at, 0.0, v + 1.0) for n, v in columns.items()}


def late(columns: Columns) -> Columns:
    time = columns["time"]
    speed = 2.0 * np.cos(4.0 * (time - 0.006)) + 3.3 * np.cos(11.0 * (time - 0.006))
    position = 0.5 * np.sin(4.0 * time) + 0.3 * np.sin(11.0 * time)
    return {**columns, "hip.position": position, "hip.velocity": speed}


def in_degrees(columns: Columns) -> Columns:
    return {**columns, **{n: np.degrees(columns[n]) for n in ("hip.position", "hip.velocity")}}


def in_degrees_beside_noise(columns: Columns) -> Columns:
    """Drives that report noise alone: the torque does not tell degrees."""
    noise = np.random.default_rng(0).normal(0.0, 0.3, (2, len(columns["time"])))
    return {**in_degrees(columns), "hip.rotor_torque": noise[0], "knee.rotor_torque": noise[1]}


def told(action: Callable[[], Any]) -> str:
    with pytest.raises((LogError, IdentificationError)) as caught:
        action()
    return str(caught.value)


def reading(path: Path) -> str:
    """Return what reading says, or what asking for the hip's position says."""
    return told(lambda: load_logs([path])[0].column("hip.position"))


def from_arrays(path: Path) -> str:
    columns = read_columns(path)
    return told(lambda: Log(columns.pop("time"), columns))


def finding(kind: str, *, turning: bool = False) -> Callable[[Path], str]:
    def said(path: Path) -> str:
        robot = load_robot("planar_leg_fixed")
        ends = np.inf if turning else 3.0
        robot.model.lowerPositionLimit[:], robot.model.upperPositionLimit[:] = -ends, ends
        (log,) = load_logs([path])
        found = check_log(log.select([n for n in log.names if "torque" not in n]), robot)
        return found.of_kind(kind)[0].way_out

    return said


def note(path: Path) -> str:
    return "\n".join(load_logs([path])[0].source.notes)


def refused(path: Path) -> str:
    return told(lambda: compare(load_robot("planar_leg_fixed"), load_logs([path])))


def without_torque(path: Path) -> str:
    """Return what the check says, and the same lines from a comparison."""
    robot, logs = load_robot("planar_leg_fixed"), load_logs([path])
    (found,) = check_log(logs[0], robot).of_kind("no_torque")
    assert printed_maps(told(lambda: compare(robot, logs))) == printed_maps(found.way_out)
    return found.way_out


def trusting(path: Path) -> str:
    logs = load_logs([path], gear_ratios=RATIOS)
    return told(lambda: suspicions.suspicions(load_robot("planar_leg_fixed"), logs))


def guessing(path: Path) -> str:
    return told(lambda: guess_names(path, ["hip", "knee"]))


TORQUES = ("hip.motor_torque", "knee.motor_torque")


@dataclass(frozen=True)
class Case:
    """A mistake, where its message comes from, and what stands for words that a person fills in."""

    change: Callable[[Columns], Columns]
    said: Callable[[Path], str]
    filled: tuple[tuple[str, str], ...] = ()


CASES = {
    "a time stamp twice": Case(repeated, reading),
    "a time stamp for ten rows": Case(
        lambda c: {**c, "time": np.repeat(c["time"][::10], 10)}, reading
    ),
    "a hole": Case(holed, reading),
    "a hole that is needed": Case(holed, finding("missing")),
    "a misspelt column": Case(renamed("hip.position", "hip.positon"), reading),
    "a misspelt clock": Case(renamed("time", "tme"), reading),
    "no clock": Case(renamed("time", "stamp"), reading, (("CLOCK", "stamp"), ("100", "500"))),
    "a time stamp twice in arrays": Case(repeated, from_arrays),
    "a hole in arrays": Case(holed, from_arrays),
    "jumps of a turn": Case(wrapped, finding("wrap")),
    "rows of zeros": Case(stale, trusting),
    "a late velocity": Case(late, finding("clock_lag")),
    "beyond the limits": Case(in_degrees, finding("range")),
    "many turns": Case(in_degrees, finding("range", turning=True)),
    "far beyond the limits": Case(in_degrees_beside_noise, refused),
    "milliseconds without velocity": Case(
        lambda c: {n: 1e3 * v if n == "time" else v for n, v in c.items() if "vel" not in n},
        finding("time_unit"),
    ),
    "a torque that was not read": Case(renamed("knee.motor_torque", "tau_knee"), without_torque),
    "torques that were not read": Case(
        lambda c: renamed("hip.motor_torque", "tau1")(renamed("knee.motor_torque", "tau2")(c)),
        without_torque,
    ),
    "a torque with a name that says nothing": Case(
        renamed("knee.motor_torque", "x3"), without_torque, (("COLUMN", "x3"),)
    ),
    "a position that was not read": Case(renamed("knee.position", "knee_angle"), refused),
    "a channel that was not read": Case(renamed("hip.position", "pos_hip"), reading),
    "an effort": Case(renamed("motor_torque", "effort"), note),
    "no position": Case(
        lambda c: {n.replace("position", "x").replace("velocity", "y"): v for n, v in c.items()},
        guessing,
        (("COLUMN", "hip.x"),),
    ),
}


@pytest.fixture
def right(swing: Log) -> Columns:
    """The swing with the torque that the leg needs for it, so that wrong torques show."""
    robot = load_robot("planar_leg_fixed").lossless()
    q, v = (swing.stack(quantity, list(RATIOS)) for quantity in ("position", "velocity"))
    log = exact_log(robot, Motion(q, v, np.gradient(v, swing.time, axis=0), swing.time))
    motor = {name: 20.0 * log.column(name.replace("motor", "rotor")) for name in TORQUES}
    columns = {name: swing.columns[name] for name in swing.names if "torque" not in name}
    return {"time": swing.time, **columns, **motor}


@pytest.mark.parametrize("name", CASES)
def test_a_printed_map_mends_what_it_was_printed_for(
    name: str, right: Columns, tmp_path: Path
) -> None:
    case = CASES[name]
    path = write_columns(case.change(right), tmp_path / "run.csv")
    maps = printed_maps(case.said(path))
    assert maps, case.said(path)
    for k, text in enumerate(maps):
        fix = tmp_path / f"map{k}.toml"
        for word, given in case.filled:
            text = text.replace(word, given)
        fix.write_text(text)
        (log,) = load_logs([path], fix, gear_ratios=RATIOS)
        _assert_mended(name, log, right, text)


def _assert_mended(name: str, log: Log, right: Columns, text: str) -> None:
    if text.strip() == "trusted = true":
        assert suspicions.suspicions(load_robot("planar_leg_fixed"), [log])  # warns, raises not
        return
    expected, kept = dict(right), np.isin(np.round(right["time"], 9), np.round(log.time, 9))
    assert np.count_nonzero(kept) > (1950 if name == "rows of zeros" else 1990)
    assert log.has("hip.position")
    assert log.has("knee.position") or name == "no position"
    if name == "a late velocity":
        slope = np.gradient(log.column("hip.position"), log.time)[5:-5]
        seen = log.column("hip.velocity")[5:-5] if log.has("hip.velocity") else slope
        assert np.abs(slope - seen).max() < 0.02 * np.abs(slope).max()
        return
    if name == "rows of zeros":
        expected = {n: v + 1.0 for n, v in right.items()}
    elif name == "jumps of a turn":
        expected["knee.position"] = 4.0 * right["knee.position"]
    elif name == "an effort":
        (given,) = [one for one in log.names if "motor_torque" not in one and one not in right]
        expected[given] = right[f"{given.partition('.')[0]}.motor_torque"]
    elif name == "far beyond the limits":
        log = log.select([one for one in log.names if "torque" not in one])  # made noise
    for column, values in log.columns.items():
        np.testing.assert_allclose(values, expected[column][kept], rtol=1e-9, atol=1e-9)


def test_the_printed_map_that_splits_a_file_makes_it_readable(tmp_path: Path) -> None:
    path, fix = tmp_path / "runs.parquet", tmp_path / "map.toml"
    table = {"time": [0.0, 0.1, 0.0, 0.1], "hip.position": [1.0, 2.0, 3.0, 4.0]}
    pq.write_table(pa.table({**table, "run": ["a", "a", "b", "b"]}), path)
    (text,) = printed_maps(told(lambda: load_logs([f"{path}#b"])))
    fix.write_text(text)
    (log,) = load_logs([f"{path}#b"], fix)
    assert log.column("hip.position")[0] == 3.0
