"""The linear piece of every row's law that a point lies on, and the system of those pieces.

The rows are few: plain floats beat arrays of so few entries several times.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from wbc.arrays import FloatArray
from wbc.sim.solve.reduced import Reduced


@dataclass(frozen=True, eq=False, slots=True)
class Sliding:
    """A closed contact that slides.

    Attributes:
        contact: its index.
        direction: (d,) in which its friction pushes.
        turning: mu p_n / |p_t - slope u_t| <= 1, how far the direction may turn (d = 2).
    """

    contact: int
    direction: FloatArray
    turning: float


@dataclass(frozen=True, eq=False, slots=True)
class Branches:
    """One linear piece, on_speed dw + on_impulse dp = missing, of every row's law about a point.

    Attributes:
        pieces: (on_speed, on_impulse, missing, distance) of every row. on_impulse is zero where
            the row is rigid. The distance is the natural residual of the point as a speed, zero
            exactly at a solution: the line of slope `reduced.slope` through (speed, impulse) meets
            a monotone law in one point, and this is how far away it is; for contacts it is Alart
            and Curnier's map, the normal projected onto the half line, the tangents onto the disc
            of radius mu p_n.
        worst: the largest distance.
        sliding: the contacts that slide; their rows lack the coupling to normal and slip.
    """

    pieces: list[tuple[float, float, float, float]]
    worst: float
    sliding: list[Sliding]

    @property
    def on_impulse(self) -> FloatArray:
        """(r,), zero where a row is rigid."""
        return np.array([piece[1] for piece in self.pieces])

    @property
    def distance(self) -> FloatArray:
        """Natural residual (r,) of every row, as a speed."""
        return np.array([piece[3] for piece in self.pieces])

    @property
    def merit(self) -> float:
        """Sum of the squared distances."""
        return sum([piece[3] * piece[3] for piece in self.pieces])


def branches_at(reduced: Reduced, impulse: FloatArray, speed: FloatArray) -> Branches:
    """Return the pieces met by the lines of slope `reduced.slope` through (speed, impulse)."""
    pieces: list[tuple[float, float, float, float]] = []
    impulses, speeds = impulse.tolist(), speed.tolist()
    for law, T, w in zip(reduced.laws, impulses, speeds, strict=False):
        pieces.append(_element_piece(law, T, w))
    m, count = reduced.elements, reduced.limits + reduced.contacts
    slopes, targets = reduced.slopes, reduced.targets
    pressed = []
    for i in range(count):
        row = m + i
        push = impulses[row] - slopes[row] * (speeds[row] - targets[i])
        if push > 0.0:
            short = targets[i] - speeds[row]
            pieces.append((1.0, 0.0, short, short))
        else:
            pieces.append((0.0, 1.0, -impulses[row], -impulses[row] / slopes[row]))
        pressed.append(push)
    sliding = []
    d, friction = reduced.tangents, reduced.frictions
    for contact in range(reduced.contacts if d else 0):
        first = m + count + contact * d
        bound = friction[contact] * max(pressed[reduced.limits + contact], 0.0)
        closed = pressed[reduced.limits + contact] > 0.0
        wish = [impulses[j] - slopes[j] * speeds[j] for j in range(first, first + d)]
        # Far from a solution Newton's points may be huge: hypot does not overflow before they do.
        size = math.hypot(*wish)
        if closed and size < bound:
            pieces += [(1.0, 0.0, -speeds[j], -speeds[j]) for j in range(first, first + d)]
            continue
        share = bound / size if size > 0.0 else 1.0
        for j, part in zip(range(first, first + d), wish, strict=True):
            short = share * part - impulses[j]
            pieces.append((0.0, 1.0, short, short / slopes[j]))
        if closed:
            direction = np.array(wish) / (size or 1.0)
            sliding.append(Sliding(contact, direction, share))
    worst = max([abs(piece[3]) for piece in pieces], default=0.0)
    return Branches(pieces, worst, sliding)


def _element_piece(law: tuple[float, ...], T: float, w: float) -> tuple[float, float, float, float]:
    """Return on_speed, on_impulse, missing and distance of the piece of an element's law."""
    up, down, inertia, inverse, backward, friction, damping, slope = law
    point = T - slope * w
    load = point + friction
    if up > max(load * inverse, load * backward):
        driving = inertia * load + (damping + slope) * up > 0.0
        sign, bring = 1.0, up
    else:
        load = point - friction
        if not down < min(load * inverse, load * backward):
            return 1.0, 0.0, -w, -w
        driving = -inertia * load - (damping + slope) * down > 0.0
        sign, bring = -1.0, down
    gain = inverse if driving else backward
    on_speed = inertia + gain * damping
    missing = bring - gain * (T + sign * friction) - on_speed * w
    return on_speed, gain, missing, missing / (on_speed + gain * slope)


def solve_branches(reduced: Reduced, branches: Branches, impulse: FloatArray) -> FloatArray | None:
    """Return the row impulses (r,) that solve the linear pieces of `branches`.

    Rows that depend on each other (more stuck gears and sticking contacts than the robot has
    freedoms) leave their split open; what is left open stays near `impulse` (r,), the point of the
    branches, by a proximal term whose effect on the rest a second solve with the same factors
    removes. None where the pieces contradict each other.
    """
    on_speed, on_impulse, missing, _ = np.array(branches.pieces).T
    spring = reduced.spring * on_speed
    total = reduced.delassus * on_speed[:, None]
    total.ravel()[:: len(total) + 1] += on_impulse + spring
    if branches.sliding:
        _add_sliding(reduced, branches, total, missing, impulse)
    factor, pivots, info = lapack.dgetrf(total)
    if info != 0:
        return None
    change, _ = lapack.dgetrs(factor, pivots, missing)
    correction, _ = lapack.dgetrs(factor, pivots, spring * change)
    return np.asarray(impulse + change + correction)


def _add_sliding(
    reduced: Reduced,
    branches: Branches,
    total: FloatArray,
    missing: FloatArray,
    impulse: FloatArray,
) -> None:
    """Add p_t = mu p_n direction, and how the direction turns with the slip, in place.

    What the rows miss was taken at the bound mu times the *projected* normal impulse; the piece is
    linear in the present one.
    """
    d, first = reduced.tangents, reduced.tangent_rows.start
    normals = reduced.elements + reduced.limits
    for slide in branches.sliding:
        rows = slice(first + slide.contact * d, first + (slide.contact + 1) * d)
        normal, direction = normals + slide.contact, slide.direction
        along = reduced.frictions[slide.contact] * direction
        total[rows, normal] -= along
        missing[rows] = along * impulse[normal] - impulse[rows]
        if d == 2:
            turn = slide.turning * (np.eye(2) - direction[:, None] * direction)
            total[rows, rows] -= turn
            total[rows] += (reduced.slopes[rows.start] * turn) @ reduced.delassus[rows]
