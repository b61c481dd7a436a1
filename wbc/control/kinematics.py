"""Dynamics and kinematics of one tick, and rows of frames on them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.lib.stride_tricks import as_strided

from wbc.arrays import FloatArray, IntArray, frozen
from wbc.control.tree import ROWS, TREE, RowKind, move_joints
from wbc.dynamics import Workspace
from wbc.errors import ControlError, unknown_name
from wbc.mechanics.kinematics import joints_of
from wbc.robot import Robot

_PLACE = 12 * 8  # bytes of a placement
_WORLD = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
_AXES = pin.Convention.WORLD


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
        tree: all of it, as compiled functions read it.
        known_by_joints: whether `move_joints` is all that a state takes, once pinocchio knows it.
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
        self.mass = float(pin.computeTotalMass(model))
        self.gravity = float(np.linalg.norm(model.gravity.linear))
        self._rest = np.zeros(nv)
        self._moved = False
        starts, columns = joint_columns(model)
        joints, shapes = joints_of(model)  # the world goes before them, as in pinocchio
        joints[:, [0, 4]] += 1
        self.tree = TREE.of(
            {"j": model.njoints, "v": nv},
            places=_places(model, data),
            mass_matrix=self.mass_matrix,
            momentum=data.Ag.reshape(6, nv),  # one column comes as a vector
            com=data.com[0],
            motions=data.J.reshape(6, nv).T,
            joints=np.insert(joints, 0, [-1, -1, 0, 0, 0], axis=0),
            shapes=np.insert(shapes, 0, 0.0, axis=0),
            gravity=frozen(model.gravity.linear),
            starts=starts,
            columns=columns,
            moved=np.zeros(1, np.bool_),
        )
        self.bias: FloatArray = self.tree.bias
        self.known_by_joints = _axes_turn_with_bodies(model)

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
        self.move()

    def take(self, position: FloatArray, velocity: FloatArray) -> None:
        """Take a state; what follows from its velocity is evaluated by `move`, or in the tick."""
        self.position, self.velocity = position, velocity
        # leaves J, A_g and the CoM as well
        pin.crba(self.model, self._data, position, _AXES)
        self._moved = self.tree.moved[0] = False

    def move(self) -> None:
        """Evaluate velocities and accelerations at the state that was taken."""
        move_joints(self.tree, self.velocity)
        if not self.known_by_joints:
            self._ask_pinocchio()

    def _ask_pinocchio(self) -> None:
        """Take drifts and bias from pinocchio, where an axis moves within its own body."""
        self.bias[:] = pin.rnea(self.model, self._data, self.position, self.velocity, self._rest)
        data, tree = self.data, self.tree
        for i in range(1, self.model.njoints):
            tree.drifts[i] = data.oMi[i].act(data.a[i]).vector
        pin.centerOfMass(self.model, data, pin.KinematicLevel.ACCELERATION, False)
        tree.com_drift[:] = data.acom[0]
        pin.computeCentroidalMomentumTimeVariation(self.model, data)
        tree.momentum_drift[:] = data.dhg.vector

    def place_solids(self, geometry: pin.GeometryModel, data: pin.GeometryData) -> None:
        """Write the placements of solids at the present state."""
        pin.updateGeometryPlacements(self.model, self._data, geometry, data)

    def frame_id(self, name: str) -> int:
        """Return the number of a frame.

        Raises:
            ControlError: no such frame; the message lists those there are.
        """
        return frame_number(self.model, name)

    def placement(self, frame: int) -> pin.SE3:
        """Return the placement of a frame in the world."""
        return pin.updateFramePlacement(self.model, self._data, frame)

    def frame_jacobian(self, frame: int) -> FloatArray:
        """Return J (6, nv): velocity of the frame's origin over angular velocity, world axes."""
        return np.asarray(pin.getFrameJacobian(self.model, self._data, frame, _WORLD))

    def frame_drift(self, frame: int) -> FloatArray:
        """Return dJ/dt v (6,), the classical acceleration of the frame at qdd = 0, world axes."""
        moved = pin.getFrameClassicalAcceleration(self.model, self.data, frame, _WORLD)
        return np.asarray(moved.vector)


