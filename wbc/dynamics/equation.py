"""Terms of the equation of motion, the redundant model with real rotors, and what it reduces to.

Terms are evaluated once per state and shared by everything else.

Sim & Ramos, section IV: H_s s_ddot + c_s - A' lambda = tau_s + tau_d, A K = 0, ds = K dq.
Here the rows of s follow pinocchio's joint order with the rotors behind: s = [q, phi]; for a robot
whose undriven joints come first, as every floating base does, that is the paper's order.

Coupling between the spin of a rotor and the motion of its housing: a rotor is symmetric about its
axis a, and its inertia at standstill belongs to the link that carries it. What its spin phi_dot
adds to the kinetic energy is

    1/2 I_r phi_dot^2 + I_r phi_dot a'omega,

omega being the angular velocity of the housing, hence the rows I_r a'J_omega of H_s, the
gyroscopic torque J_omega'(omega x I_r phi_dot a) on the links, and the drift I_r a'(dJ_omega/dt v)
on the rotor.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.errors import DynamicsError
from wbc.robot import Robot
from wbc.transmission import efficiency

_WORLD = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


@dataclass(frozen=True, eq=False, slots=True)
class Terms:
    """Link-side quantities at one state; the rotors are not in them.

    Attributes:
        position: q (nq,).
        velocity: v (nv,).
        mass_matrix: H_l (nv, nv), inertia of the links without reflected rotor inertia.
        bias: c_l (nv,), Coriolis, centrifugal and gravity torque [N m, N].
        contact_jacobian: J (3k, nv), linear velocity of the k contact points, world axes.
        contact_position: (k, 3) [m], world.
        data: pinocchio's data at this state, for further kinematics; overwritten by the next
            `evaluate` with the same workspace. What it returns are views of its memory: keep the
            terms for as long as you use them, or copy. `evaluate(...).data.com[0]` reads memory
            that is free already; `evaluate(...).center_of_mass` does not.
    """

    position: FloatArray
    velocity: FloatArray
    mass_matrix: FloatArray
    bias: FloatArray
    contact_jacobian: FloatArray
    contact_position: FloatArray
    data: pin.Data

    @property
    def center_of_mass(self) -> FloatArray:
        """Centre of mass (3,) [m], world; a copy, taken from `data` when asked."""
        return np.array(self.data.com[0])


class Workspace:
    """Memory for evaluating one robot; make one per thread and keep it.

    Contact points become operational frames of a private copy of the model, so that pinocchio
    computes their Jacobians directly.
    """

    def __init__(self, robot: Robot) -> None:
        """Prepare memory for `robot`."""
        model = robot.model.copy() if robot.contacts else robot.model
        self.robot = robot
        self.frames: list[int] = []
        for contact in robot.contacts:
            number, name = model.getFrameId(contact.frame), f"contact:{contact.name}"
            parent = model.frames[number]
            place = parent.placement * contact.placement()
            frame = pin.Frame(name, parent.parentJoint, number, place, pin.FrameType.OP_FRAME)
            self.frames.append(model.addFrame(frame, False))
        self.model = model
        self.data = model.createData()
        self._zero = np.zeros(model.nv)


def evaluate(
    robot: Robot, position: FloatArray, velocity: FloatArray, workspace: Workspace | None = None
) -> Terms:
    """Evaluate the link-side terms at q (nq,) and v (nv,).

    A workspace is reusable memory; a new one is made when left out (slower).

    Raises:
        DynamicsError: a wrong shape, or a workspace that belongs to another robot.
    """
    space = Workspace(robot) if workspace is None else workspace
    if space.robot is not robot:
        raise DynamicsError(
            f"the workspace belongs to '{space.robot.name}' (another object than '{robot.name}'); "
            "make a new Workspace after every with_... change."
        )
    model, data = space.model, space.data
    if position.shape != (model.nq,) or velocity.shape != (model.nv,):
        raise DynamicsError(
            f"'{robot.name}' needs q of shape ({model.nq},) and v of shape ({model.nv},), "
            f"got {position.shape} and {velocity.shape}."
        )
    pin.computeAllTerms(model, data, position, velocity)
    k = len(space.frames)
    jacobian, points = np.empty((3 * k, model.nv)), np.empty((k, 3))
    pin.forwardKinematics(model, data, position, velocity, space._zero)
    for i, frame in enumerate(space.frames):
        pin.updateFramePlacement(model, data, frame)
        columns = pin.getFrameJacobian(model, data, frame, _WORLD)
        jacobian[3 * i : 3 * i + 3] = columns[:3].reshape(3, -1)  # a vector of one coordinate
        points[i] = data.oMf[frame].translation
    return Terms(position, velocity, data.M.copy(), data.nle.copy(), jacobian, points, data)


class RotorCoupling(NamedTuple):
    """What the coupling adds to the redundant model.

    Attributes:
        inertia: I_r a'J_omega (m, nv), the rotor rows of H_s.
        link_bias: gyroscopic torque (nv,) in c_s [N m].
        rotor_bias: (m,) in c_s [N m].
    """

    inertia: FloatArray
    link_bias: FloatArray
    rotor_bias: FloatArray


def rotor_coupling(robot: Robot, velocity: FloatArray, data: pin.Data) -> RotorCoupling:
    """Return the coupling at v (nv,), rotor speeds following from the gears.

    Housings and axes are those of `robot.mounting`; a rotor on the fixed world couples to
    nothing. `data` holds joint Jacobians, and accelerations at v' = 0, at the state.
    """
    gears, model = robot.transmission, robot.model
    nv, m = model.nv, gears.size
    spin = gears.gear_ratio * (gears.motor_from_joint @ velocity[robot.actuated])
    inertia, link_bias, rotor_bias = np.zeros((m, nv)), np.zeros(nv), np.zeros(m)
    for i, housing in enumerate(robot.mounting.housing.tolist()):
        if housing == 0:
            continue
        axis = data.oMi[housing].rotation @ robot.mounting.axis[i]
        turning = pin.getJointJacobian(model, data, housing, _WORLD)[3:].reshape(3, nv)
        rate = turning @ velocity
        drift = pin.getAcceleration(model, data, housing, _WORLD).angular
        moment = gears.rotor_inertia[i]
        inertia[i] = moment * (axis @ turning)
        link_bias += turning.T @ np.cross(rate, moment * spin[i] * axis)
        rotor_bias[i] = moment * (axis @ drift)
    return RotorCoupling(inertia, link_bias, rotor_bias)


@dataclass(frozen=True, eq=False)
class RedundantModel:
    """H_s and c_s with the constraint's null space.

    Attributes:
        inertia: H_s (nv + m, nv + m).
        bias: c_s (nv + m,).
        nullspace: K (nv + m, nv), ds = K dq, identity over (D R)^-1 on the driven columns.
    """

    inertia: FloatArray
    bias: FloatArray
    nullspace: FloatArray


def redundant_model(robot: Robot, terms: Terms) -> RedundantModel:
    """Return the redundant model at the state of `terms`.

    Where `robot.rotors_turn_with_links` is set, the rotors are real bodies on their housings and
    H_s holds their inertial coupling with the links, c_s their gyroscopic torque. The links'
    inertias include the rotors at standstill either way.
    """
    nv, gears = robot.model.nv, robot.transmission
    m = gears.size
    inertia, bias = np.zeros((nv + m, nv + m)), np.zeros(nv + m)
    inertia[:nv, :nv], bias[:nv] = terms.mass_matrix, terms.bias
    inertia[nv:, nv:] = np.diag(gears.rotor_inertia)
    if robot.rotors_turn_with_links:
        coupling = rotor_coupling(robot, terms.velocity, terms.data)
        inertia[nv:, :nv] = coupling.inertia
        inertia[:nv, nv:] = coupling.inertia.T
        bias[:nv] += coupling.link_bias
        bias[nv:] += coupling.rotor_bias
    nullspace = np.eye(nv + m, nv)
    nullspace[nv:] = gears.gear_ratio[:, None] * robot.motor_rows
    return RedundantModel(inertia, bias, nullspace)


@dataclass(frozen=True, eq=False)
class DissipativeEquation:
    """inertia @ qdd + bias = J' f_ext + actuation @ tau_phi for fixed directions of power.

    Attributes:
        inertia: K' E_s H_s K (nv, nv); symmetric only without rotor-link coupling.
        bias: K' E_s c_s (nv,).
        actuation: [0; B E_m] (nv, m), columns per rotor.
    """

    inertia: FloatArray
    bias: FloatArray
    actuation: FloatArray

    def acceleration(self, rotor_torque: FloatArray, external: FloatArray) -> FloatArray:
        """Return qdd (nv,) under rotor torques (m,) and an external joint-space force (nv,)."""
        force = external + self.actuation @ rotor_torque - self.bias
        return np.asarray(np.linalg.solve(self.inertia, force))


def dissipative_equation(robot: Robot, terms: Terms, directions: FloatArray) -> DissipativeEquation:
    """Return the dissipative equation of motion (Sim & Ramos, section IV) as the paper states it.

    The directions (m,) are +1 where the mesh power runs forward, -1 backward, 0 without loss.

    Raises:
        TransmissionError: a self-locking gear called backward.
    """
    gears = robot.transmission
    model = redundant_model(robot, terms)
    eta = efficiency(directions, gears.forward_efficiency, gears.backward_efficiency)
    nv = robot.model.nv
    weighted = model.nullspace.copy()
    weighted[nv:] *= eta[:, None]
    return DissipativeEquation(
        inertia=weighted.T @ model.inertia @ model.nullspace,
        bias=weighted.T @ model.bias,
        actuation=robot.motor_rows.T * gears.gear_ratio * eta,
    )
