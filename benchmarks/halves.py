"""Whether what is certain from one half of recorded logs is believed from the other, too.

    python -m benchmarks.halves DATA [--only NAME ...] [--budget SECONDS] [--json FILE]

DATA is the folder with the recorded logs. Every log is cut in the middle of its time. Printed is
every cause that is certain (0.95) from one half: its probability from the other half, with what
stands in its place, and how much its joint moved there, as a share of its rms speed here. A log
whose halves are too short for a diagnosis (0.5 s or 50 rows) is left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from rich.table import Table

from benchmarks.recorded import run_on_machines
from wbc.identification import Diagnosis, diagnose
from wbc.identification.arguments import long_enough
from wbc.measurement import Log
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
    run_on_machines(__doc__.splitlines()[0], measure)


def measure(
    machine: str, robot: Robot, logs: Sequence[Log], budget: float
) -> tuple[list[dict[str, Any]], Table]:
    """Return the certain causes of one machine, and their table."""
    found = names_of(robot, logs, budget)
    return [vars(one) | {"stable": one.stable} for one in found], table_of(machine, found)


def names_of(robot: Robot, logs: Sequence[Log], budget: float) -> list[Name]:
    """Return every cause that is certain from the first or the second half of some logs."""
    cut = [log for log in logs if all(long_enough(half(log, number)) for number in (0, 1))]
    halves = [[half(log, number) for log in cut] for number in (0, 1)]
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
