"""The law of a dissipative element as a convex, piecewise quadratic cost of its speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.sim.laws.elements import Elements


@dataclass(frozen=True, slots=True)
class CostPiece:
    """One quadratic piece of psi(w), for the share of |w| that lies in it.

    Attributes:
        element: whose law.
        sign: +1 turning forward, -1 backward.
        length: [rad/s], infinite for the last one.
        level: slope of psi where the piece begins [N m s].
        curvature: of psi along it [kg m^2].
    """

    element: int
    sign: float
    length: float
    level: float
    curvature: float


def cost_pieces(elements: Elements) -> list[CostPiece] | None:
    """Return the pieces of all psi_i; None where one is not convex (a self-locking gear).

    The mesh input per output k is 1/eta_f up to the speed at which the rotor has given what it
    brings, and eta_b beyond. A gear with eta_b = 0 is not driven beyond that speed at all.
    """
    if elements.size and elements.backward.min() < 0.0:
        return None
    result = []
    for i in range(elements.size):
        for sign, bring in ((1.0, elements.up[i]), (-1.0, -elements.down[i])):
            result += _pieces(elements, i, sign, float(bring))
    return result


def _pieces(elements: Elements, i: int, sign: float, bring: float) -> list[CostPiece]:
    """Return the pieces along one direction, as for turning forward with `bring`."""
    inertia, forward = float(elements.inertia[i]), 1.0 / float(elements.forward[i])
    backward, damping = float(elements.backward[i]), float(elements.damping[i])
    if bring > 0.0:
        length = bring / inertia if inertia > 0.0 else np.inf
        branches = [(length, bring, forward), (np.inf, 0.0, backward)]
    else:
        branches = [(np.inf, bring, backward)]
    result, passed = [], 0.0
    for length, rest, gain in branches:
        if gain <= 0.0 or not np.isfinite(passed):
            break
        level = -rest / gain + float(elements.friction[i]) + damping * passed
        result.append(CostPiece(i, sign, length, level, inertia / gain + damping))
        passed += length
    return result
