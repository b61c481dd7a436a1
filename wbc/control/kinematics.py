"""Dynamics and kinematics of one tick, and rows of frames, momentum and distances, compiled."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from math import atan2, sqrt
from typing import Annotated, Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.lib.stride_tricks import as_strided

from wbc.arrays import FloatArray, frozen
from wbc.compiled import Dense, OutDense, OutRow, Places, Row, Table, compiled, inner, local, view
from wbc.dynamics import Workspace
from wbc.errors import ControlError, unknown_name
from wbc.mechanics.inertia import bodies_at, move_bodies
from wbc.mechanics.kinematics import joints_of, placed_at, product
from wbc.mechanics.linear import add_cross, add_times, apart, copy_to, dot
from wbc.robot import Robot
from wbc.structures import Structure, numbered

# A robot at one state. World axes, spatial vectors at the world's origin, linear over angular.
#
# momentum (nv, 6) = A_g', places (j, 12) of joints, rotation column by column before translation,
# motions (nv, 6) = J', mass_matrix (nv, nv) and com (3,) are pinocchio's own memory. joints and
# shapes are those of a `Tree` (`wbc.mechanics.kinematics`), without axes and placements, behind a
# world without mass; from starts on stand the columns of J that move each joint; moved (1,) is one
# where the rest stands at the state, too, else zero. That `move_joints` writes.
TREE = Structure(
    "Tree",
    (Dense, "places mass_matrix momentum motions shapes"),
    (Row, "com gravity"),
    (Table, "joints"),
    (Places, "starts columns"),
    (OutRow, "moved", 1),
    (OutDense, "poses", "j", 12),
    (OutDense, "bodies", "j", 10),
    (OutDense, "rates drifts forces", "j", 6),
    (OutRow, "com_drift", 3),
    (OutRow, "momentum_drift", 6),
    (OutRow, "bias", "v"),
)
TreeMemory = Annotated[Any, TREE.kind]


KIND = numbered("frame own center_of_mass momentum distance balance")
"""What rows are of: the velocity of a frame's origin over its angular one in world axes, the
spatial velocity of a frame in its own axes, the velocity of the centre of mass, the momentum about
it (linear over angular), the rate of the distance of two frames (one row), or the velocity of the
centre of mass, steered by what `PointFootBalanceTask` feeds back."""
NO_DISTANCE = 1e-6
"""[m] below which a distance has no direction worth the name."""

# Rows of entries e: J (k, nv) and dJ/dt v (k,).
#
# plan (e, 7): kind, joint, first row, first component, their number and step, the other joint;
# offsets (e, 27): rotation and origin in the joint's frame, the arm of a rolling ball, rotation and
# origin of the other frame; used (e,): 0 where nothing is to be written; places (e, 12): result.
# Here and in poses (j, 12) rotations stand row by row.
ROWS = Structure(
    "Rows",
    (Table, "plan"),
    (Dense, "offsets"),
    (Places, "used"),
    (OutDense, "places", "e", 12),
    (OutDense, "jacobian", "k", "v"),
    (OutRow, "drift", "k"),
)
RowsMemory = Annotated[Any, ROWS.kind]


@compiled
def move_joints(tree: TreeMemory, velocity: Row) -> None:
    """Write the spatial velocity V and drift A = dJ/dt v of every joint, and what follows, once.

    At v (nv,), where pinocchio's part stands at the state. The sum of all forces, taken about the
    centre of mass and without the weight, is dA_g/dt v.
    """
    if tree.moved[0] > 0.0:
        return
    tree.moved[0] = 1.0
    places, poses, whole = tree.places, tree.poses, tree.momentum_drift
    com, force, gravity = tree.com, tree.forces[0], tree.gravity
    for i in range(len(places)):
        for a in range(3):
            for b in range(3):
                poses[i, 3 * a + b] = places[i, 3 * b + a]
            poses[i, 9 + a] = places[i, 9 + a]
    bodies_at(tree.joints, tree.shapes, poses, tree.poses[0, 9:], tree.bodies)
    moved = tree.rates, tree.drifts, tree.forces
    move_bodies(tree.joints, gravity, tree.motions, tree.bodies, velocity, *moved, tree.bias)
    mass = tree.bodies[:, 0].sum()
    copy_to(force, whole)
    add_cross(-1.0, com, force[:3], whole[3:])
    for k in range(3):
        whole[k] += mass * gravity[k]
        tree.com_drift[k] = whole[k] / mass if mass > 0.0 else 0.0


@compiled(counted=False)
def place_turn(place: Row, target: Row, turn: OutRow) -> None:
    """Write log3(R_target R') (3,) [rad], world axes: what turns a placement (12,) into its target.

    By way of the unit quaternion of the largest component (Shepperd, 1978), which is exact for
    small turns and for turns of nearly pi.
    """
    matrix, i = view(local(9), 0, 3, 3), 0
    for a in range(3):
        for b in range(3):
            matrix[a, b] = dot(target[3 * a : 3 * a + 3], place[3 * b : 3 * b + 3])
        i = a if matrix[a, a] > matrix[i, i] else i
    j, k, trace = (i + 1) % 3, (i + 2) % 3, matrix[0, 0] + matrix[1, 1] + matrix[2, 2]
    if trace >= matrix[i, i]:
        w, turn[0] = 1.0 + trace, matrix[2, 1] - matrix[1, 2]
        turn[1], turn[2] = matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]
    else:
        w, turn[i] = matrix[k, j] - matrix[j, k], 1.0 + 2.0 * matrix[i, i] - trace
        turn[j], turn[k] = matrix[i, j] + matrix[j, i], matrix[i, k] + matrix[k, i]
    sine, sign = sqrt(dot(turn, turn)), 1.0 if w >= 0.0 else -1.0
    scale = 2.0 / abs(w) if sine <= 1e-9 * abs(w) else 2.0 * atan2(sine, abs(w)) / sine
    for a in range(3):
        turn[a] *= sign * scale


@compiled(counted=False)
def place_missing(rows: RowsMemory, e: int, target: Row, rates: Row, missing: OutRow) -> None:
    """Write what the present state misses of the target of an entry; call after its rows.

    Args:
        e: number of the entry.
        target: as a placement (12,), of a momentum the momentum in front.
        rates: J v of all rows (k,); a momentum is a rate itself.
        missing: result (k,), of the rows of this entry.
    """
    plan, place, turn = rows.plan, rows.places[e], local(3)
    row, begin, width, step = plan[e, 2], plan[e, 3], plan[e, 4], plan[e, 5]
    if plan[e, 0] != KIND.momentum and begin + (width - 1) * step >= 3:
        place_turn(place, target, turn)
    for k in range(width):
        a = begin + k * step
        if plan[e, 0] == KIND.momentum:
            missing[row + k] = target[a] - rates[row + k]
        else:
            missing[row + k] = target[9 + a] - place[9 + a] if a < 3 else turn[a - 3]


@inner
def _turn_back(place: Row, six: OutRow) -> None:
    """Turn a linear and an angular vector (6,) from world axes into those of a placement."""
    for first in range(0, 6, 3):
        x, y, z = six[first], six[first + 1], six[first + 2]
        for a in range(3):
            six[first + a] = place[a] * x + place[3 + a] * y + place[6 + a] * z


@inner
def _move(tree: TreeMemory, joint: int, point: Row, velocity: OutRow, drift: OutRow) -> None:
    """Write v and, at qdd = 0, its rate (3,) of a point of a joint's body, world axes."""
    rates, drifts = tree.rates[joint], tree.drifts[joint]
    copy_to(rates[:3], velocity)
    copy_to(drifts[:3], drift)
    add_cross(1.0, rates[3:], point, velocity)
    add_cross(1.0, drifts[3:], point, drift)
    add_cross(1.0, rates[3:], velocity, drift)


@inner
def place_apart(
    tree: TreeMemory, joint: int, other: int, points: Row, row: OutRow
) -> tuple[float, float, float]:
    """Write n'(J_other - J_one) (nv,) of two points.

    Args:
        joint, other: that carry the points.
        points: one point, the other, and the direction n from one to the other (9,), world.

    Returns:
        n'(v_other - v_one), the same of their accelerations at qdd = 0, and the square of what of
        v_other - v_one is across n.
    """
    normal, pull, rate, velocity, drift = points[6:], local(6), local(3), local(3), local(3)
    row[:], rate[:], bend = 0.0, 0.0, 0.0
    copy_to(normal, pull)
    for side in range(2):
        sign, at, point = 2.0 * side - 1.0, other if side == 1 else joint, points[3 * side :]
        pull[3:] = 0.0
        add_cross(1.0, point, normal, pull[3:])
        for column in tree.columns[tree.starts[at] : tree.starts[at + 1]]:
            row[column] += sign * dot(pull, tree.motions[column])
        _move(tree, at, point, velocity, drift)
        add_times(sign, velocity, rate)
        bend += sign * dot(normal, drift)
    speed = dot(normal, rate)
    return speed, bend, dot(rate, rate) - speed * speed


@inner
def _place_distance(tree: TreeMemory, rows: RowsMemory, e: int) -> None:
    """Write the row of the distance of two frames; its place holds the distance at 9."""
    plan, offsets, ends, row = rows.plan, rows.offsets, local(9), rows.plan[e, 2]
    placed_at(tree.poses[plan[e, 1]], offsets[e, 9:12], ends[:3])
    placed_at(tree.poses[plan[e, 6]], offsets[e, 24:], ends[3:6])
    distance = sqrt(apart(ends[:3], ends[3:6]))
    for a in range(3):
        ends[6 + a] = (ends[3 + a] - ends[a]) / max(distance, NO_DISTANCE)
    if distance < NO_DISTANCE:
        distance, ends[6], ends[7], ends[8] = NO_DISTANCE, 0.0, 0.0, 1.0
    _, bend, across = place_apart(tree, plan[e, 1], plan[e, 6], ends, rows.jacobian[row])
    rows.drift[row], rows.places[e, 9] = bend + across / distance, distance


@inner
def _place_whole(tree: TreeMemory, rows: RowsMemory, e: int, mass: float) -> None:
    """Write rows of the centre of mass, or those of the momentum where `mass` is one."""
    plan, jacobian, momentum = rows.plan, rows.jacobian, tree.momentum
    row, begin, count, step = plan[e, 2], plan[e, 3], plan[e, 4], plan[e, 5]
    of_mass = plan[e, 0] != KIND.momentum
    for k in range(count):
        a = begin + k * step
        for j in range(jacobian.shape[1]):
            jacobian[row + k, j] = momentum[j, a] / mass
        rows.drift[row + k] = tree.com_drift[a] if of_mass else tree.momentum_drift[a]
    for a in range(3):
        rows.places[e, 9 + a] = tree.com[a] if of_mass else 0.0


@compiled(counted=False)
def fill_state_rows(tree: TreeMemory, rows: RowsMemory, mass: float) -> None:
    """Write the rows of ROWS; call after `move_joints`.

    For a joint of spatial velocity V and drift A at the world's origin and a point p of its body,

        linear  J_lin + J_ang x p,    A_lin + A_ang x p + w x (V_lin + w x p),

    the last term left out in a spatial acceleration. A ball that rolls on its surface point p - u
    has the rows J_lin - J_ang x u, and its centre accelerates by alpha x u: no w x (w x u).

    Args:
        mass: of the robot [kg].
    """
    plan, offsets, jacobian, drift = rows.plan, rows.offsets, rows.jacobian, rows.drift
    six, touches, velocity = local(6), local(3), local(3)
    for e in range(len(plan)):
        if rows.used[e] == 0:
            continue
        kind, joint, row, place = plan[e, 0], plan[e, 1], plan[e, 2], rows.places[e]
        begin, count, step = plan[e, 3], plan[e, 4], plan[e, 5]
        if kind in (KIND.center_of_mass, KIND.momentum, KIND.balance):
            _place_whole(tree, rows, e, 1.0 if kind == KIND.momentum else mass)
            continue
        if kind == KIND.distance:
            _place_distance(tree, rows, e)
            continue
        product(tree.poses[joint], offsets[e], place)
        placed_at(tree.poses[joint], offsets[e, 9:], place[9:])
        for a in range(3):
            touches[a] = place[9 + a] - offsets[e, 12 + a]
        for column in tree.columns[tree.starts[joint] : tree.starts[joint + 1]]:
            copy_to(tree.motions[column], six)
            add_cross(1.0, tree.motions[column, 3:], touches, six)
            if kind == KIND.own:
                _turn_back(place, six)
            for k in range(count):
                jacobian[row + k, column] = six[begin + k * step]
        copy_to(tree.drifts[joint], six)
        if kind == KIND.own:
            add_cross(1.0, tree.drifts[joint, 3:], place[9:], six)
            _turn_back(place, six)
        else:
            _move(tree, joint, place[9:], velocity, six)
            add_cross(-1.0, six[3:], offsets[e, 12:], six)
        for k in range(count):
            drift[row + k] = six[begin + k * step]


@compiled
def place_distances(
    tree: TreeMemory,
    joints: Table,
    points: Dense,
    distances: Row,
    numbers: Row,
    rows: OutDense,
    least: OutRow,
) -> None:
    """Write the rows of `CollisionLimit`, rows qdd >= least.

    Args:
        joints: joint of either side (p, 2).
        points: nearest points of both sides and the direction between them (p, 9), world.
        distances: (p,) [m].
        numbers: margin, rate and influence of the limit.
        rows, least: results (p, nv), (p,).
    """
    margin, rate, influence = numbers[0], numbers[1], numbers[2]
    for i in range(len(distances)):
        rows[i, :], least[i] = 0.0, -1e20
        if distances[i] < influence:
            speed, bend, _ = place_apart(tree, joints[i, 0], joints[i, 1], points[i], rows[i])
            least[i] = -bend - 2.0 * rate * speed - rate * rate * (distances[i] - margin)


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
        known_by_joints: whether `move_joints` is all that a state takes, once pinocchio knows it:
            the axes of all kinds of joints that it knows are fixed in their bodies.
    """

    def __init__(self, robot: Robot, frames: Sequence[pin.Frame] = ()) -> None:
        """Prepare for a robot; `update` must come before anything is read.

        Args:
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
        own = [range(one.idx_v, one.idx_v + one.nv) for one in model.joints]
        own[0] = range(0)  # the world
        columns = [[k for joint in path for k in own[joint]] for path in model.supports]
        joints, shapes = joints_of(model)  # the world goes before them, as in pinocchio
        self.known_by_joints = bool((joints[:, 1] >= 0).all())
        joints[:, [0, 4]] += 1
        self.tree = TREE.of(
            {"j": model.njoints, "v": nv},
            places=_places(model, data),
            mass_matrix=self.mass_matrix,
            momentum=data.Ag.reshape(6, nv).T,  # one column comes as a vector
            com=data.com[0],
            motions=data.J.reshape(6, nv).T,
            joints=np.insert(joints, 0, [-1, -1, 0, 0, 0], axis=0),
            shapes=np.insert(shapes, 0, 0.0, axis=0),
            gravity=frozen(model.gravity.linear),
            starts=np.cumsum([0, *map(len, columns)]),
            columns=np.array(list(chain(*columns)), dtype=np.int_),
        )
        self.bias: FloatArray = self.tree.bias

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
        self._moved, self.tree.moved[0] = False, 0.0

    def move(self) -> None:
        """Evaluate velocities and accelerations at the state that was taken."""
        move_joints(self.tree, np.ascontiguousarray(self.velocity))
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

    def evaluated(self, rows: StateRows) -> Any:
        """Return the ROWS of these alone at the present state."""
        found = rows_of(self.model, [rows], [0], len(range(*rows.rows.indices(6))))
        fill_state_rows(self.tree, found, self.mass)
        return found

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
    moved = np.sin(np.arange(1.0, model.nv + 1.0))  # every joint by another amount
    pin.forwardKinematics(model, data, pin.integrate(model, pin.neutral(model), moved))
    own = [np.append(place.rotation.T, place.translation) for place in data.oMi]
    if first.base is None or not np.array_equal(view, own):
        raise ControlError("this version of pinocchio lays out placements in an unknown way.")
    return view


class StateRows(NamedTuple):
    """Rows that follow from the state alone, so that they are evaluated with all others.

    Attributes:
        kind: what they are of, see `KIND`.
        frame: name of the frame, "" where they are of the whole robot.
        rows: which of its rows, linear over angular.
        arm: (3,) [m] world axes, from the point of a rolling ball that touches to its centre; of a
            balance its bandwidth [1/s] in front.
        other: name of the frame whose distance or pitch is meant.
    """

    kind: int
    frame: str
    rows: slice
    arm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    other: str = ""


def rows_of(model: pin.Model, wanted: Sequence[StateRows], first: Sequence[int], size: int) -> Any:
    """Return the ROWS that evaluate many `StateRows`, each from its first row on, in one call.

    `model` is that of the `Kinematics`, with all frames. Columns of J that never move stay zero.
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
