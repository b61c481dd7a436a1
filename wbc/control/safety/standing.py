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
from wbc.control.safety.statics import STATICS, place_statics
from wbc.errors import ControlError
from wbc.fixed_arrays import FixedArrays
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
        self._added = np.zeros(robot.model.nv)
        self._sets: dict[tuple[str, ...], tuple[ContactSet, FixedArrays]] = {}
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
        robot, kinematics, rest = self._robot, self._kinematics, self._rest
        rows, memory = self._known_of(contacts)
        known = kinematics.memory is None or not rows.is_known
        if known:
            kinematics.update(position, rest)
            rows.fill(kinematics)
        else:
            kinematics.take(position, rest)
        if self._effects.act_on_joints:
            added = self._effects.on_joints(Motion(position, rest), rest)
            self._added[:] = 0.0 if added is None else added
        m = robot.transmission.size
        hold, free, rested = np.empty(m), np.empty((m, m)), np.empty((m, m))
        table, mass = memory.table, kinematics.mass
        if not place_statics(table, mass, _SOFT, rest, known, hold, free, rested):
            raise ControlError(f"the inertia of '{robot.name}' is not positive definite.")
        if self._from_joints is None:
            return Statics(hold, free, rested)
        B = self._from_joints
        return Statics(self._topology.T @ hold, B @ free @ B.T, B @ rested @ B.T)

    def _known_of(self, contacts: tuple[BoundContact, ...]) -> tuple[ContactSet, FixedArrays]:
        """Return the rows of some contacts and the memory of STATICS, made when first asked for."""
        names = tuple([contact.name for contact in contacts])
        known = self._sets.get(names)
        if known is None:
            kinematics, robot = self._kinematics, self._robot
            rows, nv = ContactSet(contacts, kinematics.model), robot.model.nv
            share = rows.load_share(kinematics.mass * kinematics.gravity)
            none = np.zeros((0, 5), dtype=np.int64)
            tree = none if kinematics.memory is None else kinematics.memory
            made = FixedArrays(
                STATICS,
                (
                    *(tree, rows.memory(kinematics)[0], kinematics.mass_matrix, self._reflected),
                    *(kinematics.bias, self._added, rows.jacobian, robot.unactuated),
                    *(robot.actuated, share, np.zeros((nv, nv)), np.zeros(nv), np.zeros(nv)),
                ),
            )
            known = self._sets[names] = rows, made
        return known
