"""Inverse dynamics of logs against samples, forward dynamics, and rotors on joints of their own."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from tests.control.scenes import random_state
from tests.sim.random_robots import geared
from wbc import dynamics, load_robot
from wbc.arrays import FloatArray
from wbc.errors import DynamicsError, RobotError
from wbc.robot import Motion, Robot

NAMES = ["emps", "planar_leg", "parallelogram_leg", "differential_biped", "solo12"]
SAMPLES = 12
COUPLED = ["planar_leg", "parallelogram_leg", "differential_biped", "solo12", "staubli_tx40"]
MASS, ACROSS = 0.2, 3e-4


def random_motion(robot: Robot, seed: int, samples: int = SAMPLES) -> Motion:
    rng, start = np.random.default_rng(seed), robot.neutral()
    moved = rng.normal(size=(samples, robot.model.nv))
    q = np.array([pin.integrate(robot.model, start, step) for step in moved])
    return Motion(q, *rng.normal(size=(2, *moved.shape)))


@pytest.mark.parametrize("name", NAMES)
def test_a_log_is_its_samples(name: str) -> None:
    robot = geared(load_robot(name), rotor_coulomb_friction=0.02, rotor_viscous_friction=1e-4)
    motion = random_motion(robot, 1)
    links = dynamics.link_torque(robot, motion)
    torque, rest = dynamics.rotor_torque(robot, motion, links)
    for i in range(SAMPLES):
        terms = dynamics.evaluate(robot, motion.position[i], motion.velocity[i])
        needed = terms.mass_matrix @ motion.acceleration[i] + terms.bias
        np.testing.assert_allclose(links[i], needed, atol=1e-9)
        single = Motion(motion.position[i], motion.velocity[i], motion.acceleration[i])
        one, left = dynamics.rotor_torque(robot, single, links[i])
        np.testing.assert_allclose(torque[i], one, atol=1e-12)
        np.testing.assert_allclose(rest[i], left, atol=1e-12)


@pytest.mark.parametrize("name", ["planar_leg", "parallelogram_leg"])
def test_inverse_undoes_forward_dynamics(name: str) -> None:
    robot = load_robot(name)
    motion = random_motion(robot, 2, 40)
    links = dynamics.link_torque(robot, motion)
    torque, rest = dynamics.rotor_torque(robot, motion, links)
    gears, seen = robot.transmission, set()
    for i in range(40):
        speed = gears.motor_from_joint @ motion.velocity[i][robot.actuated]
        mode = np.sign(gears.topology.T @ links[i][robot.actuated] * speed)
        seen.add(tuple(mode))
        terms = dynamics.evaluate(robot, motion.position[i], motion.velocity[i])
        external = np.zeros(robot.model.nv)
        external[robot.unactuated] = rest[i]
        found = dynamics.dissipative_equation(robot, terms, mode).acceleration(torque[i], external)
        np.testing.assert_allclose(found, motion.acceleration[i], rtol=1e-8, atol=1e-8)
    assert len(seen) == 4


@pytest.mark.parametrize("name", ["planar_leg", "solo12"])
def test_the_regressor_times_the_parameters_is_the_torque(name: str) -> None:
    robot = load_robot(name)
    motion = random_motion(robot, 4)
    product = dynamics.inertial_regressor(robot, motion) @ dynamics.inertial_parameters(robot)
    np.testing.assert_allclose(product, dynamics.link_torque(robot, motion), atol=1e-9)
    # Another parameter vector gives the torque of the robot that has it.
    last = robot.model.njoints - 1
    load = pin.Inertia(0.5, np.array([0.1, 0.0, -0.2]), 1e-3 * np.eye(3))
    heavier = robot.with_inertia(last, robot.model.inertias[last] + load)
    product = dynamics.inertial_regressor(robot, motion) @ dynamics.inertial_parameters(heavier)
    np.testing.assert_allclose(product, dynamics.link_torque(heavier, motion), atol=1e-9)


def test_contact_forces_do_the_work_of_the_moving_contact() -> None:
    robot = load_robot("differential_biped")
    motion, drawn = random_motion(robot, 5, 3), np.random.default_rng(6).normal(size=(2, 3, 3))
    forces = dict(zip(("left_toe", "right_heel"), drawn, strict=True))
    torque = dynamics.contact_torque(robot, motion.position, forces)
    names = [contact.name for contact in robot.contacts]
    for i in range(3):
        terms = dynamics.evaluate(robot, motion.position[i], motion.velocity[i])
        speed = (terms.contact_jacobian @ motion.velocity[i]).reshape(-1, 3)
        work = sum(float(f[i] @ speed[names.index(n)]) for n, f in forces.items())
        assert torque[i] @ motion.velocity[i] == pytest.approx(work)
    with pytest.raises(RobotError, match="left_toe"):
        dynamics.contact_torque(robot, motion.position, {"toe": np.zeros((3, 3))})
    np.testing.assert_array_equal(dynamics.contact_torque(robot, motion.position, {}), 0.0)


def test_a_ball_is_pushed_where_it_touches_the_ground() -> None:
    robot = load_robot("solo12")
    foot, radius = robot.contacts[0], 0.03
    ball = robot.with_contacts((replace(foot, radius=radius), *robot.contacts[1:]))
    q, force = random_motion(robot, 7, 1).position, {foot.name: np.array([[3.0, -2.0, 20.0]])}
    frame = robot.model.getFrameId(foot.frame)
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q[0])
    below = foot.offset - data.oMf[frame].rotation.T @ [0.0, 0.0, radius]
    point = robot.with_contacts((replace(foot, offset=below), *robot.contacts[1:]))
    np.testing.assert_allclose(
        dynamics.contact_torque(ball, q, force),
        dynamics.contact_torque(point, q, force),
        atol=1e-12,
    )


def test_a_measured_contact_force_carries_its_part_of_the_load() -> None:
    robot = load_robot("planar_leg").lossless()
    weight = 9.81 * sum(inertia.mass for inertia in robot.model.inertias)
    still = Motion(robot.pose("paper")[None], *np.zeros((2, 1, 5)))
    force = dynamics.contact_torque(robot, still.position, {"foot": np.array([[0.0, 0.0, weight]])})
    torque, rest = dynamics.rotor_torque(robot, still, dynamics.link_torque(robot, still), force)
    # The foot is straight under the hip. Both links' centres lie 0.1 m ahead of it, the shin's
    # centre 0.1 m behind the knee, the foot 0.2 m behind the knee.
    links = 4.0 * 9.81 * 0.1
    np.testing.assert_allclose(rest[0], [0.0, 0.0, -links], atol=1e-9)
    knee = 2.0 * 9.81 * 0.1 - weight * 0.2
    np.testing.assert_allclose(20.0 * torque[0], [-links, knee], atol=1e-9)


def test_what_there_is_not_is_named() -> None:
    robot = load_robot("planar_leg_fixed")
    with pytest.raises(DynamicsError, match="accelerations"):
        dynamics.link_torque(robot, Motion(np.zeros((2, 2)), np.zeros((2, 2))))
    gears = robot.transmission.replace(housings=("base", "tigh"))
    with pytest.raises(RobotError, match="Did you mean 'thigh'"):
        _ = robot.with_transmission(gears).mounting


def rotor_body(axis: FloatArray, spin: float) -> pin.Inertia:
    """Return a rotor about `axis`: symmetric, with a mass and an inertia across the axis too."""
    moment = ACROSS * np.eye(3) + (spin - ACROSS) * np.outer(axis, axis)
    return pin.Inertia(MASS, np.zeros(3), moment)


def with_real_rotors(robot: Robot) -> pin.Model:
    """Return the links with one revolute joint and body per rotor behind them: its v is s_dot."""
    model, gears = robot.model.copy(), robot.transmission
    mounted = zip(robot.mounting.housing.tolist(), robot.mounting.axis, strict=True)
    for gear, (housing, axis) in enumerate(mounted):
        kind = pin.JointModelRevoluteUnaligned(*axis)
        joint = model.addJoint(housing, kind, pin.SE3.Identity(), f"rotor:{gears.joints[gear]}")
        body = rotor_body(axis, gears.rotor_inertia[gear])
        model.appendBodyToJoint(joint, body, pin.SE3.Identity())
    return model


def effort(model: pin.Model, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
    """Return what this motion needs; rotors stand at zero, as their place tells nothing."""
    full = np.concatenate((q, np.zeros(model.nq - len(q))))
    return pin.rnea(model, model.createData(), full, v, a).copy()


def carrying(robot: Robot) -> Robot:
    """Return the robot whose links hold their rotors at standstill, as the library asks."""
    loaded = replace(robot, rotors_turn_with_links=True)
    for gear, housing in enumerate(robot.mounting.housing.tolist()):
        if housing:
            body = rotor_body(robot.mounting.axis[gear], robot.transmission.rotor_inertia[gear])
            loaded = loaded.with_inertia(housing, loaded.model.inertias[housing] + body)
    return loaded


@pytest.mark.parametrize("name", COUPLED)
@pytest.mark.parametrize("seed", [0, 1])
def test_redundant_inertia_and_bias_are_those_of_real_rotor_joints(name: str, seed: int) -> None:
    robot = load_robot(name)
    real, ours = with_real_rotors(robot), carrying(robot)
    q, v = random_state(ours, np.random.default_rng(seed))
    model = dynamics.redundant_model(ours, dynamics.evaluate(ours, q, v))
    rest = np.zeros(real.nv)
    held = effort(real, q, rest, rest)
    mass = np.stack([effort(real, q, rest, unit) - held for unit in np.eye(real.nv)], axis=1)
    np.testing.assert_allclose(model.inertia, mass, atol=1e-9)
    bias = effort(real, q, model.nullspace @ v, rest)
    np.testing.assert_allclose(model.bias, bias, atol=1e-8)


@pytest.mark.parametrize("name", ["planar_leg", "parallelogram_leg", "solo12"])
def test_inverse_dynamics_with_coupling_is_that_of_real_rotor_joints(name: str) -> None:
    robot = load_robot(name).lossless()
    real, ours = with_real_rotors(robot), carrying(robot)
    q, v = random_state(ours, np.random.default_rng(3))
    a = np.random.default_rng(4).normal(size=robot.model.nv)
    nullspace = dynamics.redundant_model(ours, dynamics.evaluate(ours, q, v)).nullspace
    # Perfect gears: the rotor torque does the work of everything that moves with the joint.
    nv, gears = robot.model.nv, robot.transmission
    needed = nullspace.T @ effort(real, q, nullspace @ v, nullspace @ a)
    tau = np.linalg.solve(gears.distribution, needed[robot.actuated])
    motion = Motion(q[None], v[None], a[None])
    found, rest = dynamics.rotor_torque(ours, motion, dynamics.link_torque(ours, motion))
    np.testing.assert_allclose(found[0], tau, atol=1e-9)
    np.testing.assert_allclose(rest[0], needed[:nv][robot.unactuated], atol=1e-9)
