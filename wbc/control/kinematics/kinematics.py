"""Dynamics and kinematics of one tick, the rarer quantities computed when first asked for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.lib.stride_tricks import as_strided

from wbc.arrays import FloatArray, IntArray, frozen
from wbc.control.kinematics.tree import TREE, move_joints
from wbc.dynamics import Workspace
from wbc.errors import ControlError, unknown_name
from wbc.fixed_arrays import FixedArrays
from wbc.robot import Robot

_PLACE = 12 * 8  # bytes of a placement
_WORLD = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


class FixedFrame(NamedTuple):
    """Where a frame is fixed.

    Attributes:
        joint: that carries it.
        offset: its placement there (12,), rotation column by column before the translation.
        columns: of J that move it.
    """

    joint: int
    offset: FloatArray
    columns: IntArray


class Kinematics:
    """What the plant, tasks and contacts read at one state.

    One object serves one controller; `update` moves it to the next state. All arrays are views of
    memory that the next `update` overwrites. Accelerations are those at qdd = 0, from which every
    drift dJ/dt v follows.

    Attributes:
        model: the pinocchio model, the robot's contact points among its frames.
        position: q (nq,).
        velocity: v (nv,).
        mass: of the robot [kg].
        gravity: magnitude of the acceleration of gravity [m/s^2].
        mass_matrix: H_l (nv, nv), inertia of the links without reflected rotor inertia.
        bias: c_l (nv,), Coriolis, centrifugal and gravity torque [N m, N].
        joint_jacobian: J (6, nv) of all joints in world axes at the world's origin.
        joint_places: rotation, column by column, and translation of every joint (j, 12).
        joint_rates, joint_drifts: V and A = dJ/dt v of every joint (j, 6), likewise.
    """

    def __init__(self, robot: Robot, frames: Sequence[pin.Frame] = ()) -> None:
        """Prepare for a robot; `update` must come before anything is read.

        Args:
            robot: the robot.
            frames: further frames to know, such as the middles of soles.
        """
        self.model = Workspace(robot).model.copy()
        for frame in frames:
            self.model.addFrame(frame, False)
        model, nv = self.model, self.model.nv
        self._data = data = model.createData()
        self.position: FloatArray = np.zeros(model.nq)
        self.velocity: FloatArray = np.zeros(nv)
        self.mass_matrix: FloatArray = data.M.reshape(nv, nv).T  # symmetric, now row by row
        self.bias: FloatArray = np.zeros(nv)
        self.mass = float(pin.computeTotalMass(model))
        self.gravity = float(np.linalg.norm(model.gravity.linear))
        self._rest = np.zeros(nv)
        self._com: FloatArray = data.com[0]
        self._com_drift = np.zeros(3)
        self._momentum: FloatArray = data.Ag.reshape(6, nv)  # one column comes as a vector
        self._frames: dict[str, int] = {}
        self._fixed: dict[str, FixedFrame] = {}
        self._moved = self._momentum_drift_ready = False
        self.joint_jacobian: FloatArray = data.J.reshape(6, nv)
        self.joint_places = _places(model, data)
        self.joint_rates, self.joint_drifts = np.zeros((2, model.njoints, 6))
        tree = (
            frozen(list(model.parents), np.int_),
            frozen([joint.idx_v for joint in model.joints], np.int_),
            frozen([joint.nv for joint in model.joints], np.int_),
            frozen([body.mass for body in model.inertias]),
            frozen([body.lever for body in model.inertias]),
            frozen([body.inertia[np.triu_indices(3)] for body in model.inertias]),
            frozen(model.gravity.linear),
        )
        results = self.joint_rates, self.joint_drifts, self._com_drift
        self._memory = FixedArrays(
            TREE,
            (
                *(self.joint_jacobian, self.joint_places, *tree, *results),
                *(np.zeros((model.njoints, 6)), self.bias),
            ),
        )
        self._axes_turn = _axes_turn_with_bodies(model)

    @property
    def data(self) -> pin.Data:
        """pinocchio's data at the present state, velocities and accelerations at qdd = 0 too."""
        if not self._moved:
            pin.forwardKinematics(self.model, self._data, self.position, self.velocity, self._rest)
            self._moved = True
        return self._data

    def update(self, position: FloatArray, velocity: FloatArray) -> None:
        """Move to the state q (nq,), v (nv,)."""
        self.take(position, velocity)
        move_joints(self._memory.table, velocity)
        if not self._axes_turn:
            self._ask_pinocchio()

    def take(self, position: FloatArray, velocity: FloatArray) -> None:
        """Take a state, where `move_joints` follows in `memory`."""
        self.position, self.velocity = position, velocity
        # leaves J, A_g and the CoM as well
        pin.crba(self.model, self._data, position, pin.Convention.WORLD)
        self._moved = self._momentum_drift_ready = False

    @property
    def memory(self) -> IntArray | None:
        """Memory of `move_joints`; None where that is not all, see `update`."""
        return self._memory.table if self._axes_turn else None

    def _ask_pinocchio(self) -> None:
        """Take drifts and bias from pinocchio, where an axis moves within its own body."""
        self.bias[:] = pin.rnea(self.model, self._data, self.position, self.velocity, self._rest)
        data = self.data
        for i in range(1, self.model.njoints):
            self.joint_drifts[i] = data.oMi[i].act(data.a[i]).vector
        pin.centerOfMass(self.model, data, pin.KinematicLevel.ACCELERATION, False)
        self._com_drift[:] = data.acom[0]

    def frame_id(self, name: str) -> int:
        """Return the number of a frame.

        Raises:
            ControlError: no such frame; the message lists those there are.
        """
        number = self._frames.get(name)
        if number is None:
            if not self.model.existFrame(name):
                known = [frame.name for frame in self.model.frames]
                raise ControlError(unknown_name("frame", name, known))
            number = int(self.model.getFrameId(name))
            self._frames[name] = number
        return number

    def fixed_frame(self, name: str) -> FixedFrame:
        """Return where a frame is fixed, by name.

        Raises:
            ControlError: no such frame; the message lists those there are.
        """
        found = self._fixed.get(name)
        if found is None:
            frame = self.model.frames[self.frame_id(name)]
            joint, placement = int(frame.parentJoint), frame.placement
            supports = [self.model.joints[i] for i in self.model.supports[joint] if i]
            moves = [row for s in supports for row in range(s.idx_v, s.idx_v + s.nv)]
            offset = np.concatenate([placement.rotation.T.reshape(-1), placement.translation])
            found = FixedFrame(joint, frozen(offset), frozen(moves, np.int_))
            self._fixed[name] = found
        return found

    def joint_place(self, joint: int) -> pin.SE3:
        """Return the placement of a joint in the world."""
        return self._data.oMi[joint]

    def placement(self, frame: int) -> pin.SE3:
        """Return the placement of a frame in the world."""
        return pin.updateFramePlacement(self.model, self._data, frame)

    def frame_jacobian(self, frame: int, axes: pin.ReferenceFrame = _WORLD) -> FloatArray:
        """Return J (6, nv): linear velocity of the frame's origin over angular velocity."""
        rows: FloatArray = pin.getFrameJacobian(self.model, self._data, frame, axes)
        return rows

    def frame_velocity(self, frame: int) -> FloatArray:
        """Return the velocity (6,) of the frame's origin over the angular one, world axes."""
        rate: FloatArray = pin.getFrameVelocity(self.model, self.data, frame, _WORLD).vector
        return rate

    def frame_drift(self, frame: int, axes: pin.ReferenceFrame = _WORLD) -> FloatArray:
        """Return dJ/dt v (6,), the classical acceleration of the frame at qdd = 0."""
        motion = pin.getFrameClassicalAcceleration(self.model, self.data, frame, axes)
        drift: FloatArray = motion.vector
        return drift

    def center_of_mass(self) -> FloatArray:
        """Return the centre of mass (3,) [m], world."""
        return self._com

    def center_of_mass_jacobian(self) -> FloatArray:
        """Return J_com (3, nv), world axes."""
        return self._momentum[:3] / self.mass

    def center_of_mass_drift(self) -> FloatArray:
        """Return dJ_com/dt v (3,) [m/s^2], world axes."""
        return self._com_drift

    def momentum_matrix(self) -> FloatArray:
        """Return A_g (6, nv): h_g = A_g v, linear over angular, about the centre of mass."""
        return self._momentum

    def momentum_drift(self) -> FloatArray:
        """Return dA_g/dt v (6,), linear [N] over angular [N m]."""
        if not self._momentum_drift_ready:
            pin.computeCentroidalMomentumTimeVariation(self.model, self.data)
            self._momentum_drift_ready = True
        drift: FloatArray = self.data.dhg.vector
        return drift


