"""Contact sets that change, cones and flat feet, contacts that repeat each other, rolling feet."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import linprog

from tests.control.scenes import (
    center_of_mass,
    contact_drift,
    moved_on,
    points,
    still,
    trunk,
    upright,
    usual,
)
from wbc import control, load_robot
from wbc.control.rows.contacts import polygon_cone
from wbc.dynamics import evaluate
from wbc.errors import ControlError
from wbc.robot import Motion
from wbc.sim import Plant

SOLO, TALOS = load_robot("solo12"), load_robot("talos")
WORLD = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
FEET = [contact.name for contact in SOLO.contacts]


def talos(contacts, **settings):
    tasks, chosen = usual(TALOS, trunk(TALOS)), control.ControllerSettings(**settings)
    return control.Controller(TALOS, tasks, contacts, settings=chosen)


def test_ramp_gives_the_load_off_and_back_while_the_robot_moves():
    """The weight moves away from a foot, the foot leaves by a ramp and comes back by one."""
    controller = control.Controller(SOLO, usual(SOLO), points(SOLO))
    ramp = control.ContactRamp(FEET, load=15.0, duration=0.02)
    state, leaving = still(SOLO), np.array([-0.02, -0.02, 0.0])
    start = center_of_mass(SOLO, state.position)
    seen, torques = set(), []
    for tick in range(400):
        wanted = set(FEET) - ({"FL_foot"} if 150 <= tick < 250 else set())
        ceilings = ramp.step(wanted, 1e-3)
        moved = start + leaving * min(tick / 150, 1.0)
        command = controller.step(state, {"center_of_mass": control.Reference(moved)}, ceilings)
        assert command.status.usable, (tick, command.message)
        for name, force in command.forces.items():
            assert force[2] <= ceilings[name] + 1e-5
        seen.add(frozenset(command.forces))
        torques.append(command.rotor_torque)
        state = moved_on(SOLO, state, command.acceleration)
    assert seen == {frozenset(FEET), frozenset(FEET) - {"FL_foot"}}
    jumps = np.abs(np.diff(torques[10:], axis=0)).max()
    assert jumps < 0.1 * SOLO.transmission.torque_limit.max()


@pytest.mark.parametrize("ramp", [None, 0.0])
def test_flags_that_flicker_do_not_throw_a_robot_that_stands(ramp):
    """All feet stand in truth; told to stand on the left and the right ones in turns it fell."""
    plant, chosen = Plant(SOLO), {} if ramp is None else {"contact_ramp": ramp}
    settings = control.ControllerSettings(**chosen)
    controller = control.Controller(SOLO, upright(SOLO), points(SOLO), settings=settings)
    state = plant.state(SOLO.pose())
    for tick in range(400):
        told = {name: np.inf for i, name in enumerate(FEET) if (tick + i) % 2}
        command = controller.step(state, None, told)
        assert command.status.usable, command.message
        state = plant.step(state, command.rotor_torque, 1e-3).state
    sunk = SOLO.pose()[2] - state.position[2]
    assert sunk > 0.03 if ramp == 0.0 else abs(sunk) < 1e-3


def test_ramp_names_what_it_does_not_know():
    ramp = control.ContactRamp(["left", "right"], load=10.0, duration=0.1)
    assert dict(ramp.step({"left"}, 0.05)) == {"left": np.inf, "right": pytest.approx(5.0)}
    assert dict(ramp.step({"left"}, 0.05)) == {"left": np.inf}
    with pytest.raises(ControlError, match="lft"):
        ramp.step({"lft"}, 0.01)


def test_force_on_a_slope_stays_in_the_cone_about_its_normal():
    """Coulomb's law itself: tangential at most mu times normal force, about the ground's normal."""
    normal = np.array([0.25, 0.1, 1.0])
    contacts = points(SOLO, ground_normal=tuple(normal), friction=0.3)
    stiff = control.CenterOfMassTask(weight=10.0, stiffness=400.0)
    tasks = [stiff, control.PostureTask.of(SOLO, weight=0.1)]
    controller, n = control.Controller(SOLO, tasks, contacts), normal / np.linalg.norm(normal)
    # more than friction gives
    target = center_of_mass(SOLO, SOLO.pose()) + np.array([-0.05, 0.05, 0.0])
    command = controller.step(still(SOLO), {"center_of_mass": control.Reference(target)})
    assert command.status.usable
    force = np.array(list(command.forces.values()))
    push = force @ n
    used = np.linalg.norm(force - push[:, None] * n, axis=1) / (0.3 * push)
    assert 0.7 < used.max() <= 1.0 + 1e-6


@pytest.mark.parametrize("solver", ["proxqp", "daqp"])
def test_four_points_on_each_rigid_sole(solver):
    """Noise of 1e-3 rad/s sets points of one body 4e-6 m/s^2 apart: no reason to fail."""
    controller, half = talos(points(TALOS), solver=solver), TALOS.pose()
    generator = np.random.default_rng(1)
    for _ in range(50):
        v = 1e-3 * generator.normal(size=TALOS.model.nv)
        command = controller.step(Motion(half, v), {"posture": control.Reference(half[7:])})
        assert command.status is control.Status.SOLVED, command.message
        terms = evaluate(TALOS, half, v)
        J = terms.contact_jacobian
        miss = J @ command.acceleration + contact_drift(TALOS, half, v) + 10.0 * J @ v
        assert np.abs(J.T @ miss).max() < 1e-6  # least squares: nothing is left along the rows
        assert np.abs(miss).max() < 1e-5


@pytest.mark.parametrize("corners", [4, 3])
def test_points_and_a_sole_are_the_same_contact(corners):
    """Rectangles and triangles."""
    names = [contact.name for contact in TALOS.contacts]
    sides = {s: [n for n in names if n.startswith(s)][:corners] for s in ("left", "right")}
    soles = [control.SurfaceContact(name=side, corners=tuple(own)) for side, own in sides.items()]
    single = [control.PointContact(name=name) for own in sides.values() for name in own]
    com = center_of_mass(TALOS, TALOS.pose())
    asked = {"center_of_mass": control.Reference(com + np.array([0.02, 0.01, -0.03]))}
    one, two = (talos(contacts).step(still(TALOS), asked) for contacts in (single, soles))
    assert one.status is two.status is control.Status.SOLVED
    np.testing.assert_allclose(one.acceleration, two.acceleration, atol=2e-3)
    weight = sum(force[2] for force in one.forces.values())
    assert weight == pytest.approx(sum(wrench[2] for wrench in two.forces.values()), rel=1e-4)


@pytest.mark.parametrize("radius", [0.0, 0.02])
def test_a_ball_rolls_where_a_point_stands(radius):
    """The centre of a ball moves by its radius times the turning of its link."""
    robot = replace(SOLO, contacts=tuple(replace(c, radius=radius) for c in SOLO.contacts))
    controller, state = control.Controller(robot, usual(robot), points(robot)), still(robot)
    com, slip, centers = center_of_mass(robot, state.position), 0.0, []
    frames = [robot.model.getFrameId(contact.frame) for contact in robot.contacts]
    for tick in range(300):
        target = com + np.sin(0.01 * tick) * np.array([0.03, 0.0, -0.02])
        command = controller.step(state, {"center_of_mass": control.Reference(target)})
        assert command.status is control.Status.SOLVED
        state = moved_on(robot, state, command.acceleration)
        terms = evaluate(SOLO, state.position, state.velocity)  # of points
        centers.append(terms.contact_position)
        moved = (terms.contact_jacobian @ state.velocity).reshape(-1, 3)
        spins = [pin.getFrameVelocity(robot.model, terms.data, f, WORLD).angular for f in frames]
        slip = max(slip, np.abs(moved - radius * np.cross(spins, [0.0, 0.0, 1.0])).max())
    assert slip < 2e-3
    rolled = np.abs(centers[-1] - centers[0])
    assert rolled[:, 2].max() < 1e-3
    assert (rolled[:, 0].max() > 1e-3) == (radius > 0.0)


@pytest.mark.parametrize("n", [3, 4, 6])
def test_polygon_cone_is_the_sum_of_corner_pyramids(n):
    """The faces against a linear program over the corner forces."""
    generator, mu = np.random.default_rng(n), 0.4
    angle = np.sort(generator.uniform(0.0, 2.0 * np.pi / n, n) + 2.0 * np.pi * np.arange(n) / n)
    corners = np.column_stack([0.1 * np.cos(angle), 0.07 * np.sin(angle)])
    rows, labels = polygon_cone(mu, corners)
    assert len(rows) == len(labels)
    edges = np.array([[a * mu, b * mu, 1.0] for a in (1.0, -1.0) for b in (1.0, -1.0)])
    rays = np.array([np.r_[f, np.cross([x, y, 0.0], f)] for x, y in corners for f in edges])
    assert (rows @ rays.T).max() < 1e-8
    inside = 0
    for _ in range(80):
        wrench = generator.dirichlet(np.full(len(rays), 0.15)) @ rays
        wrench += 0.5 * generator.uniform(-1.0, 1.0) * (wrench - rays.mean(axis=0))
        wrench[2] = 1.0
        possible = linprog(np.zeros(len(rays)), A_eq=rays.T, b_eq=wrench).status == 0
        assert ((rows @ wrench).max() <= 1e-8) == possible
        inside += possible
    assert 8 < inside < 76
