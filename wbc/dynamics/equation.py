"""The redundant model with real rotors, and the dissipative equation of motion that it reduces to.

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

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.dynamics.terms import Terms
from wbc.robot import Robot
from wbc.transmission import efficiency


@dataclass(frozen=True, eq=False)
class RotorCoupling:
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
    world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    for i, housing in enumerate(robot.mounting.housing.tolist()):
        if housing == 0:
            continue
        axis = data.oMi[housing].rotation @ robot.mounting.axis[i]
        turning = pin.getJointJacobian(model, data, housing, world)[3:].reshape(3, nv)
        rate = turning @ velocity
        drift = pin.getAcceleration(model, data, housing, world).angular
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
    nullspace[nv:, robot.actuated] = gears.gear_ratio[:, None] * gears.motor_from_joint
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

    Args:
        robot: the robot.
        terms: its terms at a state.
        directions: (m,) +1 where the mesh power runs forward, -1 backward, 0 without loss.

    Raises:
        TransmissionError: a self-locking gear called backward.
    """
    gears = robot.transmission
    model = redundant_model(robot, terms)
    eta = efficiency(directions, gears.forward_efficiency, gears.backward_efficiency)
    nv = robot.model.nv
    weighted = model.nullspace.copy()
    weighted[nv:] *= eta[:, None]
    actuation = np.zeros((nv, gears.size))
    actuation[robot.actuated] = gears.distribution * eta
    return DissipativeEquation(
        inertia=weighted.T @ model.inertia @ model.nullspace,
        bias=weighted.T @ model.bias,
        actuation=actuation,
    )
