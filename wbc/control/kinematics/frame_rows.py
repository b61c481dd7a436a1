"""Rows of frames and of the centre of mass, for all tasks or contacts at once, compiled."""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray, IntArray, frozen
from wbc.compiled import (
    Count,
    Dense,
    Matrix,
    Nothing,
    Number,
    OutDense,
    OutMatrix,
    OutVector,
    Places,
    Table,
    Vector,
    compiled,
)
from wbc.control.kinematics.kinematics import Kinematics
from wbc.fixed_arrays import FixedArrays, FixedTable, array_at


class RowKind(IntEnum):
    """What rows are of.

    FRAME is the velocity of a frame's origin over its angular one, in world axes. OWN is the
    spatial velocity of a frame in its own axes. CENTER_OF_MASS is the velocity of that.
    """

    FRAME = 0
    OWN = 1
    CENTER_OF_MASS = 2


class StateRows(NamedTuple):
    """Rows that follow from the state alone, so that they can be evaluated with all others.

    Attributes:
        kind: what they are of.
        frame: name of the frame, "" for the centre of mass.
        rows: which of its rows, linear over angular.
        arm: (3,) [m] world axes, from the point of a rolling ball that touches to its centre.
    """

    kind: RowKind
    frame: str
    rows: slice
    arm: tuple[float, float, float] = (0.0, 0.0, 0.0)


_ROWS = (
    *(Table, Dense, Places, Places, Places),
    *(Matrix, Dense, Dense, Dense, Vector, Matrix),
    *(Vector, OutMatrix, OutVector, OutDense),
)
"""Kinds of the arrays of `place_state_rows`, in its order."""


class FrameTable:
    """Evaluates many `StateRows` in one call.

    Attributes:
        places: placement of every frame (e, 12), rotation column by column before the origin.
        plan: kind, joint, first row, first component, their number and step (e, 6).
        used: (e,) 1 for what is evaluated, 0 for what is left as it was.
    """

    def __init__(self, model: pin.Model, wanted: Sequence[StateRows], first: Sequence[int]) -> None:
        """Resolve the frames.

        Args:
            model: of the `Kinematics` that is read, with all frames.
            wanted: what to evaluate.
            first: row at which each begins, in the arrays that `fill` gets.
        """
        plan = np.zeros((len(wanted), 6), dtype=np.int_)
        offsets = np.zeros((len(wanted), 15))
        for i, (entry, start) in enumerate(zip(wanted, first, strict=True)):
            begin, end, step = entry.rows.indices(6)
            joint, placement = 0, pin.SE3.Identity()
            if entry.kind is not RowKind.CENTER_OF_MASS:
                frame = model.frames[model.getFrameId(entry.frame)]
                joint, placement = int(frame.parentJoint), frame.placement
            plan[i] = entry.kind, joint, start, begin, len(range(begin, end, step)), step
            offsets[i, :9] = placement.rotation.T.reshape(-1)
            offsets[i, 9:12] = placement.translation
            offsets[i, 12:] = entry.arm
        self.plan, self._offsets = plan, frozen(offsets)
        self.places, self.used = np.zeros((len(wanted), 12)), np.ones(len(wanted), dtype=np.int_)
        self._starts, self._columns = joint_columns(model)
        self._read: tuple[Any, ...] = None, None, None
        self._memory: IntArray = np.zeros((0, 5), dtype=np.int64)

    def fill(self, kinematics: Kinematics, jacobian: FloatArray, drift: FloatArray) -> None:
        """Write J and dJ/dt v into rows of (k, nv) and (k,); columns that never move stay zero."""
        fill_state_rows(self.memory(kinematics, jacobian, drift), kinematics.mass)

    def memory(self, kinematics: Kinematics, jacobian: FloatArray, drift: FloatArray) -> IntArray:
        """Return the memory that `fill_state_rows` works in, arguments as for `fill`."""
        read, rows, right = self._read
        if read is not kinematics or rows is not jacobian or right is not drift:
            self._lay_out(kinematics, jacobian, drift)
        return self._memory

    def _lay_out(self, kinematics: Kinematics, jacobian: FloatArray, drift: FloatArray) -> None:
        """Take what is read, memory that `kinematics` overwrites in place, and what is written."""
        self._read = kinematics, jacobian, drift
        self._fixed = FixedArrays(
            _ROWS,
            (
                *(self.plan, self._offsets, self._starts, self._columns, self.used),
                *(kinematics.joint_jacobian, kinematics.joint_places),
                *(kinematics.joint_rates, kinematics.joint_drifts),
                *(kinematics.center_of_mass(), kinematics.momentum_matrix()),
                *(kinematics.center_of_mass_drift(), jacobian, drift, self.places),
            ),
        )
        self._memory = self._fixed.table


def joint_columns(model: pin.Model) -> tuple[IntArray, IntArray]:
    """Return which columns of J move each joint: where they start (j + 1,), and the columns."""
    starts: list[int] = [0]
    columns: list[int] = []
    for i in range(model.njoints):
        for joint in model.supports[i]:
            first = model.joints[joint].idx_v
            columns += range(first, first + model.joints[joint].nv) if joint else ()
        starts.append(len(columns))
    return frozen(starts, np.int_), frozen(columns, np.int_)


