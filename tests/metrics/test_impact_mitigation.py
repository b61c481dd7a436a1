"""Impact mitigation against impacts solved as one linear system of momenta."""

from __future__ import annotations

import numpy as np
import pytest

from wbc.dynamics import evaluate
from wbc.effects import load_robot
from wbc.errors import DynamicsError
from wbc.metrics import impact_mitigation
from wbc.robot import Robot

POSE = {"hip": -0.5, "knee": 1.1}


def impulse_to_stop(robot: Robot, q: np.ndarray, speed: float, blocked: bool) -> float:
    """Return the vertical impulse that stops a falling foot whose joints were at rest.

    The unknowns are the velocity after the impact, the ground's impulse and, with blocked gears,
    the impulses that hold them. While a gear starts to turn its rotor takes N^2 I_r / eta_b.
    """
    nv, gears = robot.model.nv, robot.transmission
    terms = evaluate(robot, q, np.zeros(nv))
    select = gears.motor_from_joint @ np.eye(nv)[robot.actuated]
    mass = terms.mass_matrix.copy()
    if not blocked:
        mass += select.T @ np.diag(gears.reflected_inertia / gears.backward_efficiency) @ select
    rows = terms.contact_jacobian[2:3]
    if blocked:
        rows = np.vstack([rows, select])
    before = np.zeros(nv)
    before[1] = -speed
    kkt = np.block([[mass, -rows.T], [rows, np.zeros((len(rows), len(rows)))]])
    return float(np.linalg.solve(kkt, np.concatenate([mass @ before, np.zeros(len(rows))]))[nv])


@pytest.mark.parametrize("name", ["planar_leg", "parallelogram_leg"])
@pytest.mark.parametrize("knee_efficiency", [1.0, 0.7, 0.55])
def test_the_factor_is_the_share_of_the_impulse_that_the_gears_save(
    name: str, knee_efficiency: float
) -> None:
    robot = load_robot(name)
    gears = robot.transmission.replace(
        forward_efficiency=np.array([0.8, knee_efficiency]), backward_efficiency=None
    )
    robot = robot.with_transmission(gears)
    q = robot.configuration(**POSE)
    share = impulse_to_stop(robot, q, 1.0, blocked=False) / impulse_to_stop(
        robot, q, 1.0, blocked=True
    )
    assert impact_mitigation(robot, q, "foot", "xz").along([0, 1]) == pytest.approx(1.0 - share)


def test_a_direction_that_cannot_move_is_an_error() -> None:
    robot = load_robot("planar_leg_fixed")
    factor = impact_mitigation(robot, np.zeros(2), "foot", "xz")
    with pytest.raises(DynamicsError, match="singular pose"):
        _ = factor.matrix
    spatial = impact_mitigation(robot, robot.configuration(**POSE), "foot")
    with pytest.raises(DynamicsError, match="cannot be"):
        spatial.along([0.0, 1.0, 0.0])
