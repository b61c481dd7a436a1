"""Inverse dynamics of whole logs: (N, nv) arrays in, the rotor torques the model needs out."""

from __future__ import annotations

from collections.abc import Mapping
from functools import reduce
from operator import add

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.dynamics.equation import Workspace, evaluate, rotor_coupling
from wbc.errors import DynamicsError
from wbc.robot import Motion, Robot
from wbc.transmission import mesh_input


def link_torque(robot: Robot, motion: Motion) -> FloatArray:
    """Return H_l a + c_l (N, nv) [N m, N], what the links need, without rotors and contacts."""
    return inverse_dynamics(robot.model, motion.position, motion.velocity, _acceleration(motion))


def inverse_dynamics(
    model: pin.Model, position: FloatArray, velocity: FloatArray, acceleration: FloatArray
) -> FloatArray:
    """Return H a + c (N, nv) [N m, N] along q (N, nq), v and a (N, nv), gravity the model's."""
    # One call for the log: sample by sample, Python takes nine times as long as a leg's dynamics.
    columns = position.T, velocity.T, acceleration.T
    torque = pin.rneaInParallel(1, pin.ModelPool(model, 1), *columns)
    # With one coordinate pinocchio returns a vector.
    return np.ascontiguousarray(torque.reshape(model.nv, -1).T)


def inertial_regressor(robot: Robot, motion: Motion) -> FloatArray:
    """Return Y (N, nv, 10 n_links) with `link_torque` = Y @ theta.

    theta stacks pinocchio's ten parameters of each moving link, in joint order; Y therefore holds
    what any change of mass, centre of mass or inertia adds to the torque. Gravity is the robot's.
    """
    data = robot.model.createData()
    acceleration = _acceleration(motion)
    columns = 10 * (robot.model.njoints - 1)
    result = np.zeros((*acceleration.shape, columns))
    for i, (q, v, a) in enumerate(zip(motion.position, motion.velocity, acceleration, strict=True)):
        result[i] = pin.computeJointTorqueRegressor(robot.model, data, q, v, a)
    return result


def inertial_parameters(robot: Robot) -> FloatArray:
    """Return theta (10 n_links,), pinocchio's dynamic parameters of every moving link."""
    return np.ravel([body.toDynamicParameters() for body in list(robot.model.inertias)[1:]])


def contact_torque(
    robot: Robot,
    position: FloatArray,
    forces: Mapping[str, FloatArray],
    points: Mapping[str, FloatArray] | None = None,
) -> FloatArray:
    """Return J' f (N, nv) of measured contact forces.

    Args:
        robot: the robot.
        position: q (N, nq).
        forces: contact name -> (N, 3) [N], ground on robot, world axes, as sensors report them.
        points: contact name -> `point_jacobians` at these positions, where they are known.

    Raises:
        RobotError: a contact that the robot does not have.
    """
    result = np.zeros((len(position), robot.model.nv))
    for name, force in forces.items():
        point = point_jacobians(robot, position, name) if points is None else points[name]
        true = force / robot.contact(name).sensor_gain
        result += np.einsum("nij,ni->nj", point, true @ _at_ground(robot, name))
    return result


def contact_jacobians(robot: Robot, position: FloatArray, name: str) -> FloatArray:
    """Return J (N, 3, nv) at q (N, nq) of the velocity of what touches level ground, world axes.

    Raises:
        RobotError: a contact that the robot does not have.
    """
    return np.asarray(_at_ground(robot, name) @ point_jacobians(robot, position, name))


def _at_ground(robot: Robot, name: str) -> FloatArray:
    """Return (3, 6) what touches level ground moves by, of the motion of a contact's point.

    A ball touches a radius r below its centre c and turns with its link:

        v_contact = v_c + r n x w,     n the normal of the ground, w the link's angular velocity.
    """
    below = np.eye(3, 6)
    below[:, 3:] = robot.contact(name).radius * pin.skew(level_normal(robot))
    return below


def point_jacobians(robot: Robot, position: FloatArray, name: str) -> FloatArray:
    """Return J (N, 6, nv) at q (N, nq) of the velocity of a contact's point and of its link.

    Raises:
        RobotError: a contact that the robot does not have.
    """
    space, world = Workspace(robot), pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    frame = space.frames[robot.contacts.index(robot.contact(name))]
    result = np.empty((len(position), 6, robot.model.nv))
    for row, q in enumerate(position):
        jacobian = pin.computeFrameJacobian(space.model, space.data, q, frame, world)
        result[row] = jacobian.reshape(6, -1)  # of one coordinate pinocchio returns a vector
    return result


def level_normal(robot: Robot) -> FloatArray:
    """Return (3,) the normal of level ground: against gravity, or z without gravity."""
    gravity = np.asarray(robot.model.gravity.linear)
    size = float(np.linalg.norm(gravity))
    return -gravity / size if size > 0.0 else np.array([0.0, 0.0, 1.0])


