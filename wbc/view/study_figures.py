"""What studies found: maps of designs and their front, planned motions, machines over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm, Normalize
from matplotlib.dates import ConciseDateFormatter
from matplotlib.figure import Figure
from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter

from wbc.arrays import FloatArray
from wbc.design import experiment as plans
from wbc.design.experiment import Designed, MotionLimits, Rivals
from wbc.identification.trend import Trend
from wbc.robot.coordinates import unit_at
from wbc.view.palette import LIGHT, Theme
from wbc.view.style import DASHES, drawing, legend_above, new_figure, panel_figure

MAPPED = ("lift", "hold", "backward_inertia", "impact_mitigation", "heat_saved", "holding_torque")
_SHARES = ("impact_mitigation", "heat_saved")  # between 0 and 1: evenly spread colours
_DECADE = 20.0  # largest over smallest value from which colours are spread by the logarithm
_SPREAD = 1e-6  # relative; a column that varies less than that shows nothing
Found = Mapping[str, Designed]
"""Motions by name, with what each is expected to say."""


def design_map(
    table: Mapping[str, FloatArray],
    varied: Sequence[str],
    units: Mapping[str, str],
    columns: Sequence[str],
    logarithmic: Sequence[str],
    theme: Theme = LIGHT,
) -> Figure:
    """Return one panel per metric over the first one or two parameters of a study.

    Two parameters give a coloured map; more of them, or gearboxes of a catalogue, give
    coloured points; one parameter gives a line.

    Args:
        table: columns (k,) of the study.
        varied: its parameters, the first two are drawn across and up.
        units: column -> unit.
        columns: metrics to draw; those that are constant or nowhere finite are left out.
        logarithmic: parameters to draw on a logarithmic axis.
        theme: page colours.
    """
    shown = [name for name in columns if _varies(table[name])] or columns[:1]
    with drawing(theme):
        figure, axes = panel_figure(len(shown), min(3, len(shown)), 3.9, 3.1)
        for ax, name in zip(axes, shown, strict=True):
            if len(varied) == 1:
                order = np.argsort(table[varied[0]])
                ax.plot(table[varied[0]][order], _finite(table[name])[order], color=theme.series[0])
            else:
                _map(figure, ax, table, varied, name)
            across, up = (_label(one, units) for one in (*varied, name)[:2])
            ax.set(title=_label(name, units) + _missing(table[name]), xlabel=across, ylabel=up)
            for axis, one in zip(("x", "y"), varied, strict=False):
                if one in logarithmic:
                    ax.set(**{f"{axis}scale": "log"})
                    plain_decades(getattr(ax, f"{axis}axis"))
    return figure


def pareto_figure(
    table: Mapping[str, FloatArray],
    front: Mapping[str, FloatArray],
    objectives: Sequence[str],
    coloured: str,
    units: Mapping[str, str],
    *,
    theme: Theme = LIGHT,
) -> Figure:
    """Return all designs in two objectives, the front as a line coloured by a parameter.

    Args:
        table: columns (k,) of the study.
        front: the same of the designs on the front, whose goals are finite.
        objectives: two columns, across and up.
        coloured: parameter that colours the front.
        units: column -> unit.
        theme: page colours.
    """
    all_of, best = ([designs[name] for name in objectives] for designs in (table, front))
    order = np.argsort(best[0])
    across, up, colour = best[0][order], best[1][order], front[coloured][order]
    with drawing(theme):
        figure, (ax,) = panel_figure(1, 1, 6.2, 4.2)
        ax.plot(
            *map(_finite, all_of), ".", color=theme.ink, alpha=0.25, markersize=3,
            label="all designs", rasterized=True,
        )  # fmt: skip
        ax.plot(across, up, color=theme.ink, linewidth=0.8)
        points = ax.scatter(
            across, up, c=colour, s=22, zorder=3,
            label="not beaten in both", norm=_norm(colour, coloured in _SHARES),
        )  # fmt: skip
        _bar(figure, ax, points, _label(coloured, units))
        x, y = (_label(name, units) for name in objectives)
        ax.set(title="Pareto front", xlabel=x, ylabel=y)
        ax.legend()
    return figure


def _finite(values: FloatArray) -> FloatArray:
    return np.where(np.isfinite(values), values, np.nan)


def _map(
    figure: Figure, ax: Axes, table: Mapping[str, FloatArray], varied: Sequence[str], name: str
) -> None:
    x, y, z = table[varied[0]], table[varied[1]], _finite(table[name])
    norm = _norm(z, name in _SHARES)
    across, up = np.unique(x), np.unique(y)
    if len(varied) == 2 and len(across) * len(up) == len(z):
        order = np.lexsort((x, y))
        square = np.ma.masked_invalid(z[order].reshape(len(up), len(across)))
        drawn = ax.pcolormesh(across, up, square, norm=norm, shading="nearest", rasterized=True)
        ax.grid(False)
    else:
        drawn = ax.scatter(x, y, c=z, norm=norm, s=6, rasterized=True)  # type: ignore[assignment]
    _bar(figure, ax, drawn)


def _bar(figure: Figure, ax: Axes, drawn: ScalarMappable, label: str = "") -> None:
    bar = figure.colorbar(drawn, ax=ax, label=label)
    if isinstance(drawn.norm, LogNorm):
        plain_decades(bar.ax.yaxis)


def plain_decades(axis: Axis) -> None:
    """Label a logarithmic axis with plain numbers: 1, 2, 5, 10, ..."""
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FormatStrFormatter("%g"))
    axis.set_minor_formatter(NullFormatter())


def _norm(values: FloatArray, share: bool) -> Normalize:
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
    return (LogNorm if not share and high > _DECADE * low > 0.0 else Normalize)(low, high)


def _varies(values: FloatArray) -> bool:
    finite = values[np.isfinite(values)]
    return finite.size > 1 and float(np.ptp(finite)) > _SPREAD * float(np.abs(finite).max())


def _missing(values: FloatArray) -> str:
    """Return what the empty places of a panel mean."""
    if np.isinf(values).any():
        return ", empty: unlimited"
    return ", empty: none" if np.isnan(values).any() else ""


def _label(name: str, units: Mapping[str, str]) -> str:
    unit = units.get(name, "1")
    return f"{name.replace('_', ' ')} [{'-' if unit == '1' else unit}]"


def experiment_figure(
    rivals: Rivals, limits: MotionLimits, found: Found, rate: float, theme: Theme = LIGHT
) -> Figure:
    """Return the motion on the left; on the right what the wrong cause leaves of the torque.

    It is that of the pair of causes that is told worst, for the designed and the random motion. The
    motion stands alone where no causes are told apart.

    Args:
        rivals: the causes.
        limits: of the motion.
        found: motions by name, as `wbc.design.experiment.compare_motions` returns them.
        rate: rows per second.
        theme: page colours.
    """
    designed, robot = found[plans.DESIGNED], rivals.robot
    time = designed.path.times(rate)
    position, velocity, *_ = designed.path.at(time)
    told = [(odds, pair) for pair, odds in designed.odds.items() if pair not in designed.alike]
    shown = {"designed": designed, "random": found[plans.RANDOM]} if told else {}
    misfits = {
        name: plans.predicted(rivals, limits, one.path, rate)[0].misfit(min(told)[1])
        for name, one in shown.items()
    }
    joints = robot.transmission.joints
    units = dict.fromkeys(unit_at(robot, joint, "rad") for joint in joints)
    panels = {
        f"position [{', '.join(units)}]": position,
        f"velocity [{', '.join(f'{unit}/s' for unit in units)}]": velocity,
        **{f"{n}: torque that the wrong cause leaves [noise rms]": x for n, x in misfits.items()},
    }
    with drawing(theme):
        # With one cause alone nothing is told apart.
        figure, grid = new_figure(2, 2 if misfits else 1, 9.6, 4.8, share_x=True)
        axes = [row[k] for k in range(len(grid[0])) for row in grid]
        for ax, (title, values) in zip(axes, panels.items(), strict=False):
            for i, joint in enumerate(joints):
                dashes = DASHES[i % len(DASHES)]
                ax.plot(time, values[:, i], color=f"C{i}", linestyle=dashes, label=joint)
            ax.set_title(title)
        top = max((abs(values).max() for values in misfits.values()), default=1.0)
        for ax in axes[2:]:
            ax.axhspan(-1.0, 1.0, color=theme.faint, zorder=0)  # the noise
            ax.set_ylim(-1.1 * top, 1.1 * top)
        for ax in grid[1]:
            ax.set_xlabel("time [s]")
        legend_above(figure, axes[0], min(len(joints), 6))
    return figure


def trend_figure(trend: Trend, *, theme: Theme = LIGHT) -> Figure:
    """Return a panel per quantity: a line per machine over the dates, with 90 % intervals.

    Lines of machines that surely drift are thick.

    Args:
        trend: from `wbc.identification.trend.follow`.
        theme: page colours.
    """
    drifts = (*trend.drifting, *trend.others)
    names = list(dict.fromkeys(drift.quantity for drift in drifts))
    machines = sorted({drift.machine for drift in drifts})
    with drawing(theme):
        figure, panels = panel_figure(max(len(names), 1), min(2, len(names) or 1), 4.6, 2.4)
        for ax, name in zip(panels, names, strict=False):
            for drift in (drift for drift in drifts if drift.quantity == name):
                own = [s for s in trend.sessions if s.machine == drift.machine and name in s.values]
                found = [session.values[name] for session in own]
                low, value, high = np.array([(e.low, e.value, e.high) for e in found]).T
                ax.errorbar(
                    np.array([session.date for session in own], dtype="datetime64[s]"),
                    value, (value - low, high - value), label=drift.machine, marker=".",
                    color=theme.series[machines.index(drift.machine) % len(theme.series)],
                    linewidth=2.4 if drift in trend.drifting else 0.8,
                )  # fmt: skip
                ax.set(title=name, ylabel=_label("", {"": found[0].unit}))
            ax.xaxis.set_major_formatter(ConciseDateFormatter(ax.xaxis.get_major_locator()))
        legend_above(figure, panels[0], 4)
    return figure
