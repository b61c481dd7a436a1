"""The flanks between which a gear has play, and how finely a link on them must be followed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from wbc.arrays import FloatArray

FINEST = 5e-4  # [s], at least
_SOFTEST = 1.0  # [N m/rad], for the small links of a wrist
_TURN = 0.25  # [rad] of the swing on a flank that one step may cover
COARSE = 2e-3  # [s], while contacts and beginnings are only ranked
_PLAY = 0.25  # of what flanks wind up by, below which they are a spring
START = 0.6  # [s] of the log by which the first positions and speeds of links are chosen


@dataclass(frozen=True)
class Contact:
    """The flanks of a gear.

    Attributes:
        stiffness: [N m/rad].
        damping: [N m s/rad].
        play: whole free play [rad].
    """

    stiffness: float
    damping: float
    play: float

    @classmethod
    def swinging(cls, inertia: float, frequency: float, damping: float, play: float = 0.0) -> Self:
        """Return flanks on which a link swings at a frequency.

        Args:
            inertia: of the link [kg m^2].
            frequency: [Hz].
            damping: as a share of the critical one.
            play: [rad].
        """
        rate = 2.0 * np.pi * frequency
        stiffness = max(inertia * rate**2, _SOFTEST)
        return cls(float(stiffness), float(2.0 * damping * inertia * rate), play)

    def plays(self, load: float) -> bool:
        """Whether the play counts beside what the flanks wind up by under a load [N m]."""
        return self.play * self.stiffness > _PLAY * load

    def scaled(self, stiffness: float, damping: float, play: float) -> Contact:
        """Return the contact with every number multiplied."""
        factors = zip(
            (stiffness, damping, play), (self.stiffness, self.damping, self.play), strict=True
        )
        return Contact(*(float(factor * value) for factor, value in factors))


def steps_per_sample(step: float, stiffness: float, inertia: float, finest: float) -> int:
    """Return into how many steps (a power of two) a sample is cut for a flank to be drawn."""
    most = max(1.0, step / finest)
    wanted = step * np.sqrt(stiffness / inertia) / _TURN
    return int(2 ** np.ceil(np.log2(np.clip(wanted, 1.0, most))))


def weight_of_the_end(stiffness: FloatArray, inertia: float, step: float) -> FloatArray:
    """Return theta of the step: 1/2 takes no energy out, 1 damps a flank too stiff to draw."""
    return np.where(stiffness * step**2 < inertia, 0.5, 1.0)
