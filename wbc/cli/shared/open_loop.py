"""The table of open-loop errors."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from wbc.identification.answer.numbers import told
from wbc.identification.open_loop import OpenLoop

SIMULATING = "simulating the logs (the first time, the simulator is compiled: about a minute)"
"""What a person reads while logs are simulated."""


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
