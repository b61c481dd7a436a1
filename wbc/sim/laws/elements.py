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
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.arrays import BoolArray, FloatArray


@dataclass(frozen=True, eq=False, slots=True)
class Elements:
    """Rows of a step with a dissipative law; every array has one entry per row.

    Attributes:
        rows: W (m, n), w = W v (+ compliance T + offset).
        up: impulse the rotor brings along when it ends up turning forward [N m s].
        down: the same when it ends up turning backward; up <= down in a step with time.
        inertia: M >= 0 [kg m^2].
        forward: eta_f.
        backward: eta_b; zero or less is self-locking.
        friction: f >= 0, dry friction impulse at the output [N m s].
        damping: B >= 0, viscous impulse per speed at the output [kg m^2].
        compliance: c >= 0, speed per impulse of a spring in series [1/(kg m^2)].
        offset: speed that the spring's present deflection adds [rad/s].
    """

    rows: FloatArray
    up: FloatArray
    down: FloatArray
    inertia: FloatArray
    forward: FloatArray
    backward: FloatArray
    friction: FloatArray
    damping: FloatArray
    compliance: FloatArray
    offset: FloatArray

    @property
    def size(self) -> int:
        """m, the number of rows."""
        return len(self.up)


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
