"""The law of a gear that winds up or has play: what it passes on between motor and link."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from wbc.arrays import FloatArray

Values = TypeVar("Values", float, FloatArray)


def rate_weights(
    stiffness: Values, damping: Values, step: float, late: Values, late_damping: Values
) -> tuple[Values, Values]:
    """Return what a touching flank's impulse over a time step owes to the rates of its ends.

    The one rule by which the plant and the links of a log step through the law of `Flanks`. With
    the deflection in the mean of the step, d + h (theta_k) ((1 - theta_k) v + theta_k v'), and the
    damper at the rate (1 - theta_c) v + theta_c v', the impulse on the link is

        -(h stiffness (d - s play / 2) + before v + after v')

    Args:
        stiffness: [N m/rad].
        damping: [N m s/rad].
        step: h [s].
        late: theta_k; 1/2 takes no energy out of a swing, 1 takes it out of one that is too quick.
        late_damping: theta_c; with 1 the damper never gives energy.

    Returns:
        before, after: [N m s^2/rad].
    """
    place = step * stiffness * late
    before = step * (damping * (1.0 - late_damping) + place * (1.0 - late))
    return before, step * (damping * late_damping + place * late)


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

    def energy(self, deflection: ArrayLike) -> FloatArray:
        """Return what is stored at deflections (...) of the link [J]; zero between the flanks."""
        bent = np.maximum(np.abs(np.asarray(deflection, dtype=float)) - 0.5 * self.play, 0.0)
        return np.asarray(0.5 * self.stiffness * bent**2)

    def scaled(self, stiffness: float, damping: float, play: float) -> Self:
        """Return the flanks with every number multiplied."""
        return type(self)(
            stiffness * self.stiffness, damping * self.damping, float(play * self.play)
        )
