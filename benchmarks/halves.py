"""Whether what is certain from one half of recorded logs is believed from the other, too.

    python -m benchmarks.halves DATA [--only NAME ...] [--budget SECONDS] [--json FILE]

DATA is the folder with the recorded logs. Every log is cut in the middle of its time. Printed is
every cause that is certain (0.95) from one half: its probability from the other half, with what
stands in its place, and how much its joint moved there, as a share of its rms speed here.
"""

from __future__ import annotations

import argparse
import json
import platform
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from math import inf
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.classic_fit import MACHINES, ROBOTS
from wbc import load_robot
from wbc.files import write_text
from wbc.identification import Diagnosis, diagnose
from wbc.measurement import Log, load_logs
from wbc.robot import Robot

CERTAIN, BELIEVED = 0.95, 0.5


@dataclass(frozen=True)
class Name:
    """A cause that is certain from one half.

    Attributes:
        half: 1 or 2.
        effect: its name.
        where: its place.
        here: probability from this half.
        there: probability from the other one, of the cause or of what it ties with.
        moved: rms speed of its joint there over that here, not a number where it has none.
    """

    half: int
    effect: str
    where: str
    here: float
    there: float
    moved: float

    @property
    def stable(self) -> bool:
        """Whether the other half believes it."""
        return self.there >= BELIEVED


def main() -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("--only", nargs="+", choices=MACHINES, default=list(MACHINES))
    parser.add_argument("--budget", type=float, default=inf, help="of each diagnosis [s]")
    parser.add_argument("--json", metavar="FILE")
    options = parser.parse_args()
    console = Console()
    results = {}
    for name in options.only:
        path = options.data / MACHINES[name]
        if not Path(str(path).partition("#")[0]).exists():
            console.print(f"{name}: no logs at {path}")
            continue
        robot = load_robot(name).lossless()
        logs = load_logs([str(path)], ROBOTS / name / "columns.toml")
        found = names_of(robot, logs, options.budget)
        results[name] = [vars(one) | {"stable": one.stable} for one in found]
        console.print(table_of(name, found))
    console.print(
        f"wbc {version('wbc')}, Python {platform.python_version()}, numpy {np.__version__}, "
        f"{platform.machine()}"
    )
    if options.json:
        write_text(Path(options.json), json.dumps(results, indent=2) + "\n")


def names_of(robot: Robot, logs: Sequence[Log], budget: float) -> list[Name]:
    """Return every cause that is certain from the first or the second half of some logs."""
    halves = [[half(log, number) for log in logs] for number in (0, 1)]
    answers = [diagnose(robot, part, budget=budget) for part in halves]
    found = []
    for number, (own, other) in enumerate(zip(answers, reversed(answers), strict=True)):
        for finding in own.findings:
            if finding.probability < CERTAIN:
                continue
            effect = finding.effect
            here, there = (
                speed(part, effect.where) for part in (halves[number], halves[1 - number])
            )
            found.append(
                Name(
                    half=number + 1,
                    effect=effect.name,
                    where=effect.where,
                    here=round(finding.probability, 3),
                    there=round(believed(other, effect.key), 3),
                    moved=round(there / here, 2) if here else float("nan"),
                )
            )
    return found


def half(log: Log, number: int) -> Log:
    """Return the first (0) or the second (1) half of a log."""
    middle = len(log.time) // 2
    rows = slice(0, middle) if number == 0 else slice(middle, None)
    columns = {name: values[rows] for name, values in log.columns.items()}
    return Log(log.time[rows], columns, log.source)


def believed(answer: Diagnosis, key: tuple[str, str]) -> float:
    """Return the probability of a cause, or of the one that it may stand for, else zero."""
    found = [
        f.support.group_probability
        for f in answer.findings
        if key in (f.effect.key, *((a.effect, a.where) for a in f.alternatives))
    ]
    return max(found, default=0.0)


def speed(logs: Sequence[Log], joint: str) -> float:
    """Return the rms speed of a joint over some logs; zero where it has none."""
    moved = [
        np.gradient(log.columns[f"{joint}.position"], log.time)
        for log in logs
        if f"{joint}.position" in log.columns
    ]
    return float(np.sqrt(np.mean(np.concatenate(moved) ** 2))) if moved else 0.0


def table_of(machine: str, found: Sequence[Name]) -> Table:
    """Return what is certain from one half, for a reader."""
    table = Table("half", "cause", "here", "other half", "speed there / here", title=machine)
    for name in found:
        where = f"{name.effect} at {name.where}"
        text = f"{name.there:.3f}" + ("" if name.stable else "  not believed")
        table.add_row(str(name.half), where, f"{name.here:.3f}", text, f"{name.moved:.2f}")
    stable = sum(name.stable for name in found)
    table.caption = f"{stable} of {len(found)} certain causes are believed from the other half"
    return table


if __name__ == "__main__":
    main()
