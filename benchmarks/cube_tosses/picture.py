"""The errors of all engines over the tosses that nobody was fitted to, and one toss."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from benchmarks.cube_tosses.engines import Path as Thrown
from benchmarks.cube_tosses.scores import Trial
from wbc.view import LIGHT
from wbc.view.plots import DASHES, drawing, new_figure, write_figure

PANELS = {"speed after [m/s]": "error of the speed after the first impact [m/s]"}
PANELS["final place [mm]"] = "error of the final place [mm]"


def write(
    file: Path,
    trials: Sequence[Trial],
    paths: Mapping[str, Sequence[Thrown]],
    found: Mapping[str, Mapping[str, np.ndarray]],
) -> None:
    """Draw one toss and the two distributions into a file."""
    with drawing():
        figure, grid = new_figure(1, 3, 12.0, 3.6)
        axes = [ax for row in grid for ax in row]
        toss = trials[0].toss
        axes[0].plot(toss.time, 1e3 * toss.position[:, 2], color="black", label="measured")
        for i, (name, thrown) in enumerate(paths.items()):
            style = {"color": LIGHT.series[i], "linestyle": DASHES[i], "label": name}
            axes[0].plot(toss.time, 1e3 * thrown[0][0][:, 2], **style)
            for ax, key in zip(axes[1:], PANELS, strict=True):
                values = np.sort(found[name][key])
                share = np.arange(1, len(values) + 1) / len(values)
                ax.step(values, share, where="post", **style)
        axes[0].set(title=f"toss {toss.number}", xlabel="time [s]", ylabel="height [mm]")
        for ax, label in zip(axes[1:], PANELS.values(), strict=True):
            ax.set(xlabel=label, ylabel="share of the tosses", ylim=(0.0, 1.02))
            ax.set_xlim(left=0.0)
        axes[0].legend()
    write_figure(file, figure)
