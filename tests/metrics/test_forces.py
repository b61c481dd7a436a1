"""Forces that a robot lifts, holds and softens, against statics, momenta and the mesh law."""

import numpy as np
import pytest
from scipy.optimize import linprog

from tests.sim.random_robots import geared
from wbc import Robot, load_robot, metrics
from wbc.dynamics import evaluate
from wbc.transmission import mesh_input

POSE = {"hip": -0.5, "knee": 1.1}
SQUAT = {"FL_HAA": 0.1, "FL_HFE": 0.8, "FL_KFE": -1.6}


def holdable(robot: Robot, q: np.ndarray, rows: list[int], force: np.ndarray, end: int) -> float:
    """Return the largest share of a motor's limit that holding `force` asks, from the mesh law."""
    gears = robot.transmission
    terms = evaluate(robot, q, np.zeros(robot.model.nv))
    joint = terms.contact_jacobian[rows][:, robot.actuated].T @ force
    output = gears.topology.T @ joint
    etas = gears.forward_efficiency, gears.backward_efficiency
    magnitude = np.abs([mesh_input(output, speed, *etas) for speed in (1.0, -1.0)])
    need = magnitude.max(axis=0) if end > 0 else magnitude.min(axis=0)
    return float(np.max(need / (gears.gear_ratio * gears.torque_limit)))


@pytest.mark.parametrize("name", ["planar_leg", "parallelogram_leg"])
@pytest.mark.parametrize("direction", [(0.0, 1.0), (1.0, 0.3), (-2.0, 1.0)])
def test_along_a_direction_the_motors_are_just_at_their_limit(
    name: str, direction: tuple[float, float]
) -> None:
    robot = load_robot(name)
    q = robot.configuration(**POSE)
    reach = metrics.force_capability(robot, q, "foot", "xz").along(direction)
    unit = np.array(direction) / np.linalg.norm(direction)
    assert holdable(robot, q, [0, 2], reach.lift * unit, +1) == pytest.approx(1.0)
    assert holdable(robot, q, [0, 2], reach.hold * unit, -1) == pytest.approx(1.0)
    assert reach.lift <= reach.conventional <= reach.hold


def furthest(capability: metrics.ForceCapability, mode: int, unit: np.ndarray) -> float:
    """Return how far the forces reach along a direction, by a linear program [N]."""
    matrix, limit = capability.torque_from_force, capability.limits(mode)
    both = np.vstack([matrix, -matrix]), np.tile(limit, 2)
    return float(-linprog(-unit, *both, bounds=(None, None)).fun)


@pytest.mark.parametrize("mode", [-1, 0, 1])
@pytest.mark.parametrize("axes", ["xyz", "xz", "z"])
def test_corners_reach_as_far_as_a_linear_program_says(mode: int, axes: str) -> None:
    """With as many gears as axes, in closed form, and with more."""
    robot = load_robot("solo12")
    reach = metrics.force_capability(robot, robot.configuration(**SQUAT), "FL_foot", axes)
    assert [robot.transmission.joints[i] for i in reach.gears] == ["FL_HAA", "FL_HFE", "FL_KFE"]
    corners = reach.vertices(mode)
    torque = np.abs(corners @ reach.torque_from_force.T)
    assert (torque <= reach.limits(mode) * (1.0 + 1e-7)).all()
    for direction in np.random.default_rng(3).normal(size=(5, len(axes))):
        unit = direction / np.linalg.norm(direction)
        close = 1e-9 if axes == "xyz" else 1e-6
        assert max(corners @ unit) == pytest.approx(furthest(reach, mode, unit), rel=close)


@pytest.mark.parametrize("name", ["planar_leg_fixed", "planar_leg", "parallelogram_leg"])
@pytest.mark.parametrize("direction", [(0.0, 1.0), (1.0, 0.0), (-1.0, 2.0)])
def test_the_combined_polygon_lifts_with_the_motion_and_holds_against_it(
    name: str, direction: tuple[float, float]
) -> None:
    """Every corner is where each gear is at the end of the interval that its motion allows."""
    robot = load_robot(name)
    q = robot.pose("paper")
    reach = metrics.force_capability(robot, q, "foot", "xz")
    corners = reach.moving(direction)
    n = np.array(direction) / np.linalg.norm(direction)
    task = reach.task
    motion = task.response(0, task.jacobian[0].T)[0] @ np.linalg.solve(task.mobility(0)[0], n)
    speed = robot.transmission.motor_from_joint @ motion[robot.actuated]
    speed[np.abs(speed) < 1e-9] = 0.0
    motor = robot.transmission.gear_ratio * robot.transmission.torque_limit
    eta_f, eta_b = robot.transmission.forward_efficiency, robot.transmission.backward_efficiency
    assert len(corners) == 4
    for corner in corners:
        torque = reach.torque_from_force @ corner
        with_motion = torque * speed > 0.0
        needed = np.where(with_motion, np.abs(torque) / eta_f, np.abs(torque) * eta_b)
        np.testing.assert_allclose(needed, motor, rtol=1e-9)


UP, ETA_B = [0.0, 1.0], 2.0 - 1.0 / 0.7


STRONG = load_robot("planar_leg_strong")
RUBBING = geared(STRONG, rotor_coulomb_friction=[0.01, 0.02])
LOCKED = geared(STRONG, backward_efficiency=[0.5, -0.1])


@pytest.mark.parametrize(
    ("robot", "least"),
    # Rotor friction eases holding.
    [(STRONG, 2.0 * ETA_B), (RUBBING, 2.0 * ETA_B - 0.02), (LOCKED, 0.0)],
    ids=["teeth", "rubbing", "locked"],
)
def test_the_knee_holds_its_share_of_the_load(robot: Robot, least: float) -> None:
    """The foot is straight under the hip: the knee's lever is 0.2 m, the reduction 20."""
    found = metrics.holding(robot, robot.pose("paper"), "foot", UP, 200.0, "xz")
    np.testing.assert_allclose(found.lossless, [0.0, 2.0], atol=1e-12)
    np.testing.assert_allclose(found.least, [0.0, least], atol=1e-12)
    assert found.heat_lossless == pytest.approx(0.1 * (2.0 / 0.1) ** 2)
    assert found.heat_saved == pytest.approx(1.0 - (least / 2.0) ** 2)
    assert found.heat_least == pytest.approx(found.heat_lossless * (least / 2.0) ** 2)


@pytest.mark.parametrize(("robot", "threshold"), [(RUBBING, 20 * 0.02 / ETA_B), (LOCKED, np.inf)])
def test_the_force_that_moves_the_unpowered_leg(robot: Robot, threshold: float) -> None:
    reach = metrics.force_capability(robot, robot.pose("paper"), "foot", "xz")
    assert reach.backdriving_torque[1] == pytest.approx(threshold)
    assert reach.along(UP).backdriving_force == pytest.approx(threshold / 0.2)


def test_unknown_motors_count_as_equal() -> None:
    robot = load_robot("planar_leg")
    found = metrics.holding(robot, robot.pose("paper"), "foot", UP, 50.0, "xz")
    assert np.isnan(found.heat_lossless)
    assert found.heat_saved == pytest.approx(1.0 - (2.0 - 1.0 / 0.7) ** 2)
    assert metrics.holding(robot, robot.pose("paper"), "foot", UP, 0.0, "xz").heat_saved == 0.0
