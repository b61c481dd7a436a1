"""How links react to deflections of their gears, along a log."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import astuple, dataclass, replace

import numpy as np

from wbc.arrays import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class LinkFriction:
    """Dry friction that holds the link behind a gear, along a log.

    Attributes:
        velocity: (N,) of the motor, at the joint [rad/s]; the link's is larger by d_d.
        level: (N,) >= 0 of the friction [N m].
        counted: (N,) friction of a link without deflection, level sgn(velocity) [N m]: what is
            unexplained has it, the load does not.
    """

    velocity: FloatArray
    level: FloatArray
    counted: FloatArray


@dataclass(frozen=True, eq=False)
class LinkResponse:
    """How the link behind one gear reacts to a small deflection d of the gear, along a log.

    The link is at q = motor + d. The torque balance of the links, linear in d:

        inertia d_dd + damping d_d + stiffness d + load = torque the gears pass on

    With several soft gears the left side is the sum over their deflections. Dry friction of the
    link adds a torque between -level and level that opposes its speed; a deflection then has a
    fourth column, that torque.

    Attributes:
        step: distance of the samples [s].
        row: index of the joint in v.
        load: (N, nv) torque the links need without deflection [N m].
        inertia: (N, nv) column of the mass matrix [kg m^2].
        damping: (N, nv) derivative of the load by this joint's velocity [N m s/rad].
        stiffness: (N, nv) derivative of the load by this joint's position [N m/rad].
        unexplained: (N,) torque that the log shows and the stiff robot does not explain [N m]: what
            the deflection may account for. How the link moved when the log began is in no
            channel, and is chosen by it.
        band: filter along the first axis to the frequencies in which the torques are compared; it
            takes a log, or the beginning of one.
        rows: numbers of the samples that the filter returns.
        friction: dry friction of the link; None where there is none, or where it rubs at the motor.
    """

    step: float
    row: int
    load: FloatArray
    inertia: FloatArray
    damping: FloatArray
    stiffness: FloatArray
    unexplained: FloatArray
    band: Callable[[FloatArray], FloatArray]
    rows: IntArray
    friction: LinkFriction | None = None

    def beginning(self, seconds: float) -> LinkResponse:
        """Return the response along so much of the log."""
        count = int(seconds / self.step)
        if count >= len(self.unexplained):
            return self
        names = "load", "inertia", "damping", "stiffness", "unexplained"
        own = self.friction
        return replace(
            self,
            **{name: getattr(self, name)[:count] for name in names},
            rows=self.rows[self.rows < count - self.rows[0]],
            friction=None if own is None else LinkFriction(*(v[:count] for v in astuple(own))),
        )

    def torque(self, deflection: FloatArray) -> FloatArray:
        """Return the additional torque (N, nv) of a deflection (N, 3): d, its rate, its second.

        Where the link has dry friction, a fourth column is that.
        """
        result = np.asarray(
            self.stiffness * deflection[:, [0]]
            + self.damping * deflection[:, [1]]
            + self.inertia * deflection[:, [2]]
        )
        if self.friction is not None:
            result[:, self.row] += deflection[:, 3] - self.friction.counted
        return result

    def left(self, torques: FloatArray) -> FloatArray:
        """Return what additional torques (N, ...) at the joint leave unexplained, in the band."""
        size = (len(self.unexplained),) + (1,) * (np.ndim(torques) - 1)
        return self.band(self.unexplained.reshape(size) - torques)
