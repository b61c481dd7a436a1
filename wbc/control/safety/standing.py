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
from wbc.control.safety.statics import place_hold, place_mobilities, place_pushed
from wbc.errors import ControlError
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
        B, m = gears.motor_from_joint, robot.actuated
        serial = bool(np.array_equal(gears.topology, np.eye(gears.size)))
        self._from_joints = None if serial else B
        self._topology = np.array(gears.topology)
        self._reflected = np.zeros((robot.model.nv, robot.model.nv))
        self._reflected[np.ix_(m, m)] = B.T @ (gears.reflected_inertia[:, None] * B)

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
        gravity = np.array(kinematics.bias)
        added = self._effects.on_joints(Motion(position, self._rest), self._rest)
        if added is not None:
            gravity -= added
        mass = kinematics.mass_matrix + self._reflected
        u, m, J = robot.unactuated, robot.actuated, rows.jacobian
        pushed, hold = np.empty(len(gravity)), np.empty(len(m))
        free, rested = np.empty((2, len(m), len(m)))
        share = rows.load_share(kinematics.mass * kinematics.gravity)
        place_pushed(J, gravity, u, share, _SOFT, pushed)
        sound = place_hold(mass, gravity, pushed, u, m, hold)
        if not sound or not place_mobilities(mass, J, _SOFT, m, free, rested):
            raise ControlError(f"the inertia of '{robot.name}' is not positive definite.")
        if self._from_joints is None:
            return Statics(hold, free, rested)
        B = self._from_joints
        return Statics(self._topology.T @ hold, B @ free @ B.T, B @ rested @ B.T)

    def _set_of(self, contacts: tuple[BoundContact, ...]) -> ContactSet:
        """Return the rows of some contacts, made when they are first asked for."""
        names = tuple(contact.name for contact in contacts)
        if names not in self._sets:
            self._sets[names] = ContactSet(contacts, self._kinematics.model)
        return self._sets[names]
