"""Contacts that repeat each other, soles of any shape, drift taken back, feet that roll."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import linprog

from wbc.control import (
    CenterOfMassTask,
    Controller,
    ControllerSettings,
    FrameOrientationTask,
    PointContact,
    PostureTask,
    Reference,
    Status,
    SurfaceContact,
)
from wbc.control.rows.surface import polygon_cone
from wbc.dynamics import evaluate
from wbc.effects import load_robot
from wbc.robot import Motion

TALOS = load_robot("talos")
HALF = TALOS.poses["half_sitting"]
SOLO = load_robot("solo12")
STAND = next(iter(SOLO.poses.values()))


def talos_tasks():
    return [
        CenterOfMassTask(weight=10.0),
        FrameOrientationTask(name="trunk", frame="torso_2_link"),
        PostureTask.of(TALOS, weight=0.1),
    ]


@pytest.mark.parametrize("solver", ["proxqp", "daqp"])
def test_four_points_on_each_rigid_sole(solver):
    """Noise of 1e-3 rad/s sets points of one body 4e-6 m/s^2 apart: no reason to fail."""
    controller = Controller(
        TALOS, talos_tasks(), [PointContact(name=c.name) for c in TALOS.contacts]
    )
    if solver == "daqp":
        settings = replace(controller.settings, solver=solver)
        contacts = [PointContact(name=c.name) for c in TALOS.contacts]
        controller = Controller(TALOS, talos_tasks(), contacts, settings=settings)
    generator = np.random.default_rng(1)
    for _ in range(50):
        v = 1e-3 * generator.normal(size=TALOS.model.nv)
        command = controller.step(Motion(HALF, v), {"posture": Reference(HALF[7:])})
        assert command.status is Status.SOLVED, command.message
        terms = evaluate(TALOS, HALF, v)
        J, drift = terms.contact_jacobian, terms.contact_drift
        miss = J @ command.acceleration + drift + 10.0 * J @ v
        assert np.abs(J.T @ miss).max() < 1e-6  # least squares: nothing is left along the rows
        assert np.abs(miss).max() < 1e-5


def test_points_and_a_sole_are_the_same_contact():
    corners = [c.name for c in TALOS.contacts]
    points = Controller(TALOS, talos_tasks(), [PointContact(name=name) for name in corners])
    soles = [
        SurfaceContact(name=side, corners=tuple(n for n in corners if n.startswith(side)))
        for side in ("left", "right")
    ]
    state = Motion(HALF, np.zeros(TALOS.model.nv))
    com = pin.centerOfMass(TALOS.model, TALOS.model.createData(), HALF)
    asked = {"center_of_mass": Reference(com + np.array([0.02, 0.01, -0.03]))}
    one = points.step(state, asked)
    two = Controller(TALOS, talos_tasks(), soles).step(state, asked)
    np.testing.assert_allclose(one.acceleration, two.acceleration, atol=2e-3)
    weight = sum(force[2] for force in one.forces.values())
    assert weight == pytest.approx(sum(wrench[2] for wrench in two.forces.values()), rel=1e-4)


@pytest.mark.parametrize("radius", [0.0, 0.02])
def test_a_ball_rolls_where_a_point_stands(radius):
    """The touching point of a ball rests; its centre follows the turning of its link."""
    contacts = tuple(replace(c, radius=radius) for c in SOLO.contacts)
    robot = replace(SOLO, contacts=contacts)
    tasks = [CenterOfMassTask(weight=10.0), PostureTask.of(robot, weight=0.1)]
    controller = Controller(robot, tasks, [PointContact(name=c.name) for c in contacts])
    q, v = STAND.copy(), np.zeros(robot.model.nv)
    com = pin.centerOfMass(robot.model, robot.model.createData(), q).copy()
    data = robot.model.createData()
    feet = [robot.model.getFrameId(c.frame) for c in contacts]

    def touching(q, v):
        pin.forwardKinematics(robot.model, data, q, v)
        rates, places = [], []
        for number, contact in zip(feet, contacts, strict=True):
            place = pin.updateFramePlacement(robot.model, data, number)
            rate = pin.getFrameVelocity(
                robot.model, data, number, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
            )
            arm = place.rotation @ contact.offset
            down = arm - np.array([0.0, 0.0, radius])
            rates.append(rate.linear + np.cross(rate.angular, down))
            places.append(place.act(contact.offset))
        return np.array(rates), np.array(places)

    start = touching(q, v)[1]
    slip = 0.0
    for tick in range(300):
        target = com + np.sin(0.01 * tick) * np.array([0.03, 0.0, -0.02])
        command = controller.step(Motion(q, v), {"center_of_mass": Reference(target)})
        assert command.status is Status.SOLVED
        v = v + 1e-3 * command.acceleration
        q = pin.integrate(robot.model, q, 1e-3 * v)
        slip = max(slip, np.abs(touching(q, v)[0]).max())
    assert slip < 2e-3
    rolled = np.abs(touching(q, v)[1] - start)
    assert rolled[:, 2].max() < 1e-3
    assert (rolled[:, 0].max() > 1e-3) == (radius > 0.0)


@pytest.mark.parametrize("sole", [False, True])
def test_drift_of_a_contact_is_taken_back(sole):
    """A pose estimate that slides under standing feet: where they first stood is kept."""
    if sole:
        robot, q, tasks = TALOS, HALF.copy(), talos_tasks()
        names = [c.name for c in TALOS.contacts]

        def contacts(stiffness):
            return [
                SurfaceContact(
                    name=side,
                    corners=tuple(n for n in names if n.startswith(side)),
                    stiffness=stiffness,
                )
                for side in ("left", "right")
            ]
    else:
        robot, q = SOLO, STAND.copy()
        tasks = [CenterOfMassTask(weight=10.0), PostureTask.of(SOLO, weight=0.1)]

        def contacts(stiffness):
            return [PointContact(name=c.name, stiffness=stiffness) for c in SOLO.contacts]

    left = {}
    nv = robot.model.nv
    for stiffness in (0.0, 25.0):
        controller = Controller(robot, tasks, contacts(stiffness))
        controller.step(Motion(q, np.zeros(nv)))
        start = evaluate(robot, q, np.zeros(nv)).contact_position
        moved = q.copy()
        moved[9] += 0.01  # a joint that reads wrong for once, so that a foot is elsewhere
        moved, v = pin.normalize(robot.model, moved), np.zeros(nv)
        for _ in range(1500):
            command = controller.step(Motion(moved, v))
            assert command.status is Status.SOLVED, command.message
            v = v + 1e-3 * command.acceleration
            moved = pin.integrate(robot.model, moved, 1e-3 * v)
        left[stiffness] = np.abs(evaluate(robot, moved, v).contact_position - start).max()
    assert left[0.0] > 1e-3
    assert left[25.0] < 0.05 * left[0.0]


def test_a_contact_that_left_stands_where_it_comes_down():
    names = [c.name for c in SOLO.contacts]
    tasks = [CenterOfMassTask(weight=10.0), PostureTask.of(SOLO, weight=0.1)]
    points = [PointContact(name=name, stiffness=100.0) for name in names]
    controller = Controller(SOLO, tasks, points, settings=ControllerSettings(contact_ramp=0.0))
    rest = np.zeros(SOLO.model.nv)
    controller.step(Motion(STAND, rest))
    controller.step(Motion(STAND, rest), contacts=dict.fromkeys(names[1:], np.inf))
    other = STAND.copy()
    other[8] += 0.2  # the leg of the first foot
    command = controller.step(Motion(other, rest), {"posture": Reference(other[7:])})
    com = {
        "center_of_mass": Reference(pin.centerOfMass(SOLO.model, SOLO.model.createData(), other))
    }
    command = controller.step(Motion(other, rest), {"posture": Reference(other[7:])} | com)
    assert np.abs(command.acceleration).max() < 0.5


@pytest.mark.parametrize("n", [3, 4, 5, 6])
def test_polygon_cone_is_the_sum_of_corner_pyramids(n):
    """The faces against a linear program over the corner forces."""
    generator, mu = np.random.default_rng(n), 0.4
    angle = np.sort(generator.uniform(0.0, 2.0 * np.pi / n, n) + 2.0 * np.pi * np.arange(n) / n)
    corners = np.column_stack([0.1 * np.cos(angle), 0.07 * np.sin(angle)])
    rows, labels = polygon_cone(mu, corners)
    assert len(rows) == len(labels)
    rays = []
    for x, y in corners:
        for a in (1.0, -1.0):
            for b in (1.0, -1.0):
                force = np.array([a * mu, b * mu, 1.0])
                rays.append(np.concatenate([force, np.cross([x, y, 0.0], force)]))
    rays = np.array(rays)
    assert (rows @ rays.T).max() < 1e-8
    inside = 0
    for _ in range(200):
        wrench = generator.dirichlet(np.full(len(rays), 0.15)) @ rays
        wrench += 0.5 * generator.uniform(-1.0, 1.0) * (wrench - rays.mean(axis=0))
        wrench[2] = 1.0
        possible = linprog(np.zeros(len(rays)), A_eq=rays.T, b_eq=wrench).status == 0
        assert ((rows @ wrench).max() <= 1e-8) == possible
        inside += possible
    assert 20 < inside < 190


def test_a_robot_stands_on_triangular_soles():
    robot = TALOS
    soles = [
        SurfaceContact(
            name=side,
            corners=tuple(f"{side}_sole_{c}" for c in ("front_left", "front_right", "rear_left")),
        )
        for side in ("left", "right")
    ]
    shape = np.array([robot.contact(name).offset[:2] for name in soles[0].corners])
    command = Controller(robot, talos_tasks(), soles).step(Motion(HALF, np.zeros(36)))
    assert command.status is Status.SOLVED
    for wrench in command.forces.values():
        rows, _ = polygon_cone(0.7 / np.sqrt(2.0), shape - shape.mean(axis=0))
        assert (rows @ wrench).max() < 1e-4 * wrench[2]