def frame_number(model: pin.Model, name: str, told: str = "") -> int:
    """Return the number of a frame.

    Raises:
        ControlError: no such frame; the message begins with `told` and lists those there are.
    """
    if not model.existFrame(name):
        known = [frame.name for frame in model.frames]
        raise ControlError(told + unknown_name("frame", name, known))
    return int(model.getFrameId(name))


def _places(model: pin.Model, data: pin.Data) -> FloatArray:
    """Return the placements of all joints (j, 12) as a view of pinocchio's own memory.

    They lie one after the other, rotation column by column before translation; where a version of
    pinocchio lays them out in another way this raises ControlError.
    """
    first: FloatArray = data.oMi[0].rotation.T.reshape(-1)
    view = as_strided(first, (model.njoints, 12), (_PLACE, 8))
    pin.forwardKinematics(model, data, _some_pose(model))
    for i in range(model.njoints):
        place = data.oMi[i]
        own = np.concatenate([place.rotation.T.reshape(-1), place.translation])
        if first.base is None or not np.array_equal(view[i], own):
            raise ControlError("this version of pinocchio lays out placements in an unknown way.")
    return view


def _axes_turn_with_bodies(model: pin.Model) -> bool:
    """Whether every joint's axes are fixed in its body, so that its columns of J turn with it."""
    data, found = model.createData(), []
    for q in (pin.neutral(model), _some_pose(model)):
        pin.forwardKinematics(model, data, q, np.ones(model.nv), np.zeros(model.nv))
        found.append([np.array(data.joints[i].S) for i in range(1, model.njoints)])
    return all(np.array_equal(one, other) for one, other in zip(*found, strict=True))


def _some_pose(model: pin.Model) -> FloatArray:
    """Return a configuration in which every joint has moved by another amount."""
    return np.asarray(
        pin.integrate(model, pin.neutral(model), np.sin(np.arange(1.0, model.nv + 1.0)))
    )


class StateRows(NamedTuple):
    """Rows that follow from the state alone, so that they are evaluated with all others.

    Attributes:
        kind: what they are of.
        frame: name of the frame, "" where they are of the whole robot.
        rows: which of its rows, linear over angular.
        arm: (3,) [m] world axes, from the point of a rolling ball that touches to its centre; of a
            balance its bandwidth [1/s] in front.
        other: name of the frame whose distance or pitch is meant.
    """

    kind: RowKind
    frame: str
    rows: slice
    arm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    other: str = ""


def rows_of(model: pin.Model, wanted: Sequence[StateRows], first: Sequence[int], size: int) -> Any:
    """Return the ROWS that evaluate many `StateRows` in one call.

    Args:
        model: of the `Kinematics` that is read, with all frames.
        wanted: what to evaluate.
        first: row at which each begins.
        size: how many rows there are; columns of J that never move stay zero.
    """
    plan = np.zeros((len(wanted), 7), dtype=np.int_)
    offsets = np.zeros((len(wanted), 27))
    for i, (entry, start) in enumerate(zip(wanted, first, strict=True)):
        begin, end, step = entry.rows.indices(6)
        joint, offsets[i, :12] = _fixed_at(model, entry.frame)
        other, offsets[i, 15:] = _fixed_at(model, entry.other)
        plan[i] = entry.kind, joint, start, begin, len(range(begin, end, step)), step, other
        offsets[i, 12:15] = entry.arm
    return ROWS.of(
        {"e": len(wanted), "k": size, "v": model.nv},
        plan=plan,
        offsets=frozen(offsets),
        used=np.ones(len(wanted), dtype=np.int_),
    )


def _fixed_at(model: pin.Model, frame: str) -> tuple[int, FloatArray]:
    """Return the joint that carries a frame, and its offset (12,); the world without a name."""
    if not frame:
        return 0, np.zeros(12)
    found = model.frames[model.getFrameId(frame)]
    turn, place = found.placement.rotation.reshape(-1), found.placement.translation
    return int(found.parentJoint), np.concatenate([turn, place])


def joint_columns(model: pin.Model) -> tuple[IntArray, IntArray]:
    """Return which columns of J move each joint: where they start (j + 1,), and the columns."""
    own = [range(one.idx_v, one.idx_v + one.nv) for one in model.joints]
    own[0] = range(0)  # the world
    columns = [[k for joint in path for k in own[joint]] for path in model.supports]
    starts = np.cumsum([0, *map(len, columns)])
    return frozen(starts, np.int_), frozen(list(chain(*columns)), np.int_)
