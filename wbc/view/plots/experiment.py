"""A planned motion, and where along it the rival causes come apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from wbc.arrays import FloatArray
from wbc.view.palette import LIGHT, Theme
from wbc.view.plots.style import DASHES, drawing, legend_above, new_figure


def experiment_figure(
    joints: Mapping[str, str],
    time: FloatArray,
    motion: tuple[FloatArray, FloatArray],
    misfits: Mapping[str, FloatArray],
    *,
    theme: Theme = LIGHT,
) -> Figure:
    """Return the motion on the left; on the right what the wrong cause leaves of the torque.

    Args:
        joints: names of the m driven joints, with the units of their positions.
        time: (N,) [s].
        motion: positions and velocities (N, m) [rad, m; rad/s, m/s].
        misfits: name of a motion -> (N, m) in units of the noise of one row, at most two; the
            motion stands alone without any.
        theme: page colours.
    """
    with drawing(theme):
        sides = 2 if misfits else 1  # with one cause alone nothing is told apart
        figure, grid = new_figure(2, sides, 9.6, 4.8, share_x=True)
        for row, (values, label) in enumerate(
            zip(motion, (("position", ""), ("velocity", "/s")), strict=True)
        ):
            name, per = label
            units = ", ".join(f"{unit}{per}" for unit in dict.fromkeys(joints.values()))
            _lines(grid[row][0], list(joints), time, values)
            grid[row][0].set_title(f"{name} [{units}]")
        for row, (name, values) in enumerate(list(misfits.items())[:2]):
            axes = grid[row][1]
            _lines(axes, list(joints), time, values)
            axes.axhspan(-1.0, 1.0, color=theme.faint, zorder=0)  # the noise
            axes.set_title(f"{name}: torque that the wrong cause leaves [noise rms]")
        top = max((abs(values).max() for values in misfits.values()), default=1.0)
        for row in range(2) if misfits else ():
            grid[row][1].set_ylim(-1.1 * top, 1.1 * top)
            grid[row][1].set_visible(row < len(misfits))
        for axes in grid[1]:
            axes.set_xlabel("time [s]")
        legend_above(figure, grid[0][0], min(len(joints), 6))
    return figure


def _lines(axes: Axes, joints: Sequence[str], time: FloatArray, values: FloatArray) -> None:
    for i, joint in enumerate(joints):
        dashes = DASHES[i % len(DASHES)]
        axes.plot(time, values[:, i], color=f"C{i}", linestyle=dashes, label=joint)
