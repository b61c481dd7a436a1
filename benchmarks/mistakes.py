"""Mistakes that people make with columns, put into logs of many robots: which are found?

Every mistake is made in each way that a robot allows (each joint, each pair of joints) and in all
logs at once, and then looked for. A cell counts the ways:

    found    certain, and the mend gives the columns back
    among    something is certainly wrong, the truth is among what is named, and nothing is mended
    said     a warning with the truth in it, and nothing false is certain
    wrong    something else is certain
    silent   nothing that is true is said
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from time import process_time

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.recorded import MACHINES, ROBOTS, finish
from wbc import load_robot
from wbc.arrays import FloatArray
from wbc.errors import LogError
from wbc.identification.readings import find_suspicions
from wbc.identification.readings.mistakes import single_ratios
from wbc.measurement import Log, LogFinding, load_logs, mended, together
from wbc.robot import Robot
from wbc.robot.coordinates import slides
from wbc.samples import sample_logs

MORE = {
    "simple_pendulum": "simple_pendulum/d*.parquet",
    "ricmonk": "ricmonk/TVLQR_?xForward.parquet",
}
TORQUES = ("rotor_torque", "motor_torque", "current")
MOVING = ("position", "velocity", "acceleration", "target_position", "target_velocity")
JUDGEMENTS = ("found", "among", "said", "wrong", "silent")
_MOST_PAIRS = 6
Columns = dict[str, FloatArray]
Change = Callable[[Columns], Columns]
Mistakes = Iterator[tuple[str, str, Change]]


def scaled(factor: float, names: Sequence[str]) -> Change:
    """Return a change that multiplies columns by a factor."""

    def change(columns: Columns) -> Columns:
        return {**columns, **{n: factor * columns[n] for n in names if n in columns}}

    return change


def exchanged(a: str, b: str, quantities: Sequence[str]) -> Change:
    """Return a change that exchanges columns of two joints."""

    def change(columns: Columns) -> Columns:
        moved = {
            f"{one}.{q}": columns[f"{other}.{q}"]
            for q in quantities
            for one, other in ((a, b), (b, a))
            if f"{one}.{q}" in columns and f"{other}.{q}" in columns
        }
        return {**columns, **moved}

    return change


def mistakes(robot: Robot, log: Log) -> Mistakes:
    """Yield (mistake, clause that names it, change) for each way that a robot allows."""
    joints = [j for j in robot.transmission.joints if log.has(f"{j}.position")]
    driven = [j for j in joints if any(log.has(f"{j}.{q}") for q in TORQUES)]
    torques = [f"{j}.{q}" for j in driven for q in TORQUES if log.has(f"{j}.{q}")]
    yield "time in ms", "the time is in ms", scaled(1e3, ["time"])
    unit = "mN" if all(slides(robot, j) for j in driven) else "N mm"
    unit = "mA" if torques[0].endswith("current") else unit
    yield "torque in N mm", f" {unit}", scaled(1e3, torques)
    if len(torques) > 1:
        yield "both torque signs", "the signs of", scaled(-1.0, torques)
    for name in torques:
        yield "one torque sign", f"the sign of {name}", scaled(-1.0, [name])
    for joint in driven:
        moving = [f"{joint}.{q}" for q in MOVING]
        yield "a position's sign", f"the sign of {joint}.position", scaled(-1.0, moving)
    for joint in (j for j in joints if log.has(f"{j}.velocity")):
        speed, ratio = [f"{joint}.velocity"], single_ratios(robot).get(joint, 1.0)
        yield "a velocity's sign", "opposite signs", scaled(-1.0, speed)
        if abs(ratio) > 1.0 and not slides(robot, joint):
            yield "speed of the rotor", "that of the rotor", scaled(ratio, speed)
        if not slides(robot, joint):
            yield "speed in rpm", "in rpm", scaled(30.0 / np.pi, speed)
    turning = [j for j in robot.single_joints if not slides(robot, j)]
    if turning:
        degrees = scaled(180.0 / np.pi, [f"{j}.{q}" for j in turning for q in MOVING])
        yield "degrees", "degrees", degrees
    for a, b in list(combinations(driven, 2))[:_MOST_PAIRS]:
        both = f"{a} and {b} are exchanged"
        yield "swapped joints", f"the positions of {both}", exchanged(a, b, MOVING)
        yield "swapped torques", f"the torques of {both}", exchanged(a, b, TORQUES)


def judge(
    robot: Robot, logs: Sequence[Log], wrong: Sequence[Log], clause: str
) -> tuple[str, list[str]]:
    """Return the judgement of what is said about wrong logs, and the sentences."""
    each = find_suspicions(wrong, robot)
    texts = list(dict.fromkeys(f.text for own in each for f in own))
    certain = [[f for f in own if f.severity == "error"] for own in each]
    ratios = dict(
        zip(robot.transmission.joints, map(float, robot.transmission.gear_ratio), strict=True)
    )
    if any(certain):
        pairs = zip(logs, wrong, certain, strict=True)
        right = all(_same(log, other, found, ratios) for log, other, found in pairs)
        named = any(clause in f.text and not f.mend for own in certain for f in own)
        return "found" if right else "among" if named else "wrong", texts
    return "said" if any(clause in text for text in texts) else "silent", texts


def _same(log: Log, wrong: Log, found: Sequence[LogFinding], ratios: Mapping[str, float]) -> bool:
    """Whether the mends of a log give all its columns back."""
    try:
        back = mended(wrong, together(f.mend for f in found), dict(ratios))
    except LogError:
        return False
    columns = [(back.time, log.time)]
    columns += [(back.column(name), values) for name, values in log.columns.items()]
    return all(np.allclose(a, b, rtol=1e-6, atol=1e-9, equal_nan=True) for a, b in columns)


def sets(data: Path) -> Iterator[tuple[str, Robot, tuple[Log, ...]]]:
    """Yield name, robot and logs of the sample leg and of every recorded machine, once per log."""
    leg = load_robot("planar_leg_fixed").lossless()
    yield "sample leg", leg, sample_logs()
    yield "sample leg, one log", leg, sample_logs()[:1]
    for name, file in {**MACHINES, **MORE}.items():
        if name in ("go2", "xl330_pendulum"):
            continue  # targets and duty in the place of torques
        robot = load_robot(name)
        paths = [data / file] if "#" in file else sorted(data.glob(file))
        if not paths or not Path(str(paths[0]).partition("#")[0]).exists():
            continue
        gears = robot.transmission
        ratios = dict(zip(gears.joints, map(float, gears.gear_ratio), strict=True))
        columns = ROBOTS / name / "columns.toml"
        logs = load_logs(paths, columns if columns.exists() else None, gear_ratios=ratios)
        yield name, robot, logs[:3]
        if len(logs) > 1:
            yield f"{name}, one log", robot, logs[:1]


def main() -> None:
    """Print a table of mistakes by robots."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path)
    parser.add_argument("--only", nargs="+", metavar="NAME")
    parser.add_argument("--verbose", action="store_true", help="print what is said where not found")
    parser.add_argument("--json", metavar="FILE")
    options = parser.parse_args()
    console = Console(width=160)
    results: dict[str, dict[str, dict[str, int]]] = {}
    for name, robot, logs in sets(options.data):
        if options.only and name not in options.only:
            continue
        start = process_time()
        counts: dict[str, dict[str, int]] = {}
        alarms = [f.text for own in find_suspicions(logs, robot) for f in own if f.kind != "read"]
        counts["untouched"] = {"alarms": len(alarms)}
        for text in alarms:
            console.print(f"{name}: untouched: {text}")
        for mistake, clause, change in mistakes(robot, logs[0]):
            wrong = []
            for log in logs:
                columns = change({"time": log.time, **log.columns})
                time = columns.pop("time")
                wrong.append(replace(log, time=time, columns=columns))
            judgement, texts = judge(robot, logs, wrong, clause)
            cell = counts.setdefault(mistake, dict.fromkeys(JUDGEMENTS, 0))
            cell[judgement] += 1
            if options.verbose and judgement != "found":
                console.print(f"{name}: {mistake} ({clause}): {judgement}: {texts}", style="dim")
        results[name] = counts
        console.print(f"{name}: {process_time() - start:.1f} CPU s")
    console.print(_table(results))
    finish(console, results, options.json)


def _table(results: Mapping[str, Mapping[str, Mapping[str, int]]]) -> Table:
    rows = list(dict.fromkeys(mistake for counts in results.values() for mistake in counts))
    table = Table("found among said wrong silent", *results, box=None)
    for row in rows:
        cells = [" ".join(map(str, results[name].get(row, {}).values())) or "-" for name in results]
        table.add_row(row, *cells)
    return table


if __name__ == "__main__":
    main()
