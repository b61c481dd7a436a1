"""Contacts: where the robot may push against the ground, and how hard; points among them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from enum import Enum
from typing import final

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray, IntArray, checked, frozen
from wbc.control.kinematics import FrameTable, Kinematics, StateRows
from wbc.control.tree import RowKind
from wbc.dynamics import Workspace, evaluate
from wbc.errors import ControlError
from wbc.robot import Robot

_LEVEL = 0.1  # of the normal, that leans where a point stands on level ground


@dataclass(frozen=True, eq=False, kw_only=True)
class Contact(ABC):
    """A place of the robot that rests on the ground; subclasses are final and frozen.

    The controller demands J qdd + dJ/dt v = -damping J v - stiffness d in the contact's rows and
    gives it forces in the same rows, J' f on the robot. d is how far the contact is from where it
    was in the first tick with a solution in which it was active.

    Attributes:
        name: how forces, statuses and messages call it.
        friction: Coulomb coefficient; None takes the robot's.
        normal_minimum: least normal force while active [N].
        normal_maximum: greatest normal force [N].
        damping: [1/s] with which a contact that still moves is brought to rest.
        stiffness: [1/s^2] with which drift away from its place is taken back; 0 leaves it to the
            ground, which holds a foot by itself and may be soft where the foot sinks in.
    """

    name: str
    friction: float | None = None
    normal_minimum: float = 0.0
    normal_maximum: float = np.inf
    damping: float = 10.0
    stiffness: float = 0.0

    def __post_init__(self) -> None:
        """Check the ranges."""
        if self.friction is not None and not self.friction >= 0.0:
            raise ControlError(f"contact '{self.name}': friction must be >= 0.")
        if not 0.0 <= self.normal_minimum <= self.normal_maximum:
            raise ControlError(
                f"contact '{self.name}': 0 <= normal_minimum <= normal_maximum is violated: "
                f"{self.normal_minimum:g}, {self.normal_maximum:g}."
            )
        for gain in ("damping", "stiffness"):
            if not 0.0 <= getattr(self, gain) < np.inf:
                raise ControlError(f"contact '{self.name}': {gain} must be >= 0.")

    @abstractmethod
    def bind(self, robot: Robot) -> BoundContact:
        """Return the contact resolved on `robot`.

        Raises:
            ControlError: the contact does not fit the robot.
            RobotError: it names something that the robot does not have.
        """


@dataclass(frozen=True, eq=False)
class Cone:
    """The forces a contact can bear: matrix @ f <= upper, and a bounded normal force.

    Attributes:
        matrix: (p, k) for f in the contact's own rows.
        labels: (p,) what each row is called in messages.
        normal: (k,), normal @ f is the normal force [N].
    """

    matrix: FloatArray
    labels: tuple[str, ...]
    normal: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class BoundContact:
    """A contact resolved on a robot; one whose rows are not those of a frame overrides `fill`.

    Attributes:
        contact: what it was made from.
        cone: rows <= 0 that its force must keep.
        axes: which components (k,) of the force as users see it its own rows are.
        size: how many components that force has: 3 [N] in world axes, 6 [N, N m] in its frame.
        state_rows: its rows where they are those of a frame.
        frames: that it reads and that the robot's model does not have.
        corners: (c, 3) [m] what it can rest on, in the axes of its frame and from that; none
            where it does not face up, so that how it carries weight is another question.
    """

    contact: Contact
    cone: Cone
    axes: IntArray
    size: int = 3
    state_rows: StateRows | None = None
    frames: tuple[pin.Frame, ...] = ()
    corners: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))

    @property
    def name(self) -> str:
        """The contact's name."""
        return self.contact.name

    @property
    def rows(self) -> int:
        """How many rows its Jacobian, and components its force have."""
        return len(self.axes)

    def fill(self, kinematics: Kinematics, jacobian: FloatArray, drift: FloatArray) -> None:
        """Write J (k, nv) and dJ/dt v (k,) at the present state; columns without motion are zero.

        Raises:
            ControlError: the contact has neither `state_rows` nor a `fill` of its own.
        """
        if self.state_rows is None:
            raise ControlError(f"contact '{self.name}' must define state_rows or fill.")
        FrameTable(kinematics.model, [self.state_rows], [0], jacobian, drift).fill(kinematics)

    def wrench(self, force: FloatArray) -> FloatArray:
        """Return the force (k,) as users see it, (size,)."""
        if self.rows == self.size:
            return force
        result = np.zeros(self.size)
        result[self.axes] = force
        return result


class ConeApproximation(Enum):
    """How a pyramid stands to the cone: wholly inside it, or around it."""

    INNER = "inner"
    OUTER = "outer"


def pyramid(friction: float, faces: int, approximation: ConeApproximation) -> FloatArray:
    """Return rows (faces, 3) with rows @ [fx, fy, fz] <= 0, the linearised friction cone.

    The outer pyramid's faces touch the cone, the inner one's edges lie on it (its slope is mu
    cos(pi/faces)). The first face looks along x, so that four faces bound |fx| and |fy|.

    Args:
        friction: mu >= 0.
        faces: number of faces, at least 3.
        approximation: INNER or OUTER.
    """
    angles = 2.0 * np.pi * np.arange(faces) / faces
    inside = approximation is ConeApproximation.INNER
    slope = friction * (np.cos(np.pi / faces) if inside else 1.0)
    return np.column_stack([np.cos(angles), np.sin(angles), np.full(faces, -slope)])


