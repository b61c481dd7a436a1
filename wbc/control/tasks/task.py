"""What every task is: a value, its error, its Jacobian and its drift."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from math import sqrt

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.kinematics import Kinematics, StateRows
from wbc.control.reference import Reference, Target
from wbc.control.selection import Rows
from wbc.control.tasks.targets import vector_target
from wbc.errors import ControlError
from wbc.robot import Robot


@dataclass(frozen=True, eq=False, kw_only=True)
class Task(ABC):
    """A motion that the controller pursues in the least-squares sense.

    With e = target - value, the task wants

        J qdd + dJ/dt v = acc_ref + damping (vel_ref - J v) + stiffness e

    and costs weight/2 times the squared violation. Subclasses are final, frozen and know nothing
    of the QP.

    Attributes:
        name: how references, statuses and messages call it.
        weight: w >= 0, one number or one per row.
        stiffness: [1/s^2].
        damping: [1/s]; left out it is critical, 2 sqrt(stiffness).
        level: 0 for an ordinary task; a task of level 1 is strictly less important: it moves
            nothing that the tasks of level 0 decide.
    """

    name: str
    weight: float | FloatArray = 1.0
    stiffness: float = 100.0
    damping: float | None = None
    level: int = 0

    def __post_init__(self) -> None:
        """Check gains and weights."""
        if not np.all(np.isfinite(self.weight)) or np.any(np.asarray(self.weight) < 0.0):
            raise ControlError(f"task '{self.name}': weight must be >= 0, got {self.weight}.")
        for label, gain in (("stiffness", self.stiffness), ("damping", self.damping)):
            if gain is not None and not 0.0 <= gain < np.inf:
                raise ControlError(f"task '{self.name}': {label} must be >= 0, got {gain}.")
        if self.level not in (0, 1):
            raise ControlError(f"task '{self.name}': level must be 0 or 1, got {self.level}.")

    @property
    def velocity_gain(self) -> float:
        """The damping in use [1/s]."""
        return 2.0 * sqrt(self.stiffness) if self.damping is None else self.damping

    @abstractmethod
    def check(self, robot: Robot) -> int:
        """Return the number of rows on `robot`; raise ControlError where it does not fit."""

    @abstractmethod
    def value(self, kinematics: Kinematics) -> Target:
        """Return the present value, of the kind that a reference's `position` has."""

    def admitted(self, target: Target, size: int) -> Target:
        """Return a target checked, and copied from memory that the caller may use again.

        By default a target is an array of as many numbers as the task has rows; a task whose
        value is something else says so here.

        Args:
            target: what a reference's `position` holds.
            size: number of rows k.

        Raises:
            ControlError: it is no target of this task.
        """
        return vector_target(target, size)

    @abstractmethod
    def error(self, kinematics: Kinematics, target: Target) -> FloatArray:
        """Return target - value (k,) in the task's rows; its rate is vel_ref - J v at e = 0."""

    @abstractmethod
    def jacobian(self, kinematics: Kinematics) -> FloatArray:
        """Return J (k, nv)."""

    @abstractmethod
    def drift(self, kinematics: Kinematics) -> FloatArray:
        """Return dJ/dt v (k,)."""

    def selection(self, robot: Robot) -> Rows | None:
        """Return the velocity rows that J selects, where it is a selection; None otherwise.

        The assembly then adds to a diagonal instead of multiplying matrices.
        """
        return None

    @property
    def state_rows(self) -> StateRows | None:
        """The rows where they are those of a frame or of the centre of mass; None otherwise.

        The error must then be what is missing in these rows between the present placement and the
        one that `pack` writes, and such a task is evaluated together with all others.
        """
        return None

    def pack(self, target: Target, place: FloatArray) -> None:
        """Write a target as a placement, where the task has `state_rows`.

        Args:
            target: as `admitted` returns it.
            place: result (12,), rotation column by column before the translation.
        """
        raise NotImplementedError

    @property
    def positions(self) -> Rows | None:
        """Where a task that selects joints finds their positions in q; None to be asked itself.

        The error must then be target - position.
        """
        return None

    def command(self, kinematics: Kinematics, reference: Reference, rate: FloatArray) -> FloatArray:
        """Return the acceleration (k,) that the task wants, given its present rate J v."""
        wanted = self.error(kinematics, reference.position)
        wanted *= self.stiffness
        gain = self.velocity_gain
        if reference.velocity is not None:
            wanted += gain * reference.velocity
        wanted -= gain * rate
        if reference.acceleration is not None:
            wanted += reference.acceleration
        return wanted
