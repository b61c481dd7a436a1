"""The dissipative dynamics of one tick, as rows over accelerations and contact forces."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray, IntArray
from wbc.control.kinematics import Kinematics
from wbc.control.limits import JointLimit
from wbc.control.program.balance import place_output
from wbc.control.selection import as_rows
from wbc.dynamics import Terms, rotor_coupling
from wbc.robot import Robot

TorqueTerms: TypeAlias = tuple[
    FloatArray,
    FloatArray,
    FloatArray,
    float,
    FloatArray,
    IntArray,
    FloatArray,
    FloatArray,
    FloatArray,
    FloatArray,
]
"""What `place_output` reads, in its order."""


class OutputTorques:
    """Output torques of the gears and what their rotors add, linear in qdd and contact forces.

    K' E_s H_s K qdd + K' E_s c_s = J'f + [0; B E_m] tau_phi holds row by row as

        undriven:  (M qdd + bias - J'f)_u = 0                       (the same in every direction)
        driven:    T = D' (M qdd + bias - J'f)_m                    (torque that leaves the gears)
        rotors:    N tau_phi = t(T) + rotor qdd + rotor_bias        (t: the mesh law)

    so that the directions of power enter in t alone. M is H_l, plus what a rotor's spin asks of
    its housing where the robot couples the two.

    Attributes:
        mass: M (nv, nv).
        bias: (nv,) [N m], effects included.
        rotor: (m, nv) [kg m^2], N^2 I_r D^-1 in the driven columns.
        from_joints: D^-1 (m, m).
        rotor_bias: (m,) [N m] at the motor output: rotor friction and coupling.
        weight: of the robot [N].
    """

    def __init__(self, robot: Robot) -> None:
        """Precompute what does not change with the state."""
        gears = robot.transmission
        self.robot, self.weight = robot, _weight(robot.model)
        self.driven = as_rows(robot.actuated)
        self.topology = None if _is_identity(gears.topology) else gears.topology
        self.motor_from_joint = None if self.topology is None else gears.motor_from_joint
        self.from_joints = np.array(gears.motor_from_joint)
        self._driven_rows, self._topology = robot.actuated, np.array(gears.topology)
        self._joint_torque = np.zeros(gears.size)
        self.rotor = np.zeros((gears.size, robot.model.nv))
        self.rotor[:, robot.actuated] = gears.reflected_inertia[:, None] * gears.motor_from_joint
        self._rotor_own = self.rotor.copy()
        self._turns = np.zeros_like(self.rotor)
        self._turns[:, robot.actuated] = gears.gear_ratio[:, None] * gears.motor_from_joint
        self._dry = np.abs(gears.gear_ratio) * gears.rotor_coulomb_friction
        self._viscous = gears.gear_ratio**2 * gears.rotor_viscous_friction
        self._rotors_rub = bool(np.any(self._dry > 0.0) or np.any(self._viscous > 0.0))
        self.rotor_bias = np.zeros(gears.size)
        self._load: FloatArray | None = None
        nv = robot.model.nv
        # the terms keep their memory: compiled functions know where it is
        self._mass, self._bias = np.zeros((nv, nv)), np.zeros(nv)
        self.mass: FloatArray
        self.bias: FloatArray

    @property
    def output_bias(self) -> FloatArray:
        """D' bias_m (m,) [N m], the part of T that no acceleration and no force changes."""
        return self.to_motors(self.bias)

    @property
    def rotor_friction(self) -> tuple[FloatArray, FloatArray]:
        """Dry [N m] and viscous [N m s/rad] friction of the rotors at the motor outputs (m,)."""
        return self._dry, self._viscous

    def stand_on(self, kinematics: Kinematics) -> None:
        """Take the terms of a state from now on, whatever it is; no effect acts."""
        self.mass, self.bias = kinematics.mass_matrix, kinematics.bias

    def motor_speed(self, velocity: FloatArray) -> FloatArray:
        """Return dpsi (m,) [rad/s] of joint velocities (nv,)."""
        driven = velocity[self.driven]
        return driven if self.motor_from_joint is None else self.motor_from_joint @ driven

    def to_motors(self, joint_rows: FloatArray) -> FloatArray:
        """Return D' rows (m, ...) of the driven joints' rows of something (nv, ...)."""
        rows = joint_rows[self.driven]
        return rows if self.topology is None else self.topology.T @ rows

    def torques(
        self, x: FloatArray, jacobian: FloatArray, scale: float
    ) -> tuple[FloatArray, FloatArray]:
        """Return T and what the rotors take themselves, rotor qdd + rotor_bias, (m,) [N m].

        Args:
            x: accelerations and force variables (nv + k,).
            jacobian: J (k, nv) of the contacts.
            scale: [N] per unit of force variable.
        """
        output, share = np.empty(len(self.rotor_bias)), np.empty(len(self.rotor_bias))
        place_output(*self.terms(x, jacobian, scale), output, share)
        return output, share

    def terms(self, x: FloatArray, jacobian: FloatArray, scale: float) -> TorqueTerms:
        """Return what `place_output` reads, arguments as for `torques`."""
        return (
            *(self.mass, self.bias, jacobian, scale, x, self._driven_rows, self._topology),
            *(self.rotor, self.rotor_bias, self._joint_torque),
        )

    def remember(self, acceleration: FloatArray, output: FloatArray) -> None:
        """Take qdd (nv,) and T (m,) of a solution; what T does beyond them is load."""
        self._load = output - self.to_motors(self.mass.dot(acceleration))

    def forget(self) -> None:
        """Forget the load of the last solution."""
        self._load = None

    def braking(self, limit: JointLimit) -> tuple[FloatArray, FloatArray] | None:
        """Return how hard the motors can brake the joints of a limit (k,), None if it is given."""
        if limit.braking is None or limit.gears is None:
            return None
        load = self.output_bias if self._load is None else self._load
        inertia = self.mass.diagonal()[limit.rows]
        gears = self.robot.transmission
        return limit.braking.strength(gears, limit.gears, inertia, load[limit.gears])

    def update(
        self,
        kinematics: Kinematics,
        effects: FloatArray | None,
        speed: FloatArray,
        certainty: FloatArray,
    ) -> None:
        """Take the terms of a state.

        Args:
            kinematics: of the state.
            effects: torque of the physical effects on the coordinates (nv,), or None.
            speed: motor speed dpsi (m,) [rad/s].
            certainty: sigma (m,) of each gear.
        """
        self.stand_on(kinematics)
        if effects is not None:
            self.bias = np.subtract(kinematics.bias, effects, out=self._bias)
        if self._rotors_rub:
            np.add(self._dry * certainty, self._viscous * speed, out=self.rotor_bias)
        if self.robot.rotors_turn_with_links:
            self._couple(kinematics)

    def _couple(self, kinematics: Kinematics) -> None:
        coupling = rotor_coupling(self.robot, _terms(kinematics))
        ratio = self.robot.transmission.gear_ratio
        self.mass = np.add(self.mass, coupling.inertia.T @ self._turns, out=self._mass)
        self.bias = np.add(self.bias, coupling.link_bias, out=self._bias)
        np.add(self._rotor_own, ratio[:, None] * coupling.inertia, out=self.rotor)
        own = ratio * coupling.rotor_bias
        np.add(self.rotor_bias if self._rotors_rub else 0.0, own, out=self.rotor_bias)


def _terms(kinematics: Kinematics) -> Terms:
    """Return the state as the dynamics' own terms, without contact points."""
    none = np.zeros((0, len(kinematics.velocity)))
    return Terms(
        kinematics.position,
        kinematics.velocity,
        kinematics.mass_matrix,
        kinematics.bias,
        none,
        np.zeros(0),
        np.zeros((0, 3)),
        kinematics.data,
    )


def _weight(model: pin.Model) -> float:
    gravity = float(np.linalg.norm(model.gravity.linear))
    return float(pin.computeTotalMass(model)) * gravity


def _is_identity(matrix: FloatArray) -> bool:
    return bool(np.array_equal(matrix, np.eye(len(matrix))))
