"""Measured and modelled torques over time as a figure, which a notebook shows as a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from io import BytesIO

from matplotlib import rcParams
from matplotlib.figure import Figure

from wbc.identification.answer.shown import Series


class ShownFigure(Figure):
    """A figure without a window; as the last line of a cell it is a picture, not a name."""

    def _repr_png_(self) -> bytes:
        """Return the picture, as notebooks ask for it."""
        file = BytesIO()
        self.savefig(file, format="png", dpi=80)
        return file.getvalue()


def torque_figure(
    outputs: Mapping[str, str], models: Sequence[tuple[str, Sequence[Series]]], log: int = 0
) -> Figure:
    """Return measured and modelled torque over time, with the residual below, per driven joint.

    Args:
        outputs: names of the driven joints, with the units of what they report.
        models: label and series of each model, of the same logs.
        log: number of the log.
    """
    count = len(outputs)
    figure = ShownFigure(figsize=(8.0, 2.6 * count + 0.5), layout="constrained")
    axes = figure.subplots(2 * count, 1, sharex=True, height_ratios=[2.0, 1.0] * count)
    for k, (output, unit) in enumerate(outputs.items()):
        torque, rest = axes[2 * k], axes[2 * k + 1]
        first, ink = models[0][1][log], rcParams["text.color"]
        torque.plot(first.time, first.measured[:, k], color=ink, label="measured")
        for number, (label, series) in enumerate(models):
            one, colour = series[log], f"C{1 - number % 2}"
            torque.plot(one.time, one.modelled[:, k], color=colour, linewidth=1.0, label=label)
            rest.plot(one.time, one.residual[:, k], color=colour, linewidth=1.0)
        torque.set_ylabel(f"{output} [{unit}]")
        rest.set_ylabel(f"residual [{unit}]")
    axes[-1].set_xlabel("time [s]")
    axes[0].set_title(models[0][1][log].name.rsplit("/", 1)[-1], loc="left")
    # Above all panels: inside one it hides the torque.
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    return figure
