"""The wedge of the paper's section II: its forces and impedance over slope and friction.

The paper prints eta_f = 1 - k and 1/eta_b = 1 + k with k = mu tan(alpha). The balance of forces
gives eta_f = 1/(1 + k) and eta_b = 1 - k. Only so is the wedge self-locking at k = 1, as the paper
says of it. The forces tell the two apart: friction adds k to the force that drives the wedge, and
takes k from the force that holds it while the block drives.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sims.plots import Panel, sweep_figure
from sims.tables import print_columns
from wbc.arrays import FloatArray
from wbc.transmission import Direction, WedgeBlock
from wbc.view.plots import write_figure

OUT = Path("out")
BLOCK, WEDGE = 2.0, 0.5  # [kg], assumed
SLOPE = np.pi / 3  # [rad], assumed: 1/cos = 2 is the wedge's reduction

Curves = dict[str, FloatArray]


def main(frictions: tuple[float, ...] = (0.0, 0.1, 0.2, 0.4)) -> dict[str, Curves]:
    """Return forces on the moving wedge over k, and the masses felt from both sides over the slope.

    The forces count in that of a wedge without friction, as it moves evenly against the same load.
    """
    k = np.linspace(0.0, 0.7, 71)
    wedges = [WedgeBlock(BLOCK, WEDGE, SLOPE, float(x / np.tan(SLOPE))) for x in k]
    # With the paper's signs a force that presses is negative.
    driven, driven_back = (
        np.array([-w.mesh_force(-1.0, speed)[1] / np.cos(SLOPE) for w in wedges])
        for speed in (1.0, -1.0)
    )
    curves = {
        "k": k,
        "driven": driven,
        "back-driven": driven_back,
        "driven, as printed": 1.0 / (1.0 - k),
        "back-driven, as printed": 1.0 / (1.0 + k),
    }
    slopes = np.deg2rad(np.linspace(0.0, 75.0, 76))
    masses: dict[str, Curves] = {"forces": curves}
    for friction in frictions:
        wedges = [WedgeBlock(BLOCK, WEDGE, float(slope), friction) for slope in slopes]
        masses[f"mu = {friction:g}"] = {
            "slope": np.rad2deg(slopes),
            "forward": np.array([w.impedance_mass(Direction.FORWARD) for w in wedges]),
            "backward": np.array([_backward_mass(w) for w in wedges]),
        }
    return masses


def _backward_mass(wedge: WedgeBlock) -> float:
    if wedge.backward_efficiency <= 0.0:
        return float("nan")
    return wedge.impedance_mass(Direction.BACKWARD)


def panels(curves: dict[str, Curves]) -> list[Panel]:
    """Return forces of the moving wedge and the masses that a force feels from each side."""
    forces = curves["forces"]
    rows = [
        Panel(
            "force on the moving wedge",
            "k = mu tan(alpha) [-]",
            "of that without friction [-]",
            {name: (forces["k"], force) for name, force in forces.items() if name != "k"},
        )
    ]
    for side, pushed in (("forward", "wedge"), ("backward", "block")):
        lines = {
            name: (one["slope"], one[side]) for name, one in curves.items() if name[:2] == "mu"
        }
        rows.append(
            Panel(
                f"mass felt by the {pushed}'s force", "slope alpha [deg]", "[kg]", lines, log=True
            )
        )
    return rows


def report(curves: dict[str, Curves]) -> list[Path]:
    """Print a table; return the figure written."""
    wedge = {f"mu = {mu:g}": WedgeBlock(BLOCK, WEDGE, SLOPE, mu) for mu in (0.0, 0.1, 0.2, 0.4)}
    table = {
        name: {
            "k": w.loss_coefficient,
            "eta_f": w.forward_efficiency,
            "eta_b": w.backward_efficiency,
            "mass felt forward [kg]": w.impedance_mass(Direction.FORWARD),
            "mass felt backward [kg]": _backward_mass(w),
        }
        for name, w in wedge.items()
    }
    print_columns("wedge of 60 degrees, block 2 kg, wedge 0.5 kg", table)
    return [write_figure(OUT / "wedge.png", sweep_figure(panels(curves)))]


if __name__ == "__main__":
    for path in report(main()):
        print(path)
