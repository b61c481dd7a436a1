"""The two figures of the paper's case study, reproduced and extended.

First: the inertia at the foot direction by direction, the tensors beside the exact one, and the
force polygons with the combined one. Second: what the efficiencies do, with the two of them
independent of each other, and with what a higher reduction would have done instead.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from sims.plots import Curves, Panel, sweep_figure, write_figures
from sims.tables import print_columns
from wbc import Robot, load_robot
from wbc.arrays import FloatArray
from wbc.metrics import (
    DesignMetrics,
    Designs,
    DirectionalInertia,
    design_metrics,
    directional_inertia,
    force_capability,
    impact_mitigation,
)
from wbc.transmission import CompoundPlanetaryGear, Direction, wedge_backward_efficiency
from wbc.view import LIGHT, Theme
from wbc.view.plots import DASHES, drawing, new_figure

OUT = Path("out")
UP = (0.0, 1.0)
# Forward and backward efficiency of the gear that Matsuki et al. (2019) built, from its abstract.
MEASURED = (0.890, 0.853)
_LOCKING = 0.505  # the least efficiency drawn: the wedge locks itself at 1/2
_FIXED = 0.9  # a backward efficiency that does not follow the forward one


def inertia(directions: int = 3600) -> DirectionalInertia:
    """Return the inertia of the case study's foot in many directions, base fixed."""
    robot = load_robot("planar_leg_fixed")
    return directional_inertia(robot, robot.pose("paper"), "foot", "xz", directions)


def efficiencies(
    forward: FloatArray, backward: FloatArray | None = None, reduction: float = 20.0
) -> DesignMetrics:
    """Return the metrics of the floating leg with equal gears."""
    robot = load_robot("planar_leg")
    gears = {"forward_efficiency": forward, "gear_ratio": np.full(len(forward), reduction)}
    if backward is not None:
        gears["backward_efficiency"] = backward
    return design_metrics(Designs.of(robot, robot.pose("paper"), gears), "foot", UP, "xz")


def main() -> dict[str, dict[str, float]]:
    """Return what the figures show, as numbers."""
    found = inertia()
    ratio = found.driven / found.forward_tensor
    shares = {
        "all gears drive forward [% of forces]": 100.0 * found.share_forward,
        "a gear stands still [% of forces]": 100.0 * float(found.stuck.any(axis=1).mean()),
        "exact over Forward-GIT, least": float(ratio.min()),
        "exact over Forward-GIT, most": float(ratio.max()),
    }
    return {"directions": shares, "impact mitigation": _mitigation(load_robot("planar_leg"))}


def _mitigation(robot: Robot) -> dict[str, float]:
    """Return the factor up by what the gears do in the impact."""
    modes = {
        "perfect gears": Direction.STUCK,
        "gears set in motion (backward)": Direction.BACKWARD,
        "gears slowed down (forward)": Direction.FORWARD,
    }
    q = robot.pose("paper")
    return {
        name: impact_mitigation(robot, q, "foot", "xz", mode).along(UP)
        for name, mode in modes.items()
    }


def foot_figure(theme: Theme = LIGHT) -> Figure:
    """Return inertia and force at the foot, direction by direction."""
    found, robot = inertia(), load_robot("planar_leg_fixed")
    with drawing(theme):
        figure, grid = new_figure(1, 2, 9.6, 4.9)
        _draw_inertia(grid[0][0], found, theme)
        _draw_force(grid[0][1], robot, theme)
    return figure


def _draw_inertia(ax: Axes, found: DirectionalInertia, theme: Theme) -> None:
    n = found.directions
    far = 1.08 * float(np.nanmax(found.driven))
    edges = np.flatnonzero(np.diff(found.all_forward.astype(int), append=found.all_forward[0]))
    for start, stop in zip(edges, np.roll(edges, -1), strict=True):
        rows = np.arange(start + 1, stop + 1 if stop > start else stop + 1 + len(n)) % len(n)
        if not found.all_forward[rows[0]]:
            wedge = np.vstack([[0.0, 0.0], far * n[rows]])
            ax.add_patch(Polygon(wedge, facecolor=theme.faint, alpha=0.55, edgecolor="none"))
    for i, (label, mass) in enumerate(
        {
            "perfect gears (GIT)": found.lossless,
            "pushed (Backward-GIT, exact)": found.pushed,
            "driven, Forward-GIT": found.forward_tensor,
            "driven, exact": found.driven,
        }.items()
    ):
        curve = np.vstack([n, n[:1]]) * np.append(mass, mass[0])[:, None]
        ax.plot(*curve.T, color=theme.series[i], linestyle=DASHES[i], label=label)
    ax.set_aspect("equal", adjustable="datalim")
    ax.set_title("effective mass of the foot by direction of the force")
    ax.set_xlabel("x [kg]")
    ax.set_ylabel("z [kg]")
    ax.plot([], [], color=theme.faint, linewidth=8, label="some gear is driven or sticks")
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=2)


