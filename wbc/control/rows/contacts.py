"""Contacts: where and when the robot may push against the ground, how hard; those of one tick."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise, product
from math import inf
from typing import Any, final

import numpy as np
import pinocchio as pin
from scipy.linalg import block_diag
from scipy.spatial import ConvexHull, QhullError

from wbc.arrays import FloatArray, IntArray, checked, frozen, must
from wbc.control.inputs import Checked
from wbc.control.kinematics import KIND, Kinematics, StateRows, fill_state_rows, rows_of
from wbc.control.memory import CONTACTS
from wbc.dynamics.batch import point_jacobians
from wbc.errors import ControlError, require_known
from wbc.robot import Robot

_LEVEL = 0.1  # of the normal, that leans where a point stands on level ground


@dataclass(frozen=True, eq=False, kw_only=True)
class Contact(Checked, ABC):
    """A place of the robot that rests on the ground; subclasses are final and frozen.

    The controller demands J qdd + dJ/dt v = -damping J v in the contact's rows and gives it forces
    in the same rows, J' f on the robot.

    Attributes:
        name: how forces, statuses and messages call it.
        friction: Coulomb coefficient; None takes the robot's.
        normal_minimum: least normal force while active [N].
        normal_maximum: greatest normal force [N].
        damping: [1/s] with which a contact that still moves is brought to rest.
    """

    name: str
    friction: float | None = field(default=None, metadata=must(">= 0"))
    normal_minimum: float = field(default=0.0, metadata=must(">= 0 and <= {0.normal_maximum} N"))
    normal_maximum: float = np.inf
    damping: float = field(default=10.0, metadata=must(">= 0 and < inf"))

    _told = "contact '{0.name}': "

    @abstractmethod
    def bind(self, robot: Robot) -> BoundContact:
        """Return the contact resolved on `robot`.

        Raises ControlError where it does not fit, RobotError where the robot lacks what it names.
        """


@dataclass(frozen=True, eq=False, kw_only=True)
class BoundContact:
    """A contact resolved on a robot.

    Attributes:
        contact: what it was made from.
        cone: (p, k), cone @ f <= 0 for a force f in its own rows that it can bear.
        labels: (p,) what each row of the cone is called in messages, and the unit of a violation.
        normal: (k,), normal @ f is the normal force [N].
        axes: which components (k,) of the force as users see it its own rows are.
        size: how many components that force has: 3 [N] in world axes, 6 [N, N m] in its frame.
        state_rows: its rows, which are those of a frame.
        frames: that it reads and that the robot's model does not have.
        corners: (c, 3) [m] what it can rest on, in the axes of its frame and from that; none
            where it does not face up, so that how it carries weight is another question.
    """

    contact: Contact
    cone: FloatArray
    labels: tuple[tuple[str, str], ...]
    normal: FloatArray
    axes: IntArray
    state_rows: StateRows
    size: int = 3
    frames: tuple[pin.Frame, ...] = ()
    corners: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))

    @property
    def name(self) -> str:
        """The contact's name."""
        return self.contact.name


