"""The table of open-loop errors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache

from rich.console import Console, RenderableType
from rich.table import Table
from rich.text import Text

from wbc.cli.shared.inputs import working
from wbc.identification.answer.numbers import told
from wbc.identification.open_loop import OpenLoop, open_loop
from wbc.measurement import Log
from wbc.robot import Robot

SIMULATING = "simulating the logs (the first time, the simulator is compiled: about a minute)"
"""What a person reads while logs are simulated."""

Simulated = Callable[[], Sequence[OpenLoop]]
"""Returns the open-loop errors of robots, simulating when it is first called."""


def simulated_later(robots: Sequence[Robot], logs: Sequence[Log], console: Console) -> Simulated:
    """Return a function that simulates the logs once, when their errors are first wanted.

    The first simulation after the installation waits about a minute for the compiler. The answer of
    a command does not need it, so it is printed before.
    """

    @cache
    def simulated() -> Sequence[OpenLoop]:
        with working(console, SIMULATING):
            return tuple(open_loop(robot, logs) for robot in robots)

    return simulated


def open_loop_table(simulated: Sequence[OpenLoop]) -> RenderableType:
    """Return position errors after each horizon: of one robot, or as given and with what was found.

    Beside them stands how far the joint moved in that time.
    """
    first, last = simulated[0], simulated[-1]
    if last.reason:
        return Text(f"open loop: nothing was simulated: {last.reason}")
    heads = [f"{horizon:g} s" for horizon in first.horizons]
    table = Table("open loop", *heads, "", box=None)
    for column in table.columns[1:-1]:
        column.justify = "right"
    for row, (joint, unit) in enumerate(zip(first.joints, first.units, strict=True)):
        cells = []
        for k in range(len(heads)):
            errors = [told(one.error[row, k]) for one in simulated if not one.reason]
            cells.append(f"{' -> '.join(errors)} of {told(first.moved[row, k])}")
        table.add_row(joint, *cells, unit)
    table.caption = (
        "rms position error of the simulated robot so long after a measured state, of how far the "
        "joint moved"
    )
    return table