@compiled(Nothing, OutDense, Count, OutVector)
def _turn_back(places: FloatArray, number: int, six: FloatArray) -> None:
    """Turn a linear and an angular vector (6,) from world axes into those of a placement."""
    for half in range(0, 6, 3):
        x, y, z = six[half], six[half + 1], six[half + 2]
        for a in range(3):
            column = 3 * a
            six[half + a] = (
                places[number, column] * x
                + places[number, column + 1] * y
                + places[number, column + 2] * z
            )


@compiled(
    Nothing,
    *(Table, Dense, Places, Places, Places, Matrix, Dense, Dense, Dense),
    *(Vector, Matrix, Number, Vector),
    *(OutMatrix, OutVector, OutDense),
)
def place_state_rows(
    plan: IntArray,
    offsets: FloatArray,
    starts: IntArray,
    columns: IntArray,
    used: IntArray,
    jacobian: FloatArray,
    joints: FloatArray,
    rates: FloatArray,
    drifts: FloatArray,
    com: FloatArray,
    momentum: FloatArray,
    mass: float,
    com_drift: FloatArray,
    rows: FloatArray,
    drift: FloatArray,
    places: FloatArray,
) -> None:
    """Write the rows of `FrameTable`.

    For a joint of spatial velocity V and drift A at the world's origin and a point p of its body,

        linear  J_lin + J_ang x p,    A_lin + A_ang x p + w x (V_lin + w x p),

    the last term left out in a spatial acceleration. A ball that rolls on its surface point p - u
    has the rows J_lin - J_ang x u, and its centre accelerates by alpha x u: no w x (w x u).

    Args:
        plan: kind, joint, first row, first component, their number and step (e, 6).
        offsets: rotation, origin in the joint's frame, and u in world axes (e, 15).
        starts, columns: of every joint, the columns of J that move it.
        used: (e,) 0 where nothing is to be written.
        jacobian, joints, rates, drifts: as `Kinematics` has them.
        com, momentum, mass, com_drift: likewise.
        rows, drift, places: results (k, nv), (k,), (e, 12).
    """
    six = np.empty(6)
    for e in range(len(plan)):
        if used[e] == 0:
            continue
        kind, joint, row = plan[e, 0], plan[e, 1], plan[e, 2]
        begin, count, step = plan[e, 3], plan[e, 4], plan[e, 5]
        if kind == 2:
            for k in range(count):
                a = begin + k * step
                for j in range(rows.shape[1]):
                    rows[row + k, j] = momentum[a, j] / mass
                drift[row + k] = com_drift[a]
            for a in range(3):
                places[e, 9 + a] = com[a]
            continue
        for a in range(3):
            for c in range(4):
                total = joints[joint, 9 + a] if c == 3 else 0.0
                for b in range(3):
                    total += joints[joint, 3 * b + a] * offsets[e, 3 * c + b]
                places[e, 3 * c + a] = total
        px, py, pz = places[e, 9], places[e, 10], places[e, 11]
        ux, uy, uz = offsets[e, 12], offsets[e, 13], offsets[e, 14]
        qx, qy, qz = px - ux, py - uy, pz - uz
        for place in range(starts[joint], starts[joint + 1]):
            j = columns[place]
            wx, wy, wz = jacobian[3, j], jacobian[4, j], jacobian[5, j]
            six[0] = jacobian[0, j] + wy * qz - wz * qy
            six[1] = jacobian[1, j] + wz * qx - wx * qz
            six[2] = jacobian[2, j] + wx * qy - wy * qx
            six[3], six[4], six[5] = wx, wy, wz
            if kind == 1:
                _turn_back(places, e, six)
            for k in range(count):
                rows[row + k, j] = six[begin + k * step]
        wx, wy, wz = drifts[joint, 3], drifts[joint, 4], drifts[joint, 5]
        six[0] = drifts[joint, 0] + wy * qz - wz * qy
        six[1] = drifts[joint, 1] + wz * qx - wx * qz
        six[2] = drifts[joint, 2] + wx * qy - wy * qx
        six[3], six[4], six[5] = wx, wy, wz
        if kind == 1:
            _turn_back(places, e, six)
        else:
            wx, wy, wz = rates[joint, 3], rates[joint, 4], rates[joint, 5]
            vx = rates[joint, 0] + wy * pz - wz * py
            vy = rates[joint, 1] + wz * px - wx * pz
            vz = rates[joint, 2] + wx * py - wy * px
            six[0] += wy * vz - wz * vy
            six[1] += wz * vx - wx * vz
            six[2] += wx * vy - wy * vx
        for k in range(count):
            drift[row + k] = six[begin + k * step]


@compiled(Nothing, FixedTable, Number)
def fill_state_rows(memory: IntArray, mass: float) -> None:
    """Do as `place_state_rows` does in the memory of _ROWS."""
    place_state_rows(
        array_at(memory, 0, Table),
        array_at(memory, 1, Dense),
        array_at(memory, 2, Places),
        array_at(memory, 3, Places),
        array_at(memory, 4, Places),
        array_at(memory, 5, Matrix),
        array_at(memory, 6, Dense),
        array_at(memory, 7, Dense),
        array_at(memory, 8, Dense),
        array_at(memory, 9, Vector),
        array_at(memory, 10, Matrix),
        mass,
        array_at(memory, 11, Vector),
        array_at(memory, 12, OutMatrix),
        array_at(memory, 13, OutVector),
        array_at(memory, 14, OutDense),
    )
