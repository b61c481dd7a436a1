"""How answers are shown: tables for terminal, page and notebook, data frames, a figure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from wbc.arrays import FloatArray
from wbc.errors import MissingPackageError
from wbc.extras import needs
from wbc.identification.model.residual import condensed_residual, raw_residual
from wbc.identification.records.record import Record
from wbc.robot import Robot

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LINES = 24
"""Of a screen: what `repr` shows at most."""


def on_one_screen(text: str) -> str:
    """Return a text cut to what a screen shows."""
    lines = text.splitlines()
    if len(lines) <= _LINES:
        return text
    left = len(lines) - _LINES + 1
    return "\n".join([*lines[: _LINES - 1], f"... {left} more lines: print(...) shows all"])


def data_frame(rows: Sequence[dict[str, Any]]) -> Any:
    """Return rows as a pandas frame.

    Raises:
        MissingPackageError: pandas is not installed.
    """
    try:
        import pandas
    except ModuleNotFoundError as cause:
        raise MissingPackageError(
            "to_frame needs pandas, which no extra brings; install it with: pip install pandas. "
            "to_json() holds the same without it."
        ) from cause
    return pandas.DataFrame(list(rows))


@dataclass(frozen=True, eq=False)
class Series:
    """One log's torques over time, in the band of the residual.

    Attributes:
        name: of the log.
        time: (rows,) [s].
        measured: (rows, m) reported torque at the motor output [N m].
        residual: (rows, m + b) measured minus modelled [N m, N], weighted: near a reversal it
            counts for nothing.
        modelled: (rows, m) torque that the model needs for the motion [N m], not weighted.
    """

    name: str
    time: FloatArray
    measured: FloatArray
    residual: FloatArray
    modelled: FloatArray


def series_of(robot: Robot, records: Sequence[Record]) -> tuple[Series, ...]:
    """Return the torques that `robot` needs on logs beside those that were reported.

    Args:
        robot: with its effects.
        records: of logs, one or more.
    """
    return tuple(_series(robot, record) for record in records)


def _series(robot: Robot, record: Record) -> Series:
    gears = robot.transmission
    measured = record.condense_driven(record.torque) * abs(gears.gear_ratio)
    unexplained = record.condense_driven(raw_residual(robot, record)[:, : gears.size])
    residual = condensed_residual(robot, [record])
    return Series(record.name, record.time, measured, residual, measured - unexplained)


def torque_figure(
    outputs: Mapping[str, str], models: Sequence[tuple[str, Sequence[Series]]], log: int = 0
) -> Figure:
    """Return measured and modelled torque over time, with the residual below, per driven joint.

    Args:
        outputs: names of the driven joints, with the units of what they report.
        models: label and series of each model, of the same logs.
        log: number of the log.

    Raises:
        MissingPackageError: matplotlib is not installed.
    """
    with needs("view", "plot()"):
        from wbc.identification.answer.figure import ShownFigure
    count = len(outputs)
    figure = ShownFigure(figsize=(8.0, 2.6 * count + 0.5), layout="constrained")
    axes = figure.subplots(2 * count, 1, sharex=True, height_ratios=[2.0, 1.0] * count)
    for k, (output, unit) in enumerate(outputs.items()):
        torque, rest = axes[2 * k], axes[2 * k + 1]
        first = models[0][1][log]
        torque.plot(first.time, first.measured[:, k], color="0.15", label="measured")
        for number, (label, series) in enumerate(models):
            one, colour = series[log], f"C{1 - number % 2}"
            torque.plot(one.time, one.modelled[:, k], color=colour, linewidth=1.0, label=label)
            rest.plot(one.time, one.residual[:, k], color=colour, linewidth=1.0)
        torque.set_ylabel(f"{output} [{unit}]")
        rest.set_ylabel(f"residual [{unit}]")
        torque.legend(loc="upper right", ncols=3)
    axes[-1].set_xlabel("time [s]")
    axes[0].set_title(models[0][1][log].name.rsplit("/", 1)[-1])
    return figure
