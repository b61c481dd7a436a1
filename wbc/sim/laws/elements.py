"""The law of a dissipative element inside one time step: gear, dry friction, or both in one row.

Over a step a row with speed w after the step carries an impulse T (on the links, along the row).
With the mesh input t = T_mesh-side impulse of the rotor, s = sgn(w) and the gear's share
T_g = T + s f + B w of the impulse:

    w > 0:  M w + k T_g = up        k = 1/eta_f where s T_g > 0 (motor drives), eta_b otherwise
    w < 0:  M w + k T_g = down
    w = 0:  T anywhere between the two branches

M is the reflected rotor inertia (plus the step's viscous share), up and down the impulse that the
rotor brings along: motor impulse plus M w_before, less or plus the rotor's Coulomb impulse. For
eta_f eta_b <= 1 the graph T(w) is non-increasing: a step is a convex program. Friction of a joint
alone is the same law with M = up = down = 0 and both efficiencies one.

A spring in series, T = p + s (w - W v), leaves a law of the same kind between T and u = W v. With
s = 0 it is T = p: it is written so that a spring that hardly changes its impulse (a short step, a
flank that is only just reached) is as regular as a stiff one. A compliance 1/s is not: rounding of
T then moves w, and the scale of one row hides what all others miss.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.arrays import BoolArray, FloatArray


@dataclass(frozen=True, eq=False, slots=True)
class Elements:
    """Rows of a step with a dissipative law; every array has one entry per row.

    Attributes:
        rows: W (m, n); w = W v where there is no spring.
        up: impulse the rotor brings along when it ends up turning forward [N m s].
        down: the same when it ends up turning backward; up <= down in a step with time.
        inertia: M >= 0 [kg m^2].
        forward: eta_f.
        backward: eta_b; zero or less is self-locking.
        friction: f >= 0, dry friction impulse at the output [N m s].
        damping: B >= 0, viscous impulse per speed at the output [kg m^2].
        stiffness: s >= 0, impulse per speed of a spring in series [kg m^2]; infinite for none.
        preload: p, what that spring passes without relative speed [N m s].
    """

    rows: FloatArray
    up: FloatArray
    down: FloatArray
    inertia: FloatArray
    forward: FloatArray
    backward: FloatArray
    friction: FloatArray
    damping: FloatArray
    stiffness: FloatArray
    preload: FloatArray

    @property
    def size(self) -> int:
        """m, the number of rows."""
        return len(self.up)

    def through_springs(
        self, point: FloatArray, slope: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the line T - slope u = point (m,) in w for u: its point and slope (m,)."""
        soft = np.isfinite(self.stiffness)
        stiffness = np.where(soft, self.stiffness, 1.0)
        hold = np.where(soft, stiffness / (stiffness + slope), 1.0)
        return hold * point + (1.0 - hold) * self.preload, hold * slope

    def own_speeds(self, impulse: FloatArray, speed: FloatArray, slope: FloatArray) -> FloatArray:
        """Return w (m,) of rows that carry `impulse` (m,) at the speeds u = W v (m,).

        It follows from the law, not from the spring, whose impulse may hardly depend on it.

        Args:
            impulse: T.
            speed: u.
            slope: (m,) of the lines on which the rows meet their laws.
        """
        soft = np.isfinite(self.stiffness)
        if not soft.any():
            return speed
        point, slope = self.through_springs(impulse - slope * speed, slope)
        found = meeting_speed(self, modes_at(self, point, slope), point, slope)
        return np.where(soft, found, speed)


@dataclass(frozen=True, eq=False, slots=True)
class Modes:
    """Where on its law each element sits.

    Attributes:
        sign: (m,) +1 turning forward, -1 backward, 0 stuck.
        gain: (m,) k, the mesh input per mesh output of the branch.
        bring: (m,) up or down, whichever branch it is; zero where stuck.
    """

    sign: FloatArray
    gain: FloatArray
    bring: FloatArray


def modes_at(elements: Elements, point: FloatArray, slope: FloatArray) -> Modes:
    """Return the branch on which the law meets the line T - slope w = point.

    Args:
        elements: the laws.
        point: (m,) [N m s].
        slope: (m,) >= 0 [kg m^2]; below M/|eta_b| for a self-locking row, so that the line meets
            the law once.
    """
    inverse = 1.0 / elements.forward
    plus, minus = point + elements.friction, point - elements.friction
    needed_up = np.maximum(plus * inverse, plus * elements.backward)
    needed_down = np.minimum(minus * inverse, minus * elements.backward)
    sign = np.subtract(elements.up > needed_up, elements.down < needed_down, dtype=np.float64)
    bring = np.where(sign > 0.0, elements.up, np.where(sign < 0.0, elements.down, 0.0))
    drive = elements.inertia * (sign * point + elements.friction)
    drive += (elements.damping + slope) * (sign * bring)
    return Modes(sign, np.where(drive > 0.0, inverse, elements.backward), bring)


def meeting_speed(
    elements: Elements, modes: Modes, point: FloatArray, slope: FloatArray
) -> FloatArray:
    """Return w (m,) at which the branches of `modes` meet the line T - slope w = point."""
    load = point + modes.sign * elements.friction
    total = elements.inertia + modes.gain * (elements.damping + slope)
    moving = modes.sign != 0.0
    speed = (modes.bring - modes.gain * load) / np.where(moving, total, 1.0)
    return np.asarray(np.where(moving, speed, 0.0))


def falling_rows(elements: Elements, slowest: float) -> BoolArray:
    """Return which rows have a falling branch (eta_b < 0) that reaches beyond `slowest`, (m,).

    The branch of a gear that brings the impulse up runs from w = up/M down to rest.
    """
    brought = np.maximum(elements.up, -elements.down)
    return np.asarray((elements.backward < 0.0) & (brought > slowest * elements.inertia))
