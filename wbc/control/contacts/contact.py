"""What every contact is: rows that must not move, and the forces it can bear."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray, IntArray
from wbc.control.kinematics import FrameTable, Kinematics, StateRows
from wbc.errors import ControlError
from wbc.robot import Robot


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
class BoundContact(ABC):
    """A contact resolved on a robot.

    Attributes:
        contact: what it was made from.
        rows: k, rows of its Jacobian and components of its force.
        cone: rows <= 0 that its force must keep.
    """

    contact: Contact
    rows: int
    cone: Cone

    @property
    def name(self) -> str:
        """The contact's name."""
        return self.contact.name

    @property
    def state_rows(self) -> StateRows | None:
        """Its rows where they are those of a frame; None for a contact with a `fill` of its own."""
        return None

    def fill(self, kinematics: Kinematics, jacobian: FloatArray, drift: FloatArray) -> None:
        """Write J (k, nv) and dJ/dt v (k,) at the present state; columns without motion are zero.

        Raises:
            ControlError: the contact has neither `state_rows` nor a `fill` of its own.
        """
        rows = self.state_rows
        if rows is None:
            raise ControlError(f"contact '{self.name}' must define state_rows or fill.")
        FrameTable(kinematics.model, [rows], [0]).fill(kinematics, jacobian, drift)

    def frames(self, model: pin.Model) -> tuple[pin.Frame, ...]:
        """Return frames that the contact reads and that `model` does not have; none by default."""
        return ()

    @property
    def components(self) -> IntArray:
        """Which components of the user's force (3,) or (6,) its own rows are, (k,)."""
        return np.arange(self.rows)

    @abstractmethod
    def wrench(self, force: FloatArray) -> FloatArray:
        """Return the force (k,) as users see it, (3,) [N] world or (6,) [N, N m] in its frame."""
