"""The contact-force program: accelerations and contact forces under the dissipative dynamics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pinocchio as pin

from wbc.arrays import BoolArray, FloatArray
from wbc.control.contact_force_cost import ContactForceCost
from wbc.control.contact_set import ContactSet
from wbc.control.efforts import ContactForceTask, Effort
from wbc.control.limits import JointLimit
from wbc.control.plant import Plant
from wbc.control.qp import INFINITE, QPProblem
from wbc.control.reference import Reference
from wbc.control.task_stack import TaskStack


class ContactForceProgram:
    """Assembles, for one set of contacts, the quadratic program in x = [qdd, f / force_scale].

        min   sum of task costs + regularisation of qdd and of f towards a shared load
        s.t.  (M qdd + bias - J'f)_undriven = 0
              J qdd = -dJ/dt v - damping J v
              -limit <= e (D'(M qdd + bias - J'f)_m) + rotor qdd + rotor_bias <= limit
              friction cones, normal forces, joint limits

    with e the slope of the mesh law in the direction predicted for each gear. All memory is
    allocated once; `problem` is overwritten by the next `assemble`.

    Attributes:
        contacts: the active contacts.
        n: number of variables.
        force_scale: [N] per unit of force variable, a tenth of the robot's weight, so that
            accelerations and forces are of one size and tolerances mean the same on any robot.
        row_labels: what every inequality row is called in messages.
        torque_map: (m, n), T = torque_map @ x + D' bias_m.
    """

    def __init__(
        self,
        plant: Plant,
        contacts: ContactSet,
        limited: BoolArray,
        joint_limit: JointLimit | None,
        weights: tuple[float, float],
        efforts: Sequence[Effort] = (),
        force_tasks: Sequence[ContactForceTask] = (),
        locked: int = 0,
    ) -> None:
        """Lay out the rows.

        Args:
            plant: the dynamics.
            contacts: the active contacts.
            limited: (m,) bool, gears that have a torque limit.
            joint_limit: limits of joints, or None.
            weights: regularisation of qdd and of the force variables.
            efforts: costs on the torques of the gears.
            force_tasks: costs on contact forces; those of inactive contacts stay idle.
            locked: number of equality rows on qdd that a more important level hands down.
        """
        robot = plant.robot
        self.plant, self.contacts, self.joint_limit = plant, contacts, joint_limit
        self.nv, self.forces = robot.model.nv, contacts.rows
        self.n = self.nv + self.forces
        self.undriven = robot.floating_size
        self.gears = np.flatnonzero(limited)
        self._all_gears = len(self.gears) == robot.transmission.size
        self._weights = weights
        weight = _weight(robot.model)
        self.force_scale = 0.1 * weight if weight > 0.0 else 100.0
        self._force_cost = ContactForceCost(
            contacts, force_tasks, weights[1], weight, self.force_scale
        )
        self.H = np.zeros((self.n, self.n))
        force_diagonal = np.arange(self.nv, self.n)
        self.H[force_diagonal, force_diagonal] = self._force_cost.diagonal
        self._diagonal = np.arange(self.nv) * (self.n + 1)
        self.g = np.zeros(self.n)
        self.g[self.nv :] = self._force_cost.pull
        self.efforts = tuple(efforts)
        self._cost_H, self._cost_g = self.H, self.g
        if self.efforts:
            self._cost_H, self._cost_g = self.H.copy(), self.g.copy()
            self._effort_rows = np.zeros((robot.transmission.size, self.n))
        self.locked_rows = slice(
            self.undriven + contacts.rows, self.undriven + contacts.rows + locked
        )
        self.A = np.zeros((self.locked_rows.stop, self.n))
        self.b = np.zeros(len(self.A))
        self._lay_out_inequalities()
        self._square = np.zeros((self.nv, self.nv))
        self.torque_map = np.zeros((robot.transmission.size, self.n))
        self._scaled_map = np.zeros_like(self.torque_map)

    def _lay_out_inequalities(self) -> None:
        m, set_ = len(self.gears), self.contacts
        faces, normals = len(set_.cone), len(set_.contacts)
        joints = 0 if self.joint_limit is None else len(self.joint_limit.joints)
        total = m + faces + normals + joints
        self.C = np.zeros((total, self.n))
        self.lower, self.upper = np.full(total, -INFINITE), np.full(total, INFINITE)
        self.torque_rows = slice(0, m)
        self.cone_rows = slice(m, m + faces)
        self.normal_rows = slice(m + faces, m + faces + normals)
        self.joint_rows = slice(m + faces + normals, total)
        self.C[self.cone_rows, self.nv :] = set_.cone
        self.upper[self.cone_rows] = 0.0
        self.C[self.normal_rows, self.nv :] = set_.normals
        names = self.plant.robot.transmission.joints
        labels = [f"rotor torque limit of '{names[i]}'" for i in self.gears]
        labels += [f"contact {label}" for label in set_.cone_labels]
        labels += [f"contact {contact.name}: normal force" for contact in set_.contacts]
        if self.joint_limit is not None:
            self.C[np.arange(m + faces + normals, total), self.joint_limit.rows] = 1.0
            labels += [f"joint limit of '{joint}'" for joint in self.joint_limit.joints]
        self.row_labels = tuple(labels)
        self._write_normal_bounds(None)

    @property
    def problem(self) -> QPProblem:
        """The program as assembled last; the arrays are this object's own."""
        return QPProblem(self.H, self.g, self.A, self.b, self.C, self.lower, self.upper)

    @property
    def cost_gradient(self) -> FloatArray:
        """g (n,) of the tasks alone, before the efforts."""
        return self._cost_g

    def assemble_cost(self, tasks: TaskStack) -> None:
        """Write H and g from the tasks' rows."""
        nv, H, g = self.nv, self._cost_H, self._cost_g
        np.dot(tasks.matrix.T, tasks.matrix, out=self._square)
        H[:nv, :nv] = self._square
        H.reshape(-1)[self._diagonal] += tasks.diagonal + self._weights[0]
        np.dot(tasks.target, tasks.matrix, out=g[:nv])
        g[:nv] += tasks.pull
        np.negative(g[:nv], out=g[:nv])

    def assemble_forces(self, references: Mapping[str, Reference]) -> None:
        """Write the cost of the contact forces, (re)filled only where there are force tasks."""
        if not self._force_cost.tracks:
            return
        self._force_cost.fill(references)
        places = np.arange(self.nv, self.n)
        self._cost_H[places, places] = self._force_cost.diagonal
        self._cost_g[self.nv :] = self._force_cost.pull

    def assemble_efforts(self, slopes: FloatArray, speed: FloatArray, last: FloatArray) -> None:
        """Add the efforts for one slope per gear; call after the dynamics and the costs.

        Args:
            slopes: e (m,) in the predicted directions.
            speed: expected dpsi (m,) [rad/s].
            last: T (m,) of the last tick [N m].
        """
        if not self.efforts:
            return
        plant, nv = self.plant, self.nv
        np.copyto(self.H, self._cost_H)
        np.copyto(self.g, self._cost_g)
        for effort in self.efforts:
            cost = effort.cost(plant.robot, slopes, speed, last)
            steep, rows = cost.slope[:, None], self._effort_rows
            np.multiply(self.torque_map, steep, out=rows)
            offset = cost.slope * plant.output_bias
            if cost.rotor:
                rows[:, :nv] += cost.rotor * plant.rotor
                offset += cost.rotor * plant.rotor_bias
            weighted = rows.T * cost.weight
            self.H += weighted @ rows
            self.g += weighted @ offset

    def assemble_lock(self, matrix: FloatArray, values: FloatArray) -> None:
        """Write the rows on qdd (k, nv) that a more important level has decided, and values."""
        self.A[self.locked_rows, : self.nv] = matrix
        self.b[self.locked_rows] = values

    def assemble_dynamics(self) -> None:
        """Write the equalities from the plant and the contacts."""
        plant, set_, free, nv = self.plant, self.contacts, self.undriven, self.nv
        rest = free + self.forces
        self.A[:free, :nv] = plant.mass[plant.undriven]
        self.b[:free] = plant.bias[plant.undriven]
        np.negative(self.b[:free], out=self.b[:free])
        if self.forces:
            across = set_.jacobian.T * -self.force_scale
            self.A[:free, nv:] = across[plant.undriven]
            self.A[free:rest, :nv] = set_.jacobian
            self.b[free:rest] = set_.target
            self.torque_map[:, nv:] = plant.to_motors(across)
        self.torque_map[:, :nv] = plant.output

    def assemble_torque_limits(
        self, slopes: FloatArray, lower: FloatArray, upper: FloatArray
    ) -> None:
        """Write the rows of the rotor torque limits for one slope per gear.

        Args:
            slopes: e (m,), mesh input per output torque in the predicted directions.
            lower, upper: (m,) least and greatest N tau_phi [N m].
        """
        plant, nv, rows = self.plant, self.nv, self.torque_rows
        if not len(self.gears):
            return
        offset = slopes * plant.output_bias
        offset += plant.rotor_bias
        scaled = self.C[rows] if self._all_gears else self._scaled_map
        np.multiply(self.torque_map, slopes[:, None], out=scaled)
        scaled[:, :nv] += plant.rotor
        if self._all_gears:
            np.subtract(lower, offset, out=self.lower[rows])
            np.subtract(upper, offset, out=self.upper[rows])
        else:
            self.C[rows] = scaled[self.gears]
            self.lower[rows] = (lower - offset)[self.gears]
            self.upper[rows] = (upper - offset)[self.gears]

    def assemble_limits(
        self,
        position: FloatArray,
        velocity: FloatArray,
        step: float,
        ceilings: Mapping[str, float] | None,
    ) -> None:
        """Write the bounds of normal forces and of joint accelerations.

        Args:
            position, velocity: q (nq,) and v (nv,).
            step: time until the next tick [s].
            ceilings: greatest normal force [N] by contact, None where only the contacts' own hold.
        """
        if ceilings is not None or self._ramped:
            self._write_normal_bounds(ceilings)
        if self.joint_limit is not None:
            low, high = self.joint_limit.bounds(position, velocity, step)
            self.lower[self.joint_rows] = low
            self.upper[self.joint_rows] = high

    def _write_normal_bounds(self, ceilings: Mapping[str, float] | None) -> None:
        set_ = self.contacts
        top = set_.normal_maximum
        if ceilings is not None:
            top = np.minimum(top, [ceilings[contact.name] for contact in set_.contacts])
        self.lower[self.normal_rows] = np.minimum(set_.normal_minimum, top) / self.force_scale
        self.upper[self.normal_rows] = np.minimum(top / self.force_scale, INFINITE)
        self._ramped = ceilings is not None

    def output_torque(self, x: FloatArray) -> FloatArray:
        """Return T (m,) [N m] at a solution."""
        torque = self.torque_map @ x
        torque += self.plant.output_bias
        return np.asarray(torque)

    def equality_label(self, row: int) -> tuple[str, str]:
        """Return what an equality row is called in messages, and its unit."""
        if row < self.undriven:
            coordinate = int(self.plant.robot.unactuated[row])
            return f"balance of undriven coordinate {coordinate}", "N or N m"
        for contact, rows in zip(self.contacts.contacts, self.contacts.slices, strict=True):
            if row - self.undriven < rows.stop:
                return f"contact {contact.name} at rest", "m/s^2"
        return "what the more important tasks have decided", "m/s^2"

    def inequality_label(self, row: int) -> tuple[str, str]:
        """Return what an inequality row is called in messages, and its unit."""
        if row < self.torque_rows.stop:
            return self.row_labels[row], "N m at the motor output"
        if row < self.joint_rows.start:
            return self.row_labels[row], f"times {self.force_scale:.3g} N"
        return self.row_labels[row], "rad/s^2"


def _weight(model: pin.Model) -> float:
    """Return the robot's weight [N]."""
    gravity = float(np.linalg.norm(model.gravity.linear))
    return float(pin.computeTotalMass(model)) * gravity