def friction_rows(friction: float, axes: int) -> FloatArray:
    """Return rows with rows @ f <= 0: friction along all of some axes but the last, the normal.

    In space a pyramid of four sides whose edges lie on the cone (its slope is mu/sqrt(2)), in the
    plane the cone itself, along the normal alone none.
    """
    tangents = axes - 1
    slope, along = friction / np.sqrt(max(tangents, 1)), np.eye(tangents)
    return np.hstack([np.vstack([along, -along]), np.full((2 * tangents, 1), -slope)])


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class PointContact(Contact):
    """One of the robot's contact points on flat ground, force (3,) along the world axes.

    A contact point with a radius is the centre of a ball that rolls without slipping: at rest is
    the point of the ball that touches, and the force acts there.

    Axes in which the robot can never move the point (y of a planar robot) get neither rows nor
    forces, so that no row of the program is singular by construction. On a slope the rows stay
    along the world axes; friction and the normal force lean with the ground.

    Attributes:
        ground_normal: direction (3,) away from the ground, world axes, of any length; straight
            up when left out.
    """

    ground_normal: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        """Check the ranges."""
        super().__post_init__()
        told = f"contact '{self.name}': ground_normal"
        if not checked(self.ground_normal, (3,), told, ControlError)[2] > 0.0:
            raise ControlError(f"{told} must point up, z > 0.")

    def bind(self, robot: Robot) -> BoundContact:
        """Return the contact with its movable axes and its cone.

        Raises:
            ControlError: the point cannot move up and down, so that no force supports it, or the
                ground leans in a direction in which the robot cannot move.
        """
        point = robot.contact(self.name)
        # moved by any motion of the robot, as a few configurations over the joints' range show
        moved = np.abs(point_jacobians(robot, np.array(drawn_poses(robot, 5)), self.name))
        axes = np.flatnonzero(moved[:, :3].max(axis=(0, 2)) > 1e-9).tolist()
        if 2 not in axes:
            raise ControlError(f"contact '{self.name}' cannot move along z on '{robot.name}'.")
        mu = point.friction if self.friction is None else self.friction
        matrix = friction_rows(mu, len(axes))
        up = np.array(self.ground_normal) / np.linalg.norm(self.ground_normal)
        turn, (x, y, z) = self._ground_axes(axes, up), (point.radius * up).tolist()
        step = axes[1] - axes[0] if len(axes) > 1 else 1
        rows = slice(axes[0], axes[-1] + 1, step)
        level = np.linalg.norm(turn[-1][:-1]) < _LEVEL
        return BoundContact(
            contact=self,
            cone=frozen(matrix @ turn),
            labels=tuple((f"friction cone, face {i}", "N") for i in range(len(matrix))),
            normal=frozen(turn[-1]),
            axes=frozen(axes, np.int_),
            state_rows=StateRows(KIND.frame, f"contact:{self.name}", rows, (x, y, z)),
            corners=np.zeros((1 if level else 0, 3)),
        )

    def _ground_axes(self, axes: list[int], normal: FloatArray) -> FloatArray:
        """Return two tangents and the normal of the ground as rows over the movable axes."""
        fixed = [axis for axis in range(3) if axis not in axes]
        if np.abs(normal[fixed]).max(initial=0.0) > 1e-9:
            way = "xyz"[fixed[0]]
            raise self.wrong(f"ground_normal leans along {way}, in which the robot cannot move.")
        along = np.array([normal[2], 0.0, -normal[0]])
        along /= np.linalg.norm(along)
        return np.array([along, np.cross(normal, along), normal])[np.ix_(axes, axes)]


def drawn_poses(robot: Robot, count: int) -> list[FloatArray]:
    """Return some configurations (nq,) drawn around the neutral one, always the same."""
    steps = np.random.default_rng(0).uniform(-1.0, 1.0, (count, robot.model.nv))
    return [pin.integrate(robot.model, robot.neutral(), step) for step in steps]


_FLAT = 1e-6  # [m] that corners written with six decimals are off


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class SurfaceContact(Contact):
    """A convex sole between some of the robot's contact points, in the x-y plane of a frame.

    The wrench (6,) is force over torque at the mean of the corners, along the frame's axes, z away
    from the ground. It can be borne if it is the sum of forces at the corners, each in its friction
    pyramid: friction, centre of pressure, and the yaw torque that friction leaves are the faces of
    that cone, found by Qhull. For a rectangle they are the sixteen rows of Caron, Pham & Nakamura
    (ICRA 2015).

    Attributes:
        corners: names of the contact points, three or more, in any order.
    """

    corners: tuple[str, ...]

    def bind(self, robot: Robot) -> BoundContact:
        """Return the contact with its placement and its cone.

        Raises:
            ControlError: fewer than three corners, corners in several frames, not in one plane
                z = const., or one that lies between the others.
        """
        points = [robot.contact(name) for name in self.corners]
        if len(points) < 3:
            raise self.wrong("a surface has at least three corners.")
        if len({point.frame for point in points}) > 1:
            told = ", ".join(f"'{point.name}' in '{point.frame}'" for point in points)
            raise self.wrong(f"the corners sit in several frames: {told}")
        offsets = np.array([point.offset for point in points])
        middle = offsets.mean(axis=0)
        if np.ptp(offsets[:, 2]) > _FLAT:
            raise self.wrong(f"the corners lie in no plane along x and y of '{points[0].frame}'.")
        try:
            used = set(ConvexHull(offsets[:, :2]).vertices)
        except QhullError:
            used = set[int]()
        if between := [name for i, name in enumerate(self.corners) if i not in used]:
            raise self.wrong(f"'{between[0]}' lies between the other corners.")
        mu = min(p.friction for p in points) if self.friction is None else self.friction
        around = (offsets - middle)[:, :2]
        matrix, labels = polygon_cone(mu / np.sqrt(2.0), around)
        number, name = robot.model.getFrameId(points[0].frame), f"middle of {self.name}"
        parent = robot.model.frames[number]
        placement = parent.placement * pin.SE3(np.eye(3), middle)
        return BoundContact(
            contact=self,
            cone=frozen(matrix),
            labels=labels,
            normal=np.eye(6)[2],
            axes=frozen(np.arange(6), np.int_),
            size=6,
            state_rows=StateRows(KIND.own, name, slice(0, 6)),
            corners=offsets - middle,
            frames=(pin.Frame(name, parent.parentJoint, number, placement, pin.OP_FRAME),),
        )


