"""What every contact is: rows that must not move, and the forces it can bear."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray, IntArray
from wbc.control.kinematics import Kinematics
from wbc.errors import ControlError
from wbc.robot import Robot


@dataclass(frozen=True, eq=False, kw_only=True)
class Contact(ABC):
    """A place of the robot that rests on the ground; subclasses are final and frozen.

    The controller demands J qdd + dJ/dt v = -damping J v in the contact's rows and gives it
    forces in the same rows, J' f on the robot.

    Attributes:
        name: how forces, statuses and messages call it.
        friction: Coulomb coefficient; None takes the robot's.
        normal_minimum: least normal force while active [N].
        normal_maximum: greatest normal force [N].
        damping: [1/s] with which a contact that still moves is brought to rest.
    """

    name: str
    friction: float | None = None
    normal_minimum: float = 0.0
    normal_maximum: float = np.inf
    damping: float = 10.0

    def __post_init__(self) -> None:
        """Check the ranges."""
        if self.friction is not None and not self.friction >= 0.0:
            raise ControlError(f"contact '{self.name}': friction must be >= 0.")
        if not 0.0 <= self.normal_minimum <= self.normal_maximum:
            raise ControlError(
                f"contact '{self.name}': 0 <= normal_minimum <= normal_maximum is violated: "
                f"{self.normal_minimum:g}, {self.normal_maximum:g}."
            )
        if not 0.0 <= self.damping < np.inf:
            raise ControlError(f"contact '{self.name}': damping must be >= 0.")

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

    @abstractmethod
    def fill(self, kinematics: Kinematics, jacobian: FloatArray, drift: FloatArray) -> None:
        """Write J (k, nv) and dJ/dt v (k,) at the present state."""

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
