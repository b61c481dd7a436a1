"""Tasks on the whole robot: centre of mass, capture point, momentum."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import ClassVar, final

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.kinematics import Kinematics
from wbc.control.rows.task import AxesTask, Gains, StateTask
from wbc.control.tree import RowKind
from wbc.errors import ControlError


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class CenterOfMassTask(AxesTask):
    """Position of the centre of mass along some world axes [m].

    Its acceleration is limited to that of gravity unless told otherwise: the ground only pushes, so
    that nothing falls faster, and with a friction of 0.7 it gives less sideways.

    While it is to rest somewhere (its reference has no velocity and no acceleration) and three or
    more corners of contacts face up, it goes no farther than they can carry it: a target beside
    them is one at their edge. Who steps gives a velocity, and goes where it leads. Without a limit
    of acceleration there is none of this kind.
    """

    name: str = "center_of_mass"
    acceleration_limit: float = 9.81
    kind: ClassVar[RowKind] = RowKind.CENTER_OF_MASS

    def value(self, kinematics: Kinematics) -> FloatArray:
        """Return the centre of mass along the axes, (k,) [m]."""
        return kinematics.center_of_mass()[self.rows()]


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class CapturePointTask(StateTask):
    """The capture point, or divergent component of motion, along x and y of the world [m].

    With c the centre of mass and b = sqrt(g/height), xi = c + c'/b runs away from the centre of
    pressure, c follows it by itself (Pratt 2006, Englsberger 2015). The task wants

        xi' = xi'_ref + stiffness (xi_ref - xi),    c'' = b (xi' - c')

    with a stiffness in [1/s]; `Reference.position` is xi_ref and `Reference.velocity` xi'_ref. Kept
    inside the soles, xi can be stopped without a step.

    Attributes:
        height: [m] of the centre of mass above the ground that b is computed with.
    """

    name: str = "capture_point"
    stiffness: float = 5.0
    acceleration_limit: float = 9.81
    height: float
    kind: ClassVar[RowKind] = RowKind.CENTER_OF_MASS

    def __post_init__(self) -> None:
        """Check the height."""
        super().__post_init__()
        if not 0.0 < self.height < np.inf:
            raise ControlError(f"task '{self.name}': height must be > 0 m, got {self.height}.")

    def rows(self) -> slice:
        """Return x and y."""
        return slice(0, 2)

    def value(self, kinematics: Kinematics) -> FloatArray:
        """Return xi (2,) [m]."""
        rate = self.jacobian(kinematics) @ kinematics.velocity
        pole = sqrt(kinematics.gravity / self.height)
        return np.asarray(kinematics.center_of_mass()[:2] + rate / pole)

    def gains(self, gravity: float) -> Gains:
        """Return the gains of c'' = b (xi' - c') on the error xi_ref - c and the rate c'."""
        pole = sqrt(gravity / self.height)
        return Gains(pole * self.stiffness, -(pole + self.stiffness), pole, 1.0)


@dataclass(frozen=True, eq=False, kw_only=True)
class MomentumTask(AxesTask):
    """Rows of the momentum about the centre of mass; subclasses are final and choose them.

    The value is itself a rate, so the task wants

        dh/dt = A_g qdd + dA_g/dt v = dh_ref/dt + stiffness (h_ref - h)

    with a stiffness in [1/s]; `Reference.position` is h_ref and `Reference.velocity` dh_ref/dt.
    """

    stiffness: float = 10.0
    kind: ClassVar[RowKind] = RowKind.MOMENTUM

    def value(self, kinematics: Kinematics) -> FloatArray:
        """Return h (k,) [kg m/s, N m s]."""
        return np.asarray(self.jacobian(kinematics) @ kinematics.velocity)

    def gains(self, gravity: float) -> Gains:
        """Return the gains of dh/dt = dh_ref/dt + stiffness (h_ref - h)."""
        return Gains(self.stiffness, 0.0, 1.0, 0.0)


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class LinearMomentumTask(MomentumTask):
    """Linear momentum of the whole robot along some world axes [kg m/s]."""

    name: str = "linear_momentum"


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class AngularMomentumTask(MomentumTask):
    """Angular momentum about the centre of mass along some world axes [N m s]."""

    name: str = "angular_momentum"
    turns: ClassVar[bool] = True


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class CentroidalMomentumTask(MomentumTask):
    """The whole momentum about the centre of mass, linear over angular [kg m/s, N m s]."""

    name: str = "centroidal_momentum"

    def rows(self) -> slice:
        """Return all six rows."""
        return slice(0, 6)
