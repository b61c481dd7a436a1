"""How an effect offers itself to a linear regression before its parameters are known."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.robot.motion import Motion


@dataclass(frozen=True, eq=False)
class LinkResponse:
    """How the link behind one gear reacts to a small deflection d of the gear, along a log.

    The link is at q = motor + d. The torque balance of the links, linear in d:

        inertia d_dd + damping d_d + stiffness d + load = torque the gears pass on

    With several soft gears the left side is the sum over their deflections.

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
        band: filter along the first axis to the frequencies in which the torques are compared.
    """

    step: float
    row: int
    load: FloatArray
    inertia: FloatArray
    damping: FloatArray
    stiffness: FloatArray
    unexplained: FloatArray
    band: Callable[[FloatArray], FloatArray]

    def torque(self, deflection: FloatArray) -> FloatArray:
        """Return the additional torque (N, nv) of a deflection (N, 3): d, its rate, its second."""
        return np.asarray(
            self.stiffness * deflection[:, [0]]
            + self.damping * deflection[:, [1]]
            + self.inertia * deflection[:, [2]]
        )

    def left(self, torques: FloatArray) -> FloatArray:
        """Return what additional torques (N, ...) at the joint leave unexplained, in the band."""
        size = (len(self.unexplained),) + (1,) * (np.ndim(torques) - 1)
        return self.band(self.unexplained.reshape(size) - torques)

    def torque_on(self, row: int, deflections: FloatArray) -> FloatArray:
        """Return what B deflections (N, 3, B) of this gear add to the torque at `row`, (N, B)."""
        columns = (self.stiffness, self.damping, self.inertia)
        terms = [c[:, [row]] * deflections[:, k] for k, c in enumerate(columns)]
        return np.asarray(terms[0] + terms[1] + terms[2])


@dataclass(frozen=True, eq=False)
class Evidence:
    """What is known about a set of logs when an effect proposes where to start.

    Attributes:
        motions: one per log, (N, ...) arrays.
        unexplained: one (N, nv) per log: measured minus modelled torque at the coordinates
            [N m, N], driven rows at the motor output.
        reported: one (N, m) per log: torque on the rotors that the drives report [N m].
        responses: joint name -> one link response per log.
    """

    motions: tuple[Motion, ...]
    unexplained: tuple[FloatArray, ...]
    reported: tuple[FloatArray, ...]
    responses: Callable[[str], tuple[LinkResponse, ...]]


@dataclass(frozen=True, eq=False)
class Screen:
    """One linear way in which an effect may explain a residual.

    The regression takes the change that each unit makes to the model's torque as a column, and
    hands the coefficients back: the parameters are `combine(coefficients)`.

    Attributes:
        units: parameter values of the r unit effects.
        combine: (r,) coefficients -> parameter values, possibly outside their bounds.
    """

    units: tuple[Mapping[str, float], ...]
    combine: Callable[[FloatArray], dict[str, float]]

    @classmethod
    def fixed(cls, values: Mapping[str, float]) -> Screen:
        """Return the screen of an effect that is not linear in any parameter.

        Its size is part of its shape: a coefficient far from one says that the shape is wrong.
        """
        chosen = dict(values)

        def combine(coefficients: FloatArray) -> dict[str, float]:
            fits = 0.4 < float(coefficients[0]) < 2.5
            return chosen if fits else dict.fromkeys(chosen, np.nan)

        return cls((chosen,), combine)
