"""Inertial coupling between the spin of a rotor and the motion of its housing.

A rotor is symmetric about its axis a and its inertia at standstill belongs to the link that
carries it. What its spin phi_dot adds to the kinetic energy is

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


def rotor_coupling(robot: Robot, terms: Terms) -> RotorCoupling:
    """Return the coupling at the state of `terms`, rotor speeds following from the gears.

    Housings and axes are those of `robot.mounting`; a rotor on the fixed world couples to
    nothing.
    """
    gears, model, data = robot.transmission, robot.model, terms.data
    nv, m = model.nv, gears.size
    spin = gears.gear_ratio * (gears.motor_from_joint @ terms.velocity[robot.actuated])
    inertia, link_bias, rotor_bias = np.zeros((m, nv)), np.zeros(nv), np.zeros(m)
    world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    for i, housing in enumerate(robot.mounting.housing.tolist()):
        if housing == 0:
            continue
        axis = data.oMi[housing].rotation @ robot.mounting.axis[i]
        turning = pin.getJointJacobian(model, data, housing, world)[3:].reshape(3, nv)
        rate = turning @ terms.velocity
        drift = pin.getAcceleration(model, data, housing, world).angular
        moment = gears.rotor_inertia[i]
        inertia[i] = moment * (axis @ turning)
        link_bias += turning.T @ np.cross(rate, moment * spin[i] * axis)
        rotor_bias[i] = moment * (axis @ drift)
    return RotorCoupling(inertia, link_bias, rotor_bias)
