"""Push the foot until it gives: what less efficient gears do to whoever drives them backward.

The leg hangs weightless from a fixed base, as the force capability counts no weight. Unpowered,
only the friction of its rotors (assumed) resists, magnified by the gears; powered, the motors
resist as hard as they can. A push counts as held when nothing moves under it.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from sims.leg import with_gears
from sims.plots import Panel, sweep_figure, write_figures
from sims.pushes import FREE, force_to_move, hanging_leg, torque_of
from sims.tables import print_columns
from wbc import Robot
from wbc.arrays import FloatArray
from wbc.measurement import Log
from wbc.metrics import ForceCapability, force_capability
from wbc.sim import Plant, SimState, simulate
from wbc.transmission import Direction
from wbc.view import LIGHT, Theme, write_playback

OUT = Path("out")


def capability(robot: Robot, powered: bool) -> ForceCapability:
    """Return what `wbc.metrics` says the leg holds; unpowered, its friction is all it has."""
    gears = robot.transmission
    if not powered:
        none = np.zeros(gears.size)
        gears = gears.replace(
            torque_limit=gears.rotor_coulomb_friction, rotor_coulomb_friction=none
        )
    return force_capability(robot.with_transmission(gears), robot.pose("paper"), "foot", "xz")


def figures(robot: Robot) -> dict[str, float]:
    """Return one column of the table, for a push straight up."""
    row = {"backward efficiency": float(robot.transmission.backward_efficiency[0])}
    for name, powered in (("unpowered", False), ("powered", True)):
        row[f"{name}: push [N]"] = force_to_move(robot, [0.0, 0.0, 1.0], powered)
        row[f"{name}: metric [N]"] = capability(robot, powered).along([0.0, 1.0]).hold
    return row


def force_map(robot: Robot, angles: FloatArray) -> FloatArray:
    """Return the pushes (k, 2) [N] in the x-z plane that move the powered foot."""
    units = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    sizes = [force_to_move(robot, [x, 0.0, z], powered=True) for x, z in units]
    return np.asarray(units * np.array(sizes)[:, None])


def main(
    efficiencies: Sequence[float] = (0.45, 0.51, 0.55, 0.6, 0.7, 0.85, 1.0),
) -> dict[float, dict[str, float]]:
    """Return the figures over the forward efficiency of both gears (wedge)."""
    return {eta: figures(with_gears(hanging_leg(), eta)) for eta in efficiencies}


def panels(table: dict[float, dict[str, float]]) -> list[Panel]:
    """Return forces over efficiency, and the map of forces that the paper's leg holds."""
    rows, fine = [], np.linspace(0.508, 1.0, 80)
    for name, powered in (("unpowered", False), ("powered", True)):
        held = [
            capability(with_gears(hanging_leg(), e), powered).along([0.0, 1.0]).hold for e in fine
        ]
        pushed = [row[f"{name}: push [N]"] for row in table.values()]
        lines, points = {"predicted": (fine, held)}, {"pushed": (list(table), pushed)}
        title = f"{name}: push up that moves the foot"
        rows.append(Panel(title, "forward efficiency [-]", "push [N]", lines, points, log=True))
    robot, turn = hanging_leg(), np.linspace(0.0, 2.0 * np.pi, 36, endpoint=False)
    moved = force_map(robot, np.arctan2(200.0 * np.sin(turn), 50.0 * np.cos(turn)))
    corners = capability(robot, powered=True).vertices(Direction.BACKWARD)
    edge = np.append(corners, corners[:1], axis=0)
    lines, points = {"predicted": tuple(edge.T)}, {"pushed": tuple(moved.T)}
    return [*rows, Panel("pushes that the motors hold", "$f_x$ [N]", "$f_z$ [N]", lines, points)]


def draw(table: dict[float, dict[str, float]], theme: Theme = LIGHT) -> dict[str, Figure]:
    """Return the figure of this study."""
    return {"backdrive": sweep_figure(panels(table), theme=theme)}


def pushed_about(robot: Robot) -> Log:
    """Return a recording of the unpowered leg under a push up and down of at most 6 N."""

    def push(state: SimState) -> FloatArray:
        force = np.array([0.0, 0.0, 6.0 * np.sin(2.0 * np.pi * 0.75 * state.time)])
        return torque_of(robot, force, state.position)

    plant = Plant(robot, FREE)
    start = plant.state(robot.pose("paper"))
    return simulate(plant, lambda _: np.zeros(2), start, 4.0, dt=2e-3, external=push).log


def report(table: dict[float, dict[str, float]]) -> list[Path]:
    """Print the table; return the plot and the playback written."""
    print_columns("pushing the foot up, over eta_f", {f"{e:g}": row for e, row in table.items()})
    page, robot = OUT / "backdrive.html", hanging_leg()
    return [
        *write_figures(OUT, draw(table)),
        write_playback(page, robot, pushed_about(robot), title="Backdriven, unpowered"),
    ]


if __name__ == "__main__":
    for path in report(main()):
        print(path)
