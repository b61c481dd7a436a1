"""What a controller is told in a tick: the state, and what a task is asked to do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias

import numpy as np

from wbc.arrays import FloatArray

Target: TypeAlias = Any
"""A task's own kind of value: an array (k,), a rotation matrix (3, 3), or a `pin.SE3`."""


@dataclass(frozen=True, eq=False, slots=True)
class Reference:
    """Target, velocity and feed-forward acceleration of one task.

    Attributes:
        position: where the task's value should be, of the kind that `Task.value` returns; None
            holds the value that the task had when the controller first saw it.
        velocity: (k,) rate of change of the target, in the task's rows; None is zero.
        acceleration: (k,) feed-forward, in the task's rows; None is zero.
    """

    position: Target | None = None
    velocity: FloatArray | None = None
    acceleration: FloatArray | None = None

    def is_finite(self) -> bool:
        """Whether every number in it is finite."""
        position = self.position
        parts = (getattr(position, "homogeneous", position), self.velocity, self.acceleration)
        return all(p is None or bool(np.isfinite(np.asarray(p, np.float64)).all()) for p in parts)


class State(Protocol):
    """What the controller reads of a state: `wbc.robot.Motion` is one."""

    @property
    def position(self) -> FloatArray:
        """q (nq,)."""

    @property
    def velocity(self) -> FloatArray:
        """v (nv,)."""