def rotor_torque(
    robot: Robot, motion: Motion, links: FloatArray, contacts: FloatArray | float = 0.0
) -> tuple[FloatArray, FloatArray]:
    """Return the rotor torque that a motion needs, and the torque no motor can give.

    From the links through joint friction, topology, mesh, rotor and drive:

        tau = H_l a + c_l - J'f - tau_effects + level sgn(v);  T = D' tau_m;
        t = T/eta_f or eta_b T;  N tau_phi = t + N^2 I_r psi_ddot + rotor friction - effects.

    Args:
        robot: the robot with its effects (structural ones already act on `links`).
        motion: (N, ...) arrays; accelerations are needed for the rotors.
        links: H_l a + c_l (N, nv), from `link_torque` or a regressor.
        contacts: J' f (N, nv).

    Returns:
        (N, m) rotor torque as the drive would report it [N m], and (N, b) the torque left on the
        undriven coordinates, which is zero for a perfect model.
    """
    output, lacking = output_torque(robot, motion, links, contacts)
    return motor_torque(robot, motion, output), lacking


def output_torque(
    robot: Robot, motion: Motion, links: FloatArray, contacts: FloatArray | float = 0.0
) -> tuple[FloatArray, FloatArray]:
    """Return what a motion asks of the gears' outputs, T (N, m), and of no motor, (N, b).

    The link side of `rotor_torque`: T = D' tau_m; arguments as there.
    """
    torque = links - contacts
    if robot.rotors_turn_with_links:
        torque = torque + _coupling_torque(robot, motion)[0]
    smooth = [effect.joint_torque(robot, motion) for effect in robot.effects]
    level = [effect.joint_friction(robot, motion) for effect in robot.effects]
    if pushed := [own for own in smooth if own is not None]:
        torque = torque - reduce(add, pushed)
    if dry := [own for own in level if own is not None]:
        torque = torque + reduce(add, dry) * np.sign(motion.velocity)
    output = torque[..., robot.actuated] @ robot.transmission.topology
    return output, torque[..., robot.unactuated]


def motor_torque(robot: Robot, motion: Motion, output: FloatArray) -> FloatArray:
    """Return the rotor torque (N, m) that the drives report while gears give T, output (N, m).

    The drive side of `rotor_torque`: mesh, rotor and drive.
    """
    # Most robots have none of some terms, and a diagnosis asks for whole logs again and again.
    gears = robot.transmission
    efficiencies = robot.gear_efficiencies(motion)
    mesh = output
    if not all(np.all(efficiency == 1.0) for efficiency in efficiencies):
        mesh = mesh_input(output, _at_motors(robot, motion.velocity), *efficiencies)
    for effect in robot.effects:
        mesh = effect.meshed(robot, motion, output, mesh)
    rotor = mesh / gears.gear_ratio
    if robot.rotors_turn_with_links:
        rotor = rotor + _coupling_torque(robot, motion)[1]
    if np.any(gears.rotor_inertia):
        turning = _at_motors(robot, _acceleration(motion))
        rotor = rotor + gears.rotor_inertia * gears.gear_ratio * turning
    if np.any(gears.rotor_coulomb_friction) or np.any(gears.rotor_viscous_friction):
        spin = _at_motors(robot, motion.velocity) * gears.gear_ratio
        rotor = rotor + gears.rotor_coulomb_friction * np.sign(spin)
        rotor = rotor + gears.rotor_viscous_friction * spin
    for effect in robot.effects:
        added = effect.rotor_torque(robot, motion)
        if added is not None:
            rotor = rotor - added
    for effect in reversed(robot.effects):
        rotor = effect.drive_inverse(robot, motion, rotor)
    return rotor


def _coupling_torque(robot: Robot, motion: Motion) -> tuple[FloatArray, FloatArray]:
    """Return what spinning rotors ask of the links (..., nv) and the links' turning of them."""
    gears, space = robot.transmission, Workspace(robot)
    acceleration = _acceleration(motion)
    spin_rate = _at_motors(robot, acceleration) * gears.gear_ratio
    on_links = np.zeros(acceleration.shape)
    on_rotors = np.zeros(spin_rate.shape)
    for row in np.ndindex(acceleration.shape[:-1]):
        terms = evaluate(robot, motion.position[row], motion.velocity[row], space)
        inertia, link_bias, rotor_bias = rotor_coupling(robot, terms.velocity, terms.data)
        on_links[row] = inertia.T @ spin_rate[row] + link_bias
        on_rotors[row] = inertia @ acceleration[row] + rotor_bias
    return on_links, on_rotors


def _at_motors(robot: Robot, rate: FloatArray) -> FloatArray:
    """Return how fast (..., m) motors turn behind their gears, of velocities or accelerations."""
    return np.asarray(rate[..., robot.actuated] @ robot.transmission.motor_from_joint.T)


def _acceleration(motion: Motion) -> FloatArray:
    if motion.acceleration is None:
        raise DynamicsError("inverse dynamics needs a motion with accelerations.")
    return motion.acceleration
