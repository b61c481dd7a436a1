"""The returned command against the dissipative equation, inverse dynamics and a second program."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.control.program.independent import solve_in_directions
from tests.control.scenes import CERTAIN, leg_controller, leg_references, leg_rows, random_state
from wbc.control import (
    CenterOfMassTask,
    Controller,
    ControllerSettings,
    PointContact,
    PostureTask,
    RestPolicy,
    SpeedBlend,
)
from wbc.dynamics import (
    contact_torque,
    dissipative_equation,
    evaluate,
    link_torque,
    rotor_torque,
)
from wbc.effects import effect_class, load_robot
from wbc.robot import Motion

ROBOTS = ("planar_leg_strong", "parallelogram_leg", "differential_biped", "solo12", "talos")


def controller_of(robot, **settings):
    tasks = [CenterOfMassTask(), PostureTask.of(robot, weight=0.01)]
    contacts = [PointContact(name=c.name) for c in robot.contacts[:4]]
    if robot.name == "talos":
        contacts = [PointContact(name=robot.contacts[i].name) for i in (0, 4)]
    if robot.name == "differential_biped":
        contacts = [PointContact(name="left_toe"), PointContact(name="right_toe")]
    choices = {"speed_blend": CERTAIN} | settings
    return Controller(robot, tasks, contacts, [], ControllerSettings(**choices))


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("coupled", [False, True])
def test_solution_satisfies_the_dissipative_equation(name, coupled):
    robot = replace(load_robot(name), rotors_turn_with_links=coupled)
    controller = controller_of(robot)
    generator = np.random.default_rng(1)
    for _ in range(8):
        q, v = random_state(robot, generator, speed=0.5)
        command = controller.step(Motion(q, v))
        assert command.status.usable, command.message
        assert command.consistent
        assert np.all(command.directions != 0)
        terms = evaluate(robot, q, v)
        equation = dissipative_equation(robot, terms, command.directions)
        external = np.zeros(robot.model.nv)
        for i, contact in enumerate(robot.contacts):
            if contact.name in command.forces:
                rows = terms.contact_jacobian[3 * i : 3 * i + 3]
                external += rows.T @ command.forces[contact.name]
        balance = equation.inertia @ command.acceleration + equation.bias - external
        balance -= equation.actuation @ command.rotor_torque
        assert np.abs(balance).max() < 1e-4 * (1.0 + np.abs(external).max())


EFFECTS = (
    ("viscous_friction", {"coefficient": 0.8}),
    ("directional_viscous_friction", {"positive_direction": 0.8, "negative_direction": 0.2}),
    ("thermal_viscous_friction", {"coefficient": 0.8, "rate": 0.03}),
    ("coulomb_friction", {"level": 1.3}),
    ("stribeck_friction", {"level": 0.7, "speed": 0.3}),
    ("presliding", {"level": 0.7, "length": 0.02}),
    (
        "load_presliding",
        {"forward_efficiency": 0.6, "backward_efficiency": 0.5, "length": 0.02},
    ),
    ("joint_spring", {"stiffness": 8.0, "rest": 0.2}),
    ("torque_ripple", {"amplitude": 0.5, "order": 3.0, "phase": 0.4}),
    ("torque_constant", {"factor": 0.85}),
    ("torque_offset", {"offset": 0.9}),
    ("payload_mass", {"mass": 1.5}),
    ("load_friction", {"coefficient": 0.1}),
    ("load_stribeck_friction", {"coefficient": 0.4, "speed": 1.5}),
    ("rotor_inertia", {"reflected_inertia": 0.08}),
    ("transmission_efficiency", {"forward_efficiency": 0.6, "backward_efficiency": 0.5}),
)


@pytest.mark.parametrize(("effect", "values"), EFFECTS, ids=[name for name, _ in EFFECTS])
@pytest.mark.parametrize("name", ["planar_leg_strong", "parallelogram_leg"])
def test_effects_are_compensated(name, effect, values):
    """Inverse dynamics of logs, a different code, needs the torque that the controller commands."""
    where = "shin" if effect == "payload_mass" else "knee"
    robot = load_robot(name).with_effect(effect_class(effect).at(where, values))
    controller = controller_of(robot)
    generator = np.random.default_rng(2)
    for _ in range(6):
        q, v = random_state(robot, generator)
        command = controller.step(Motion(q, v))
        motion = Motion(q[None], v[None], command.acceleration[None])
        pushed = contact_torque(robot, q[None], {"foot": command.forces["foot"][None]})
        needed, left = rotor_torque(robot, motion, link_torque(robot, motion), pushed)
        scale = 1.0 + np.abs(command.forces["foot"]).max()
        np.testing.assert_allclose(command.rotor_torque, needed[0], atol=1e-6 * scale)
        np.testing.assert_allclose(left, 0.0, atol=1e-5 * scale)


@pytest.mark.parametrize("policy", list(RestPolicy))
@pytest.mark.parametrize("speed", [0.0, 0.01, 0.5])
def test_torque_near_rest_stays_inside_the_stiction_interval(policy, speed):
    robot = load_robot("planar_leg_strong")
    gears = robot.transmission
    blend = SpeedBlend(full_speed=0.05, trusted_error=0.0, correction=0.0)
    controller = controller_of(robot, rest_policy=policy, speed_blend=blend)
    q = robot.configuration(hip=-0.4, knee=0.8)
    v = np.zeros(5)
    v[3:] = speed
    command = controller.step(Motion(q, v))
    own = gears.reflected_inertia * command.acceleration[3:]
    mesh = gears.gear_ratio * command.rotor_torque - own
    ends = (
        np.array([gears.backward_efficiency, 1.0 / gears.forward_efficiency])
        * command.output_torque
    )
    assert np.all(mesh >= ends.min(axis=0) - 1e-9)
    assert np.all(mesh <= ends.max(axis=0) + 1e-9)
    if speed == 0.0:
        share = {
            RestPolicy.NEUTRAL: command.output_torque,
            RestPolicy.LEAST_TORQUE: ends[np.argmin(np.abs(ends), axis=0), [0, 1]],
            RestPolicy.MOST_MARGIN: ends.mean(axis=0),
        }[policy]
        np.testing.assert_allclose(mesh, share, rtol=1e-9)
    assert command.consistent


WEIGHT = 19.0 * 9.81


@pytest.mark.parametrize("name", ["planar_leg_strong", "parallelogram_leg"])
def test_lossless_robot_gets_the_classical_torques(name):
    """Dense program in (qdd, f, tau) with the classical equation of motion, solved by daqp."""
    robot = load_robot(name).lossless()
    controller = leg_controller(robot)
    generator = np.random.default_rng(3)
    compared = 0
    for _ in range(40):
        q, v = random_state(robot, generator)
        com, posture = 0.2 * generator.normal(size=2), generator.normal(size=2)
        command = controller.step(Motion(q, v), leg_references(com, posture))
        task = leg_rows(robot, evaluate(robot, q, v), com, posture)
        found = solve_in_directions(
            robot,
            q,
            v,
            np.zeros(2),
            task,
            [0, 2],
            force_share=np.array([0.0, WEIGHT]),
            guarded=False,
        )
        assert command.status.usable is (found is not None), command.message
        if found is None:
            continue
        _, acceleration, force, torque = found
        scale = 1.0 + np.abs(acceleration).max()
        np.testing.assert_allclose(command.acceleration, acceleration, atol=1e-4 * scale)
        np.testing.assert_allclose(command.rotor_torque, torque, atol=1e-4 * scale)
        np.testing.assert_allclose(command.forces["foot"][[0, 2]], force, atol=1e-3 * scale)
        compared += 1
    assert compared > 15
