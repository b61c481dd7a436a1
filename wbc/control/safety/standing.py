"""What holds a robot still, without a program."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.control.contacts import BoundContact
from wbc.control.contacts.contact_set import ContactSet
from wbc.control.effects import EffectTorques
from wbc.control.kinematics import Kinematics
from wbc.control.safety.policies import Statics
from wbc.robot import Motion, Robot

# Keeps systems solvable where contacts repeat each other; what it adds is far below a gram.
_SOFT = 1e-9


class Standing:
    """Torques that hold a robot at rest, and the inertia that its motors feel."""

    def __init__(self, robot: Robot, effects: EffectTorques, frames: Sequence[pin.Frame]) -> None:
        """Make memory of its own, so that nothing of a tick is overwritten."""
        self._robot, self._effects = robot, effects
        self._kinematics = Kinematics(robot, frames)
        self._rest = np.zeros(robot.model.nv)
        self._sets: dict[tuple[str, ...], ContactSet] = {}
        gears = robot.transmission
        self._from_joints = gears.motor_from_joint
        self._topology = np.array(gears.topology)
        self._reflected = self._from_joints.T @ (
            gears.reflected_inertia[:, None] * self._from_joints
        )

    def statics(self, position: FloatArray, contacts: tuple[BoundContact, ...]) -> Statics:
        """Return what holds the robot at q (nq,) on some contacts.

        Forces of the contacts share the weight and balance the undriven coordinates u as far as
        they can; what they cannot balance moves the base, and the driven joints m are held beside
        it:

            a = M_uu^-1 (J_u' f - g_u),    T = D' (M_mu a + g_m - J_m' f).
        """
        robot, kinematics, rows = self._robot, self._kinematics, self._set_of(contacts)
        kinematics.update(position, self._rest)
        rows.fill(kinematics)
        motion = Motion(position, self._rest)
        gravity = np.array(kinematics.bias)
        added = self._effects.on_joints(motion, self._rest)
        if added is not None:
            gravity -= added
        mass = np.array(kinematics.mass_matrix)
        u, m = robot.unactuated, robot.actuated
        mass[np.ix_(m, m)] += self._reflected
        pushed = self._pushed(rows, gravity[u])
        inverse = np.linalg.inv(mass)
        coupling = mass[np.ix_(m, u)]
        base = np.linalg.solve(mass[np.ix_(u, u)], (pushed - gravity)[u])
        hold = coupling @ base + gravity[m] - pushed[m]
        B, D = self._from_joints, self._topology
        free = B @ inverse[np.ix_(m, m)] @ B.T
        J = rows.jacobian
        across = J @ inverse
        normal = across @ J.T
        normal += _SOFT * (1.0 + np.trace(normal)) * np.eye(len(J))
        rested = (inverse - across.T @ np.linalg.solve(normal, across))[np.ix_(m, m)]
        return Statics(D.T @ hold, np.asarray(np.linalg.inv(free)), B @ rested @ B.T)

    def _set_of(self, contacts: tuple[BoundContact, ...]) -> ContactSet:
        """Return the rows of some contacts, made when they are first asked for."""
        names = tuple(contact.name for contact in contacts)
        if names not in self._sets:
            self._sets[names] = ContactSet(contacts, self._kinematics.model)
        return self._sets[names]

    def _pushed(self, rows: ContactSet, undriven: FloatArray) -> FloatArray:
        """Return J' f (nv,) of forces that carry `undriven` (u,), nearest to an equal share."""
        if not rows.rows:
            return np.zeros(self._robot.model.nv)
        J, weight = rows.jacobian, self._kinematics.mass * self._kinematics.gravity
        share = rows.load_share(weight)
        across = J[:, self._robot.unactuated]
        normal = across.T @ across + _SOFT * np.eye(across.shape[1])
        force = share + across @ np.linalg.solve(normal, undriven - across.T @ share)
        return np.asarray(J.T @ force)
