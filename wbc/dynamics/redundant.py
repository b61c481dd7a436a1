"""The redundant model s = [q_b, q_m, phi] with real rotors, and the maps that reduce it.

Sim & Ramos, section IV: H_s s_ddot + c_s - A' lambda = tau_s + tau_d, A K = 0, ds = K dq.
Here the rows of s follow pinocchio's joint order with the rotors behind: s = [q, phi]; for a robot
whose undriven joints come first, as every floating base does, that is the paper's order.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.dynamics.rotors import rotor_coupling
from wbc.dynamics.terms import Terms
from wbc.robot import Robot


@dataclass(frozen=True, eq=False)
class RedundantModel:
    """H_s and c_s with the constraint's Jacobian and null space.

    Attributes:
        inertia: H_s (nv + m, nv + m).
        bias: c_s (nv + m,).
        constraint: A (m, nv + m), A ds = dq_m - D R dphi.
        nullspace: K (nv + m, nv), ds = K dq.
    """

    inertia: FloatArray
    bias: FloatArray
    constraint: FloatArray
    nullspace: FloatArray


def constraint_nullspace(robot: Robot) -> FloatArray:
    """Return K (nv + m, nv): ds = K dq, identity over (D R)^-1 on the driven columns."""
    nv, gears = robot.model.nv, robot.transmission
    nullspace = np.zeros((nv + gears.size, nv))
    nullspace[:nv] = np.eye(nv)
    nullspace[nv:, robot.actuated] = gears.gear_ratio[:, None] * gears.motor_from_joint
    return nullspace


def constraint_jacobian(robot: Robot) -> FloatArray:
    """Return A (m, nv + m): the constraint's velocity is dq_m - D R dphi."""
    nv, gears = robot.model.nv, robot.transmission
    jacobian = np.zeros((gears.size, nv + gears.size))
    jacobian[np.arange(gears.size), robot.actuated] = 1.0
    jacobian[:, nv:] = -gears.topology @ gears.reduction
    return jacobian


def redundant_model(robot: Robot, terms: Terms) -> RedundantModel:
    """Return the redundant model at the state of `terms`.

    Where `robot.rotors_turn_with_links` is set, the rotors are real bodies on their housings and
    H_s holds their inertial coupling with the links, c_s their gyroscopic torque. The links'
    inertias include the rotors at standstill either way.
    """
    nv, m = robot.model.nv, robot.transmission.size
    inertia = np.zeros((nv + m, nv + m))
    bias = np.zeros(nv + m)
    inertia[:nv, :nv] = terms.mass_matrix
    bias[:nv] = terms.bias
    inertia[nv + np.arange(m), nv + np.arange(m)] = robot.transmission.rotor_inertia
    if robot.rotors_turn_with_links:
        coupling = rotor_coupling(robot, terms)
        inertia[nv:, :nv] = coupling.inertia
        inertia[:nv, nv:] = coupling.inertia.T
        bias[:nv] += coupling.link_bias
        bias[nv:] += coupling.rotor_bias
    return RedundantModel(inertia, bias, constraint_jacobian(robot), constraint_nullspace(robot))
