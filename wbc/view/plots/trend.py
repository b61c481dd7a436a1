"""What machines show over time, with intervals; those that drift stand out."""

from __future__ import annotations

from datetime import datetime

import numpy as np
from matplotlib.axes import Axes
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter
from matplotlib.figure import Figure

from wbc.identification.trend import Drift, Trend
from wbc.view.palette import LIGHT, Theme
from wbc.view.plots.style import drawing, new_figure

_COLUMNS = 2
_QUIET = 0.35


def trend_figure(trend: Trend, theme: Theme = LIGHT) -> Figure:
    """Return a panel per quantity: a line per machine over the dates, with 90 % intervals.

    Machines that drift are drawn in colour and named; the others are grey, or named too where
    there are few.

    Args:
        trend: from `follow`.
        theme: page colours.
    """
    quantities = list(dict.fromkeys(drift.quantity for drift in _ordered(trend)))
    machines = list(dict.fromkeys(session.machine for session in trend.sessions))
    rows = -(-len(quantities) // _COLUMNS)
    with drawing(theme):
        columns = min(_COLUMNS, len(quantities))
        figure, grid = new_figure(rows, columns, 5.2 * columns, 2.5 * rows + 0.4)
        axes = [ax for row in grid for ax in row]
        for ax, quantity in zip(axes, quantities, strict=False):
            drifts = {d.machine: d for d in trend.drifts if d.quantity == quantity}
            _panel(ax, trend, drifts, machines, theme)
        for ax in axes[len(quantities) :]:
            ax.set_visible(False)
    return figure


def _ordered(trend: Trend) -> list[Drift]:
    return [*trend.drifting, *trend.drifts]


def _panel(
    ax: Axes, trend: Trend, drifts: dict[str, Drift], machines: list[str], theme: Theme
) -> None:
    first = next(iter(drifts.values()))
    few = len(drifts) <= len(theme.series)
    loud = [name for name in machines if name in drifts and (few or drifts[name].drifts)]
    for name in machines:
        if name not in drifts:
            continue
        own = [s for s in trend.sessions if s.machine == name and first.quantity in s.values]
        estimates = [s.values[first.quantity] for s in own]
        dates = np.array([datetime.fromisoformat(s.date) for s in own])
        value = np.array([e.value for e in estimates])
        away = np.abs([[e.value - e.low, e.high - e.value] for e in estimates]).T
        shown = name in loud
        colour = theme.series[loud.index(name) % len(theme.series)] if shown else theme.ink
        drifting = drifts[name].drifts
        ax.errorbar(
            dates,
            value,
            yerr=away,
            color=colour,
            alpha=1.0 if shown else _QUIET,
            linewidth=2.2 if drifting else 1.0,
            marker="o",
            markersize=3.5,
            capsize=2.0,
            elinewidth=0.8,
            label=f"{name}{' drifts' if drifting else ''}" if shown else None,
        )
    unit = "" if first.unit == "1" else f" [{first.unit}]"
    ax.set_title(first.name)
    ax.set_ylabel(f"{first.quantity[2].replace('_', ' ')}{unit}")
    locator = AutoDateLocator(maxticks=6)
    ax.xaxis.set_major_locator(locator)
    ax.xaxis.set_major_formatter(ConciseDateFormatter(locator))
    if loud:
        ax.legend(fontsize=8)
