"""The law of a gear that winds up or has play: what it passes on between motor and link."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from wbc.arrays import FloatArray


@dataclass(frozen=True)
class Flanks:
    """The flanks of a gear, between which it may have play.

    A gear without play is a spring with a damper, which pulls and pushes. With play the link is
    free between the flanks; where it touches one, that flank gives like a spring with a damper,
    and pushes only: it lets go of a link that its damper would hold back.

    Attributes:
        stiffness: [N m/rad].
        damping: [N m s/rad].
        play: whole free play [rad].
    """

    stiffness: float
    damping: float
    play: float = 0.0

    def torque(self, deflection: ArrayLike, rate: ArrayLike) -> FloatArray:
        """Return the torque on the link (...) [N m].

        With s the side on which the link touches and d its deflection:

            -(stiffness (d - s play / 2) + damping d_d), no larger than zero times s

        Args:
            deflection: of the link, ahead of its motor's output (...) [rad].
            rate: d_d (...) [rad/s].
        """
        d, v = np.asarray(deflection, dtype=float), np.asarray(rate, dtype=float)
        if self.play == 0.0:
            return np.asarray(-self.stiffness * d - self.damping * v)
        side = np.sign(d)
        pressed = side * (self.stiffness * (d - 0.5 * side * self.play) + self.damping * v)
        touching = np.abs(d) >= 0.5 * self.play
        return np.asarray(np.where(touching, -side * np.maximum(pressed, 0.0), 0.0))

    def scaled(self, stiffness: float, damping: float, play: float) -> Self:
        """Return the flanks with every number multiplied."""
        return type(self)(
            stiffness * self.stiffness, damping * self.damping, float(play * self.play)
        )