def polygon_cone(
    friction: float, corners: FloatArray
) -> tuple[FloatArray, tuple[tuple[str, str], ...]]:
    """Return rows (p, 6) <= 0 on [f, tau] that a convex polygon can bear, names and units.

    The wrenches of normal force one are the convex hull of those of the edges of all corners'
    pyramids; its faces are the rows.

    Args:
        friction: slope of the four-sided pyramids, > 0.
        corners: (n, 2) [m] about the point of the wrench.

    Raises:
        ControlError: without friction the cone has no inside.
    """
    if not friction > 0.0:
        raise ControlError("a polygonal sole needs friction > 0.")
    reach = float(np.abs(corners).max())
    edges = []
    for (x, y), a, b in product(corners, (1.0, -1.0), (1.0, -1.0)):
        fx, fy = a * friction, b * friction
        edges.append([fx, fy, y / reach, -x / reach, (x * fy - y * fx) / reach])
    found = np.unique(np.round(ConvexHull(np.array(edges)).equations, 9), axis=0)
    rows = found[:, [0, 1, 5, 2, 3, 4]]
    rows[:, 3:] /= reach
    labels = []
    for row in rows:
        turns, tilts = abs(row[5]) > 0.0, np.abs(row[3:5]).max() > 0.0
        name = "yaw torque" if turns else "centre of pressure" if tilts else "friction"
        labels.append((name, "N m" if turns or tilts else "N"))
        row /= abs(row[5]) if turns else np.abs(row[3:5]).max() if tilts else 1.0
    return rows, tuple(labels)


class ContactSet:
    """Stacked rows of some contacts.

    Attributes:
        contacts: the contacts, in order.
        slices: the rows of each.
        rows: total number of rows k, which is also that of force components.
        rank: how many of them are independent.
        memory: the CONTACTS, J (k, nv) and what J qdd must be (k,) among them.
        cone: (p, k) rows <= 0 on the forces in newtons.
        cone_labels: (p,) names for messages, and units.
        normals: (c, k), normal force of each contact.
        load_share: forces (k,) that share a weight of one equally among the normals.
    """

    def __init__(
        self, contacts: tuple[BoundContact, ...], model: pin.Model, rank: int | None = None
    ) -> None:
        """Lay out the rows, `rank` of which (all when left out) are independent.

        `model` is that of the `Kinematics` that is read.
        """
        self.contacts = contacts
        ends = np.cumsum([0, *[len(contact.axes) for contact in contacts]]).tolist()
        self.slices = [slice(start, end) for start, end in pairwise(ends)]
        self.rows = k = ends[-1]
        self.rank = k if rank is None else rank
        corners = [np.insert(one.corners, 0, i, axis=1) for i, one in enumerate(contacts)]
        level = all(len(contact.corners) for contact in contacts)
        self.memory: Any = CONTACTS.of(
            {"k": k},
            rows=rows_of(model, [one.state_rows for one in contacts], ends[:-1], k),
            damping=np.repeat([c.contact.damping for c in contacts], np.diff(ends)),
            corners=np.vstack([np.zeros((0, 4)), *(corners if level else [])]),
        )
        nothing = np.zeros((0, 0))
        self.cone = block_diag(nothing, *[contact.cone for contact in contacts])
        self.normals = block_diag(nothing, *[contact.normal[None] for contact in contacts])
        labels = [(contact.name, *label) for contact in contacts for label in contact.labels]
        self.cone_labels = [(f"{name}: {face}", unit) for name, face, unit in labels]
        self.load_share = self.normals.sum(axis=0) / max(len(contacts), 1)

    def fill(self, kinematics: Kinematics) -> None:
        """Evaluate the rows at the present state."""
        fill_state_rows(kinematics.tree, self.memory.rows, kinematics.mass)

    def wrenches(self, force: FloatArray) -> dict[str, FloatArray]:
        """Return the force of every contact as users see it, of all components (k,) [N, N m]."""
        found = {contact.name: np.zeros(contact.size) for contact in self.contacts}
        for contact, rows in zip(self.contacts, self.slices, strict=True):
            found[contact.name][contact.axes] = force[rows]
        return found