def _draw_force(ax: Axes, robot: Robot, theme: Theme) -> None:
    reach = force_capability(robot, robot.pose("paper"), "foot", "xz")
    polygons = {
        "lift (forward)": reach.vertices(Direction.FORWARD),
        "hold (backward)": reach.vertices(Direction.BACKWARD),
        "combined: foot about to move up": reach.moving(UP),
    }
    for i, (label, corners) in enumerate(polygons.items()):
        ring = np.append(corners, corners[:1], axis=0)
        ax.plot(*ring.T, color=theme.series[i], linestyle=DASHES[i], label=label, zorder=3 - i)
        if label.startswith("combined"):
            ax.add_patch(Polygon(ring, facecolor=theme.series[i], alpha=0.15))
    ax.plot(0.0, 0.0, "+", color=theme.ink)
    ax.set_title("force of the foot on its surroundings")
    ax.set_xlabel("$f_x$ [N]")
    ax.set_ylabel("$f_z$ [N]")
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=2)


def efficiency_figure(theme: Theme = LIGHT) -> Figure:
    """Return what the two efficiencies do, together and apart, and what the reduction does."""
    eta = np.linspace(_LOCKING, 1.0, 200)
    wedge, equal = efficiencies(eta), efficiencies(eta, eta)
    apart = efficiencies(eta, np.full(len(eta), _FIXED))
    lossless = float(wedge.impact_mitigation_lossless[0])
    kinds = {
        "eta_b = 2 - 1/eta_f": wedge,
        "eta_b = eta_f": equal,
        f"eta_b = {_FIXED:g}": apart,
    }
    ratios: Curves = {
        "lift (all)": (eta, wedge.lift / wedge.conventional),
        **{f"hold, {name}": (eta, m.hold / m.conventional) for name, m in kinds.items()},
    }
    factors: Curves = {
        **{name: (eta, m.impact_mitigation) for name, m in kinds.items()},
        "perfect gears": (eta, np.full(len(eta), lossless)),
    }
    across = "forward efficiency eta_f [-]"
    panels = [
        Panel("backward over forward efficiency", across, "eta_b [-]", _relations(eta),
              {"measured (Matsuki et al.)": ([MEASURED[0]], [MEASURED[1]])}),
        Panel("force over force with perfect gears", across, "[-]", ratios, log=True),
        Panel("impact mitigation factor, up", across, "IMF [-]", factors),
        Panel("two ways to hold more", "hold up [N]", "IMF [-]", _ways(eta)),
    ]  # fmt: skip
    figure = sweep_figure(panels, columns=2, theme=theme)
    with drawing(theme):
        figure.axes[0].legend(loc="lower right", fontsize=7, frameon=False)
        figure.axes[3].set_ylim(0.2, 1.15)  # room for the legend above the curves
        figure.axes[3].legend(loc="upper right", fontsize=8, frameon=False)
    return figure


def _relations(eta: FloatArray) -> Curves:
    """Return backward efficiencies of gears of one kind over the forward one."""
    curves: dict[str, tuple[FloatArray, FloatArray]] = {
        "wedge, and 3K at high reductions": (eta, wedge_backward_efficiency(eta))
    }
    for reduction, sun in ((100.0, 4.0), (20.0, 4.0)):
        gear = CompoundPlanetaryGear.of_reduction(reduction, sun)
        e = np.linspace(gear.ring_ratio, 1.0, 100)
        label = f"3K planetary, {reduction:g}:1"
        curves[label] = (gear.forward_efficiency(e), gear.backward_efficiency(e))
    curves["eta_b = eta_f"] = (eta, eta)
    return curves


def _ways(eta: FloatArray) -> Curves:
    """Return impact mitigation over holding force: by worse gears, and by higher reductions."""
    worse = efficiencies(eta[eta > 0.52])
    ratios = np.linspace(20.0, 160.0, 100)
    robot = load_robot("planar_leg")
    one = np.ones(len(ratios))
    curves: dict[str, tuple[FloatArray, FloatArray]] = {
        "20:1, worse and worse gears": (worse.hold, worse.impact_mitigation)
    }
    for forward in (1.0, 0.8):
        gears = {"forward_efficiency": forward * one, "gear_ratio": ratios}
        found = design_metrics(Designs.of(robot, robot.pose("paper"), gears), "foot", UP, "xz")
        label = f"20:1 to 160:1, eta_f = {forward:g}"
        curves[label] = (found.hold, found.impact_mitigation)
    return curves


def draw(theme: Theme = LIGHT) -> dict[str, Figure]:
    """Return both figures by name."""
    return {"case_foot": foot_figure(theme), "case_efficiency": efficiency_figure(theme)}


def report(found: dict[str, dict[str, float]]) -> list[Path]:
    """Print the numbers; return the two figures written."""
    for title, rows in found.items():
        print_columns(title, {"": rows})
    return write_figures(OUT, draw())


if __name__ == "__main__":
    for path in report(main()):
        print(path)
