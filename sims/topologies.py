"""Serial against parallelogram with equal motors: what the same two gears can do at the foot.

Links, gears and motors are the same; the topology and the housing of the knee's motor differ. The
numbers are the metrics of `wbc.metrics`, in the paper's pose and as the mean over a crouch.
"""

from __future__ import annotations

import numpy as np

from sims.tables import print_columns
from wbc import Robot, load_robot
from wbc.arrays import FloatArray
from wbc.metrics import (
    Designs,
    backward_generalized_inertia,
    design_metrics,
    directional_inertia,
    force_capability,
    holding,
    impact_mitigation,
)

UP = (0.0, 1.0)


def legs() -> dict[str, Robot]:
    """Return the two legs; the parallelogram's motors are those of the serial leg."""
    serial, parallel = load_robot("planar_leg_strong"), load_robot("parallelogram_leg")
    own = parallel.transmission
    motors = serial.transmission.replace(topology=own.topology, housings=own.housings)
    return {"serial": serial, "parallelogram": parallel.with_transmission(motors)}


def crouch(robot: Robot, count: int) -> FloatArray:
    """Return poses (count, nq), foot straight under the hip, from deep to nearly straight."""
    knees = np.linspace(np.deg2rad(120.0), np.deg2rad(20.0), count)
    return np.array([robot.configuration(hip=-0.5 * k, knee=float(k)) for k in knees])


def figures(robot: Robot, poses: int = 41) -> dict[str, float]:
    """Return one column of the table."""
    q, weight = robot.pose("paper"), 9.81 * sum(b.mass for b in robot.model.inertias)
    directions = directional_inertia(robot, q, "foot", "xz", 3600)
    up = directional_inertia(robot, q, "foot", "xz", [UP])
    reach = force_capability(robot, q, "foot", "xz")
    force, sideways = reach.along(UP), reach.along((1.0, 0.0))
    factor = impact_mitigation(robot, q, "foot", "xz")
    held = holding(robot, q, "foot", UP, weight, "xz")
    tensor = backward_generalized_inertia(robot, q, "foot", "xz")
    mean = design_metrics(Designs.of(robot, crouch(robot, poses)), "foot", UP, "xz")
    corners = reach.moving(UP)
    return {
        "effective mass up, lossless [kg]": float(up.lossless[0]),
        "effective mass up, pushed [kg]": float(up.pushed[0]),
        "effective mass up, driven [kg]": float(up.driven[0]),
        "Backward-GIT, determinant [kg^2]": float(np.linalg.det(tensor)),
        "directions driven forward by both [%]": 100.0 * directions.share_forward,
        "lift up [N]": force.lift,
        "hold up [N]": force.hold,
        "lift sideways [N]": sideways.lift,
        "hold sideways [N]": sideways.hold,
        "combined polygon, moving up [kN^2]": 1e-6 * _area(corners),
        "IMF up": factor.along(UP),
        "IMF, determinant": factor.determinant,
        "holding the weight, hip [N m]": float(held.least[0]),
        "holding the weight, knee [N m]": float(held.least[1]),
        "holding heat [W]": held.heat_least,
        "heat saved by stiction [%]": 100.0 * held.heat_saved,
        "crouch: lift up, mean [N]": float(mean.lift.mean()),
        "crouch: IMF up, mean": float(mean.impact_mitigation.mean()),
        "crouch: mass up, pushed, mean [kg]": float(mean.backward_inertia.mean()),
    }


def _area(corners: FloatArray) -> float:
    x, y = corners.T
    return float(0.5 * abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)))


def main() -> dict[str, dict[str, float]]:
    """Return the figures of both legs, with the paper's efficiencies and with equal ones."""
    table = {}
    for name, robot in legs().items():
        table[name] = figures(robot)
        gears = robot.transmission.replace(
            forward_efficiency=np.full(2, 0.75), backward_efficiency=None
        )
        table[f"{name}, 0.75"] = figures(robot.with_transmission(gears))
    return table


if __name__ == "__main__":
    print_columns("equal motors of 60 N m: eta_f 0.8 and 0.7, or both 0.75", main())