@final
class ContactRamp:
    """Greatest normal forces of contacts that come and go along ramps.

    A contact that is wanted no longer loses its ceiling in a straight line and leaves the set when
    the ceiling reaches zero; one that is wanted again gets it back in the same way, and is free at
    the end. A ceiling that is asked for is kept at once. A controller has one of its own, see
    `ControllerSettings.contact_ramp`; a slower one before it unloads a foot in time:

        ramp = ContactRamp(["left", "right"], load=weight, duration=0.2)
        ...
        command = controller.step(state, references, ramp.step({"left"}, dt))
    """

    def __init__(
        self, contacts: Sequence[str], load: float, duration: float, *, rise: float | None = None
    ) -> None:
        """Start with every contact active.

        Args:
            contacts: names of all contacts.
            load: normal force [N] from which and to which the ceilings go, for example the weight.
            duration: of a ramp [s].
            rise: of a ramp upwards [s] where that is another one. Flags that flicker evenly end
                with all contacts active where it is shorter.

        Raises:
            ControlError: no contact, or a load or duration that is not positive.
        """
        rise = duration if rise is None else rise
        if not contacts or not load > 0.0 or not duration > 0.0 or not rise > 0.0:
            raise ControlError("a contact ramp needs contacts, a load > 0 N and a duration > 0 s.")
        self._load, self._fall, self._rise = load, 1.0 / duration, 1.0 / rise
        self._share = dict.fromkeys(contacts, 1.0)

    def step(
        self, wanted: Collection[str] | Mapping[str, float], dt: float, *, at_once: bool = False
    ) -> Mapping[str, float]:
        """Go on for `dt` [s]; return the ceiling [N] of every contact that may carry force.

        Args:
            wanted: the contacts that are to carry force, or their ceilings.
            at_once: whether to begin with what is wanted, without a ramp.

        Raises:
            ControlError: a contact that there is not.
        """
        for name in wanted:
            require_known(ControlError, "contact", name, self._share)
        given = wanted if isinstance(wanted, Mapping) else dict.fromkeys(wanted, inf)
        fall, rise = (inf, inf) if at_once else (dt * self._fall, dt * self._rise)
        ceilings = {}
        for name, share in self._share.items():
            ceiling = given.get(name, 0.0)
            goal = min(ceiling / self._load, 1.0)
            share = min(goal, share + rise) if goal > 0.0 else max(share - fall, 0.0)
            self._share[name] = share
            if share > 0.0:
                ceilings[name] = ceiling if share == goal else share * self._load
        return ceilings


@final
@dataclass(frozen=True)
class ContactSchedule(Checked):
    """A gait: every contact stands for a part of a period, each with an offset of its own.

    The time is given, so that the user owns the clock:

        trot = ContactSchedule(0.5, {"FL": 0.0, "HR": 0.0, "FR": 0.5, "HL": 0.5}, duty=0.6)
        ceilings = ramp.step(trot.standing(time), dt)
        swing = trot.swing("FL", time)   # 0 to 1 in the air, None on the ground

    Attributes:
        period: [s].
        offsets: contact -> share of the period, 0 to 1, at which it begins to stand.
        duty: share of the period that every contact stands, in (0, 1].
    """

    period: float = field(metadata=must("> 0 s and < inf"))
    offsets: Mapping[str, float]
    duty: float = field(default=0.5, metadata=must("> 0 and <= 1"))

    _told = "contact schedule: "

    def __post_init__(self) -> None:
        """Check the ranges."""
        super().__post_init__()
        for name, offset in self.offsets.items():
            if not 0.0 <= offset <= 1.0:
                raise ControlError(f"contact '{name}': an offset lies in [0, 1], got {offset}.")

    def standing(self, time: float) -> frozenset[str]:
        """Return the contacts that stand at a time [s]."""
        return frozenset(name for name in self.offsets if self._phase(name, time) < self.duty)

    def swing(self, contact: str, time: float) -> float | None:
        """Return how much of its swing a contact has done, 0 to 1; None while it stands.

        Raises:
            ControlError: no such contact.
        """
        phase = self._phase(contact, time)
        return None if phase < self.duty else (phase - self.duty) / (1.0 - self.duty)

    def _phase(self, contact: str, time: float) -> float:
        require_known(ControlError, "contact", contact, self.offsets)
        return (time / self.period - self.offsets[contact]) % 1.0