def planar_cone(friction: float, axes: int) -> FloatArray:
    """Return rows with rows @ [f_t, f_z] <= 0 for one tangential axis, or none for f_z alone."""
    if axes == 1:
        return np.zeros((0, 1))
    return np.array([[1.0, -friction], [-1.0, -friction]])


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class PointContact(Contact):
    """One of the robot's contact points on flat ground, force (3,) along the world axes.

    A contact point with a radius is the centre of a ball that rolls without slipping: at rest is
    the point of the ball that touches, and the force acts there. `stiffness` then keeps the height
    of the ball alone.

    Axes in which the robot can never move the point (y of a planar robot) get neither rows nor
    forces, so that no row of the program is singular by construction. On a slope the rows stay
    along the world axes; friction and the normal force lean with the ground.

    Attributes:
        ground_normal: direction (3,) away from the ground, world axes, of any length; straight
            up when left out.
        faces: faces of the friction pyramid, at least 3; a planar robot's cone is exact.
        approximation: whether the pyramid stands inside the cone or around it.
    """

    ground_normal: tuple[float, float, float] = (0.0, 0.0, 1.0)
    faces: int = 4
    approximation: ConeApproximation = ConeApproximation.INNER

    def __post_init__(self) -> None:
        """Check the ranges."""
        super().__post_init__()
        if self.faces < 3:
            raise ControlError(f"contact '{self.name}': a pyramid has at least 3 faces.")
        normal = checked(
            self.ground_normal, (3,), f"contact '{self.name}': ground_normal", ControlError
        )
        if not normal[2] > 0.0:
            raise ControlError(f"contact '{self.name}': ground_normal must point up, z > 0.")

    def bind(self, robot: Robot) -> BoundContact:
        """Return the contact with its movable axes and its cone.

        Raises:
            ControlError: the point cannot move up and down, so that no force supports it, or the
                ground leans in a direction in which the robot cannot move.
            RobotError: no such contact point.
        """
        point = robot.contact(self.name)
        index = [c.name for c in robot.contacts].index(self.name)
        axes = movable_axes(robot, index)
        if 2 not in axes:
            raise ControlError(f"contact '{self.name}' cannot move along z on '{robot.name}'.")
        mu = point.friction if self.friction is None else self.friction
        if len(axes) == 3:
            matrix = pyramid(mu, self.faces, self.approximation)
        else:
            matrix = planar_cone(mu, len(axes))
        turn = self._ground_axes(axes)
        labels = tuple(f"friction cone, face {i}" for i in range(len(matrix)))
        cone = Cone(frozen(matrix @ turn), labels, frozen(turn[-1]))
        up = np.array(self.ground_normal)
        x, y, z = (point.radius / np.linalg.norm(up) * up).tolist()
        step = axes[1] - axes[0] if len(axes) > 1 else 1
        rows = slice(axes[0], axes[-1] + 1, step)
        level = np.linalg.norm(turn[-1][:-1]) < _LEVEL
        return BoundContact(
            contact=self,
            cone=cone,
            axes=frozen(axes, np.int_),
            state_rows=StateRows(RowKind.FRAME, f"contact:{self.name}", rows, (x, y, z)),
            corners=np.zeros((1 if level else 0, 3)),
        )

    def _ground_axes(self, axes: list[int]) -> FloatArray:
        """Return two tangents and the normal of the ground as rows over the movable axes."""
        normal = np.array(self.ground_normal)
        normal /= np.linalg.norm(normal)
        fixed = [axis for axis in range(3) if axis not in axes]
        if np.abs(normal[fixed]).max(initial=0.0) > 1e-9:
            raise ControlError(
                f"contact '{self.name}': ground_normal leans along {'xyz'[fixed[0]]}, in which "
                "the robot cannot move."
            )
        along = np.array([normal[2], 0.0, -normal[0]])
        along /= np.linalg.norm(along)
        return np.array([along, np.cross(normal, along), normal])[np.ix_(axes, axes)]


def movable_axes(robot: Robot, index: int) -> list[int]:
    """Return the world axes in which any motion of the robot moves a contact point.

    Judged at a few configurations spread over the joints' range, by a Jacobian row that is zero
    at all of them.
    """
    generator = np.random.default_rng(0)
    space = Workspace(robot)
    reach = np.zeros(3)
    for _ in range(5):
        step = generator.uniform(-1.0, 1.0, robot.model.nv)
        q = pin.integrate(robot.model, robot.neutral(), step)
        rows = evaluate(robot, q, np.zeros(robot.model.nv), space).contact_jacobian
        reach = np.maximum(reach, np.abs(rows[3 * index : 3 * index + 3]).max(axis=1))
    return [axis for axis in range(3) if reach[axis] > 1e-9]