def _places(model: pin.Model, data: pin.Data) -> FloatArray:
    """Return the placements of all joints (j, 12) as a view of pinocchio's own memory.

    They lie one after the other, rotation column by column before translation; where a version of
    pinocchio lays them out in another way this raises ControlError.
    """
    first: FloatArray = data.oMi[0].rotation.T.reshape(-1)
    view = as_strided(first, (model.njoints, 12), (_PLACE, 8))
    pin.forwardKinematics(model, data, pin.randomConfiguration(_bounded(model)))
    for i in range(model.njoints):
        place = data.oMi[i]
        own = np.concatenate([place.rotation.T.reshape(-1), place.translation])
        if first.base is None or not np.array_equal(view[i], own):
            raise ControlError("this version of pinocchio lays out placements in an unknown way.")
    return view


def _axes_turn_with_bodies(model: pin.Model) -> bool:
    """Whether every joint's axes are fixed in its body, so that its columns of J turn with it."""
    data, found = model.createData(), []
    for q in (pin.neutral(model), pin.randomConfiguration(_bounded(model))):
        pin.forwardKinematics(model, data, q, np.ones(model.nv), np.zeros(model.nv))
        found.append([np.array(data.joints[i].S) for i in range(1, model.njoints)])
    return all(np.array_equal(one, other) for one, other in zip(*found, strict=True))


def _bounded(model: pin.Model) -> pin.Model:
    """Return a copy whose joints have finite ranges, to draw configurations from."""
    model = model.copy()
    model.lowerPositionLimit = np.maximum(model.lowerPositionLimit, -1.0)
    model.upperPositionLimit = np.minimum(model.upperPositionLimit, 1.0)
    model.lowerPositionLimit = np.minimum(model.lowerPositionLimit, model.upperPositionLimit)
    return model
