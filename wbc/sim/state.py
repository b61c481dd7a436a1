"""Everything the plant remembers from one step to the next."""

from __future__ import annotations

from typing import Any, NamedTuple, TypeAlias

import numpy as np

from wbc.arrays import BoolArray, FloatArray, frozen

EffectMemory: TypeAlias = tuple[FloatArray | None, ...]
"""Own states of a robot's effects, one per kind that is no row of a table; None without one."""


_NONE = frozen([])


class SimState(NamedTuple):
    """State of a simulated robot; a step turns one into the next and keeps nothing besides.

    Attributes:
        position: q (nq,), pinocchio's configuration.
        velocity: v (nv,).
        time: [s].
        closed: (2 j + k,) which joint limits (lower, then upper) and contacts are closed since the
            last step; empty means unknown, the next step then looks.
        impulse: (r,) row impulses of the last step [N m s, N s], where the next one starts its
            search and which split of internal forces it stays near; empty means none.
        deflection: (m,) [rad] of the motor's output ahead of the joint, where a gear is compliant
            or has backlash; empty means none.
        motor_velocity: (m,) [rad/s] of the motor's output; empty means that of the joints.
        memory: own states of the robot's effects (a motor's warmth, torque on its way); empty
            means as at the start, or that no effect has any.
    """

    position: FloatArray
    velocity: FloatArray
    time: float = 0.0
    closed: BoolArray = frozen([], np.bool_)
    impulse: FloatArray = _NONE
    deflection: FloatArray = _NONE
    motor_velocity: FloatArray = _NONE
    memory: EffectMemory = ()

    def replace(self, **changes: Any) -> SimState:
        """Return a copy with some fields changed."""
        return self._replace(**changes)
