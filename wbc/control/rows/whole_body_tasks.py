"""Tasks on the whole robot: centre of mass, capture point, momentum."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, field
from math import sqrt
from typing import final

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.kinematics import Kinematics, RowKind, StateRows
from wbc.control.reference import Target
from wbc.control.rows.task import Gains, Task, axis_rows
from wbc.errors import ControlError
from wbc.robot import Robot

_ALL = slice(0, 6)


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class CenterOfMassTask(Task):
    """Position of the centre of mass along some world axes [m].

    Its acceleration is limited to that of gravity unless told otherwise: the ground only pushes, so
    that nothing falls faster, and with a friction of 0.7 it gives less sideways.

    Attributes:
        axes: which of "xyz" belong to the task, for example "xz" or "z".
    """

    name: str = "center_of_mass"
    acceleration_limit: float = 9.81
    axes: str = "xyz"
    _rows: slice = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the axes."""
        super().__post_init__()
        object.__setattr__(self, "_rows", axis_rows(self.axes, self.name))

    def check(self, robot: Robot) -> int:
        """Return the number of axes."""
        return len(self.axes)

    def value(self, kinematics: Kinematics) -> FloatArray:
        """Return the centre of mass along the axes, (k,) [m]."""
        return kinematics.center_of_mass()[self._rows]

    def error(self, kinematics: Kinematics, target: Target) -> FloatArray:
        """Return target - value, (k,) [m]."""
        return np.asarray(target - self.value(kinematics))

    def jacobian(self, kinematics: Kinematics) -> FloatArray:
        """Return the rows of J_com, (k, nv)."""
        return kinematics.center_of_mass_jacobian()[self._rows]

    def drift(self, kinematics: Kinematics) -> FloatArray:
        """Return the rows of dJ_com/dt v, (k,) [m/s^2]."""
        return kinematics.center_of_mass_drift()[self._rows]

    @property
    def state_rows(self) -> StateRows:
        """The axes of the centre of mass."""
        return StateRows(RowKind.CENTER_OF_MASS, "", self._rows)

    def pack(self, target: Target, place: FloatArray) -> None:
        """Write the target (k,) as the origin of a placement (12,)."""
        place[9:][self._rows] = target


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class CapturePointTask(Task):
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

    def __post_init__(self) -> None:
        """Check the height."""
        super().__post_init__()
        if not 0.0 < self.height < np.inf:
            raise ControlError(f"task '{self.name}': height must be > 0 m, got {self.height}.")

    def check(self, robot: Robot) -> int:
        """Return 2."""
        return 2

    def value(self, kinematics: Kinematics) -> FloatArray:
        """Return xi (2,) [m]."""
        rate = self.jacobian(kinematics) @ kinematics.velocity
        return np.asarray(kinematics.center_of_mass()[:2] + rate / self._pole(kinematics))

    def error(self, kinematics: Kinematics, target: Target) -> FloatArray:
        """Return target - value, (2,) [m]."""
        return np.asarray(target - self.value(kinematics))

    def jacobian(self, kinematics: Kinematics) -> FloatArray:
        """Return the x and y rows of J_com, (2, nv)."""
        return kinematics.center_of_mass_jacobian()[:2]

    def drift(self, kinematics: Kinematics) -> FloatArray:
        """Return the x and y rows of dJ_com/dt v, (2,) [m/s^2]."""
        return kinematics.center_of_mass_drift()[:2]

    @property
    def state_rows(self) -> StateRows:
        """The x and y axes of the centre of mass."""
        return StateRows(RowKind.CENTER_OF_MASS, "", slice(0, 2))

    def pack(self, target: Target, place: FloatArray) -> None:
        """Write the target (2,) as the origin of a placement (12,)."""
        place[9:11] = target

    def gains(self, gravity: float) -> Gains:
        """Return the gains of c'' = b (xi' - c') on the error xi_ref - c and the rate c'."""
        pole = sqrt(gravity / self.height)
        return Gains(pole * self.stiffness, -(pole + self.stiffness), pole, 1.0)

    def _pole(self, kinematics: Kinematics) -> float:
        return sqrt(kinematics.gravity / self.height)


@dataclass(frozen=True, eq=False, kw_only=True)
class MomentumTask(Task):
    """Rows of the momentum about the centre of mass; subclasses are final and choose them.

    The value is itself a rate, so the task wants

        dh/dt = A_g qdd + dA_g/dt v = dh_ref/dt + stiffness (h_ref - h)

    with a stiffness in [1/s]; `Reference.position` is h_ref and `Reference.velocity` dh_ref/dt.
    """

    stiffness: float = 10.0
    acceleration_limit: float = np.inf

    def check(self, robot: Robot) -> int:
        """Return the number of rows."""
        return len(range(*self.rows().indices(6)))

    @abstractmethod
    def rows(self) -> slice:
        """Return which of the six rows, linear over angular, the task has."""

    def value(self, kinematics: Kinematics) -> FloatArray:
        """Return h (k,) [kg m/s, N m s]."""
        return np.asarray(self.jacobian(kinematics) @ kinematics.velocity)

    def error(self, kinematics: Kinematics, target: Target) -> FloatArray:
        """Return h_ref - h, (k,) [kg m/s, N m s]."""
        return np.asarray(target - self.value(kinematics))

    def jacobian(self, kinematics: Kinematics) -> FloatArray:
        """Return the rows of the centroidal momentum matrix, (k, nv)."""
        return kinematics.momentum_matrix()[self.rows()]

    def drift(self, kinematics: Kinematics) -> FloatArray:
        """Return dA_g/dt v, (k,) [N, N m]."""
        return kinematics.momentum_drift()[self.rows()]

    @property
    def state_rows(self) -> StateRows:
        """The rows of the momentum."""
        return StateRows(RowKind.MOMENTUM, "", self.rows())

    def pack(self, target: Target, place: FloatArray) -> None:
        """Write the target (k,) in front."""
        place[: len(target)] = target

    def gains(self, gravity: float) -> Gains:
        """Return the gains of dh/dt = dh_ref/dt + stiffness (h_ref - h)."""
        return Gains(self.stiffness, 0.0, 1.0, 0.0)


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class LinearMomentumTask(MomentumTask):
    """Linear momentum of the whole robot along some world axes [kg m/s].

    Attributes:
        axes: which of "xyz" belong to the task.
    """

    name: str = "linear_momentum"
    axes: str = "xyz"
    _rows: slice = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the axes."""
        super().__post_init__()
        object.__setattr__(self, "_rows", axis_rows(self.axes, self.name))

    def rows(self) -> slice:
        """Return the linear rows of the axes."""
        return self._rows


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class AngularMomentumTask(MomentumTask):
    """Angular momentum about the centre of mass along some world axes [N m s].

    Attributes:
        axes: which of "xyz" belong to the task, "y" for a planar robot.
    """

    name: str = "angular_momentum"
    axes: str = "xyz"
    _rows: slice = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the axes."""
        super().__post_init__()
        rows = axis_rows(self.axes, self.name)
        object.__setattr__(self, "_rows", slice(rows.start + 3, rows.stop + 3, rows.step))

    def rows(self) -> slice:
        """Return the angular rows of the axes."""
        return self._rows


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class CentroidalMomentumTask(MomentumTask):
    """The whole momentum about the centre of mass, linear over angular [kg m/s, N m s]."""

    name: str = "centroidal_momentum"

    def rows(self) -> slice:
        """Return all six rows."""
        return _ALL
