"""What the controller reads of a robot's state."""

from __future__ import annotations

from typing import Protocol

from wbc.arrays import FloatArray


class State(Protocol):
    """What the controller reads of a state: `wbc.robot.Motion` is one."""

    @property
    def position(self) -> FloatArray:
        """q (nq,)."""

    @property
    def velocity(self) -> FloatArray:
        """v (nv,)."""
