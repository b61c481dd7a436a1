"""Cones against brute force, contact sets that change, and flat feet."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from wbc.control import (
    CenterOfMassTask,
    ConeApproximation,
    ContactRamp,
    Controller,
    ControllerSettings,
    FrameOrientationTask,
    PointContact,
    PostureTask,
    Reference,
)
from wbc.control.rows.contacts import pyramid
from wbc.effects import load_robot
from wbc.errors import ControlError
from wbc.robot import Motion
from wbc.sim import Plant

TALOS = load_robot("talos")
SOLO = load_robot("solo12")
CORNERS = tuple(f"left_sole_{a}_{b}" for a in ("front", "rear") for b in ("left", "right"))


@pytest.mark.parametrize("faces", [3, 4, 8])
def test_pyramids_stand_inside_and_around_the_cone(faces):
    angle = np.linspace(0.0, 2.0 * np.pi, 721)
    cone = np.array([0.6 * np.cos(angle), 0.6 * np.sin(angle), np.ones_like(angle)])
    outer = pyramid(0.6, faces, ConeApproximation.OUTER) @ cone
    assert outer.max() <= 1e-12
    inner = pyramid(0.6, faces, ConeApproximation.INNER)
    edges = np.array([inner[:, :2], np.roll(inner[:, :2], -1, axis=0)])
    for one, other in zip(edges[0], edges[1], strict=True):
        corner = np.linalg.solve(np.array([one, other]), np.full(2, -inner[0, 2]))
        assert np.linalg.norm(corner) == pytest.approx(0.6)


def test_ramp_gives_the_load_off_and_back_while_the_robot_moves():
    """The weight moves away from a foot, the foot leaves by a ramp and comes back by one."""
    contacts = [PointContact(name=c.name) for c in SOLO.contacts]
    tasks = [CenterOfMassTask(weight=10.0), PostureTask.of(SOLO, weight=0.1)]
    controller = Controller(SOLO, tasks, contacts)
    names = [contact.name for contact in contacts]
    ramp = ContactRamp(names, load=15.0, duration=0.02)
    q, v = next(iter(SOLO.poses.values())), np.zeros(18)
    start, leaving = center_of_mass(SOLO, q), np.array([-0.02, -0.02, 0.0])
    seen, torques = set(), []
    for tick in range(400):
        wanted = set(names) - ({"FL_foot"} if 150 <= tick < 250 else set())
        ceilings = ramp.step(wanted, 1e-3)
        moved = start + leaving * min(tick / 150, 1.0)
        command = controller.step(Motion(q, v), {"center_of_mass": Reference(moved)}, ceilings)
        assert command.status.usable, (tick, command.message)
        for name, force in command.forces.items():
            assert force[2] <= ceilings[name] + 1e-5
        seen.add(frozenset(command.forces))
        torques.append(command.rotor_torque)
        v = v + 1e-3 * command.acceleration
        q = pin.integrate(SOLO.model, q, 1e-3 * v)
    assert seen == {frozenset(names), frozenset(names) - {"FL_foot"}}
    jumps = np.abs(np.diff(torques[10:], axis=0)).max()
    assert jumps < 0.1 * SOLO.transmission.torque_limit.max()


@pytest.mark.parametrize("ramp", [None, 0.0])
def test_flags_that_flicker_do_not_throw_a_robot_that_stands(ramp):
    """All feet stand in truth; told to stand on the left and the right ones in turns it fell."""
    plant, start = Plant(SOLO), next(iter(SOLO.poses.values()))
    chosen = ControllerSettings() if ramp is None else ControllerSettings(contact_ramp=ramp)
    tasks = [
        CenterOfMassTask(weight=100.0),
        FrameOrientationTask(name="trunk", frame="base_link", weight=10.0),
        PostureTask.of(SOLO, weight=0.1, stiffness=50.0),
    ]
    points = [PointContact(name=contact.name) for contact in SOLO.contacts]
    controller, state = Controller(SOLO, tasks, points, settings=chosen), plant.state(start)
    for tick in range(400):
        feet = {point.name: np.inf for i, point in enumerate(points) if (tick + i) % 2}
        command = controller.step(Motion(state.position, state.velocity), None, feet)
        assert command.status.usable, command.message
        state = plant.step(state, command.rotor_torque, 1e-3).state
    sunk = start[2] - state.position[2]
    assert sunk > 0.03 if ramp == 0.0 else abs(sunk) < 1e-3


def test_ramp_names_what_it_does_not_know():
    ramp = ContactRamp(["left", "right"], load=10.0, duration=0.1)
    assert dict(ramp.step({"left"}, 0.05)) == {"left": np.inf, "right": pytest.approx(5.0)}
    assert dict(ramp.step({"left"}, 0.05)) == {"left": np.inf}
    with pytest.raises(ControlError, match="lft"):
        ramp.step({"lft"}, 0.01)


def test_force_on_a_slope_stays_in_the_cone_about_its_normal():
    """Coulomb's law itself: tangential at most mu times normal force, about the ground's normal."""
    normal = np.array([0.25, 0.1, 1.0])
    contacts = [
        PointContact(name=c.name, ground_normal=tuple(normal), friction=0.3) for c in SOLO.contacts
    ]
    tasks = [CenterOfMassTask(weight=10.0, stiffness=400.0), PostureTask.of(SOLO, weight=0.1)]
    q, n = next(iter(SOLO.poses.values())), normal / np.linalg.norm(normal)
    controller = Controller(SOLO, tasks, contacts)
    target = center_of_mass(SOLO, q) + np.array([-0.05, 0.05, 0.0])  # more than friction gives
    command = controller.step(Motion(q, np.zeros(18)), {"center_of_mass": Reference(target)})
    assert command.status.usable
    used = []
    for force in command.forces.values():
        push = force @ n
        used.append(np.linalg.norm(force - push * n) / (0.3 * push))
    assert 0.7 < max(used) <= 1.0 + 1e-6


def center_of_mass(robot, q):
    return pin.centerOfMass(robot.model, robot.model.createData(), q).copy()
