"""Drops of the unpowered leg over height, efficiency and gear ratio: what an impact feels.

The impact mitigation factor is measured as its definition says, one minus the impulse of the
leg over that of the same leg with blocked gears on a frictionless ground, and set beside what
`wbc.metrics` predicts.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from sims.drops import drop, mitigation
from sims.leg import with_gears
from sims.plots import Panel, sweep_figure, write_figures
from sims.tables import print_columns
from wbc import Robot, load_robot
from wbc.metrics import Designs, design_metrics, impact_mitigation
from wbc.sim import Plant, simulate
from wbc.view import LIGHT, Theme, write_playback

OUT = Path("out")
Sweeps = dict[str, dict[float, dict[str, float]]]


def figures(robot: Robot, height: float) -> dict[str, float]:
    """Return one column of the table."""
    impact = drop(robot, height)
    measured = mitigation(robot, height)
    predicted = impact_mitigation(robot, robot.pose("paper"), "foot", "xz").along([0.0, 1.0])
    fallen = sum(inertia.mass for inertia in robot.model.inertias) * 9.81 * height
    return {
        "impulse, up [N s]": float(impact.contact_impulse[0, 2]),
        "impulse, along [N s]": float(impact.contact_impulse[0, 0]),
        "mesh loss [% of fall]": 100.0 * impact.mesh_loss / fallen,
        "ground loss [% of fall]": 100.0 * impact.contact_loss / fallen,
        "IMF, measured": measured,
        "IMF, predicted": predicted,
        "IMF, error [%]": round(100.0 * (measured / predicted - 1.0), 6) + 0.0,
    }


def main(
    heights: Sequence[float] = (0.02, 0.05, 0.1, 0.2, 0.3),
    efficiencies: Sequence[float] = (0.51, 0.55, 0.6, 0.7, 0.8, 1.0),
    ratios: Sequence[float] = (5.0, 10.0, 20.0, 40.0, 80.0),
) -> Sweeps:
    """Return the figures of three sweeps about the paper's leg dropped from 10 cm."""
    leg = load_robot("planar_leg")
    return {
        "height [m]": {h: figures(leg, h) for h in heights},
        "forward efficiency": {e: figures(with_gears(leg, e), 0.1) for e in efficiencies},
        "gear ratio": {n: figures(with_gears(leg, ratio=n), 0.1) for n in ratios},
    }


def panels(sweeps: Sweeps) -> list[Panel]:
    """Return impulses, impact mitigation and losses over what was varied."""

    def curve(sweep: str, figure: str) -> tuple[list[float], list[float]]:
        return list(sweeps[sweep]), [values[figure] for values in sweeps[sweep].values()]

    rows = []
    for name in sweeps:
        drops = {"simulated drops": curve(name, "impulse, up [N s]")}
        rows.append(Panel("impulse of the ground", axis(name), "impulse [N s]", drops, drops))
    leg = load_robot("planar_leg")
    for name, field, values in (
        ("forward efficiency", "forward_efficiency", np.linspace(0.505, 1.0, 100)),
        ("gear ratio", "gear_ratio", np.linspace(1.0, 80.0, 80)),
    ):
        designs = Designs.of(leg, leg.pose("paper"), {field: values})
        metric = design_metrics(designs, "foot", [0.0, 1.0], "xz")
        lines = {"predicted": (values, metric.impact_mitigation)}
        points = {"simulated drops": curve(name, "IMF, measured")}
        title = "impact mitigation factor (IMF)"
        rows.append(Panel(title, axis(name), "IMF [-]", lines, points))
    losses = {
        f"lost in the {place}": curve(name, f"{part} loss [% of fall]")
        for part, place in (("mesh", "gears"), ("ground", "contact"))
    }
    share = "energy [% of the fall]"
    return [*rows, Panel("energy that the impact takes", axis(name), share, losses, losses)]


def axis(sweep: str) -> str:
    """Return the name of a sweep with its unit."""
    return sweep if "[" in sweep else f"{sweep} [-]"


def draw(sweeps: Sweeps, theme: Theme = LIGHT) -> dict[str, Figure]:
    """Return the figure of this study."""
    return {"impact": sweep_figure(panels(sweeps), theme=theme)}


def report(sweeps: Sweeps) -> list[Path]:
    """Print the tables; return the plot and the playback of an unpowered fall written."""
    for name, swept in sweeps.items():
        print_columns(f"drops over {name}", {f"{value:g}": row for value, row in swept.items()})
    robot = load_robot("planar_leg")
    plant, q = Plant(robot), robot.pose("paper")
    q[robot.position_index("base_z")] += 0.15
    fall = simulate(plant, lambda _: np.zeros(2), plant.state(q), 0.3).log
    return [
        *write_figures(OUT, draw(sweeps)),
        write_playback(OUT / "impact.html", robot, fall, title="Dropped from 15 cm, unpowered"),
    ]


if __name__ == "__main__":
    for path in report(main()):
        print(path)
