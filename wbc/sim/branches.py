"""The linear piece of every row's law that a point lies on, and the system of those pieces.

The rows are few: plain floats beat arrays of so few entries several times.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from wbc.arrays import FloatArray
from wbc.sim.reduced import Reduced


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
    """One linear piece, on_speed w + on_impulse p = constant, of every row's law.

    Attributes:
        on_speed: (r,).
        on_impulse: (r,), zero where a row is rigid.
        constant: (r,).
        distance: natural residual (r,) of every row at the point the pieces were looked up for,
            as a speed; zero exactly at a solution. The line of slope `reduced.slope` through
            (speed, impulse) meets a monotone law in one point, and this is how far away it is; for
            contacts it is Alart and Curnier's map, the normal projected onto the half line, the
            tangents onto the disc of radius mu p_n.
        worst: its largest size.
        sliding: the contacts that slide; their rows lack the coupling to normal and slip.
    """

    on_speed: FloatArray
    on_impulse: FloatArray
    constant: FloatArray
    distance: FloatArray
    worst: float
    sliding: tuple[Sliding, ...]


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
            pieces.append((1.0, 0.0, targets[i], (push - impulses[row]) / slopes[row]))
        else:
            pieces.append((0.0, 1.0, 0.0, -impulses[row] / slopes[row]))
        pressed.append(push)
    sliding = []
    d, friction = reduced.tangents, reduced.frictions
    for contact in range(reduced.contacts if d else 0):
        first = m + count + contact * d
        bound = friction[contact] * max(pressed[reduced.limits + contact], 0.0)
        closed = pressed[reduced.limits + contact] > 0.0
        wish = [impulses[j] - slopes[j] * speeds[j] for j in range(first, first + d)]
        size = abs(wish[0]) if d == 1 else (wish[0] ** 2 + wish[1] ** 2) ** 0.5
        share = bound / size if size > 0.0 else 1.0
        slides = closed and size >= bound
        kept = share if size > bound else 1.0
        piece = (1.0, 0.0, 0.0) if closed and not slides else (0.0, 1.0, 0.0)
        for j, part in zip(range(first, first + d), wish, strict=True):
            pieces.append((*piece, (kept * part - impulses[j]) / slopes[j]))
        if slides:
            direction = np.array(wish) / (size or 1.0)
            sliding.append(Sliding(contact, direction, share))
    on_speed, on_impulse, constant, distance = np.array(pieces).reshape(-1, 4).T
    worst = max([abs(piece[3]) for piece in pieces], default=0.0)
    return Branches(on_speed, on_impulse, constant, distance, worst, tuple(sliding))


def _element_piece(law: tuple[float, ...], T: float, w: float) -> tuple[float, float, float, float]:
    """Return s, b, c of the piece s w + b T = c of an element's law, and the distance from it."""
    up, down, inertia, inverse, backward, friction, damping, slope = law
    point = T - slope * w
    load = point + friction
    if up > max(load * inverse, load * backward):
        driving = inertia * load + (damping + slope) * up > 0.0
        gain = inverse if driving else backward
        met = (up - gain * load) / (inertia + gain * (damping + slope))
        return inertia + gain * damping, gain, up - gain * friction, met - w
    load = point - friction
    if down < min(load * inverse, load * backward):
        driving = -inertia * load - (damping + slope) * down > 0.0
        gain = inverse if driving else backward
        met = (down - gain * load) / (inertia + gain * (damping + slope))
        return inertia + gain * damping, gain, down + gain * friction, met - w
    return 1.0, 0.0, 0.0, -w


def solve_branches(reduced: Reduced, branches: Branches, anchor: FloatArray) -> FloatArray | None:
    """Return the row impulses (r,) that solve the linear pieces of `branches`.

    Rows that depend on each other (more stuck gears and sticking contacts than the robot has
    freedoms) leave their split open; what is left open stays near `anchor` (r,), by a proximal
    term whose effect on the rest a second solve with the same factors removes. None where the
    pieces contradict each other.
    """
    on_speed = branches.on_speed
    spring = 1e-9 * reduced.diagonal * on_speed
    total = np.asfortranarray(on_speed[:, None] * reduced.delassus)
    total.T.ravel()[:: len(total) + 1] += branches.on_impulse + spring
    right = branches.constant - on_speed * reduced.free
    if branches.sliding:
        _add_sliding(reduced, branches, total, right)
    factor, pivots, info = lapack.dgetrf(total, overwrite_a=1)
    if info != 0:
        return None
    solution, _ = lapack.dgetrs(factor, pivots, right + spring * anchor)
    correction, _ = lapack.dgetrs(factor, pivots, spring * (solution - anchor))
    return np.asarray(solution + correction)


def _add_sliding(
    reduced: Reduced, branches: Branches, total: FloatArray, right: FloatArray
) -> None:
    """Add p_t = mu p_n direction, and how the direction turns with the slip, in place."""
    d, first = reduced.tangents, reduced.tangent_rows.start
    normals = reduced.elements + reduced.limits
    for slide in branches.sliding:
        rows = slice(first + slide.contact * d, first + (slide.contact + 1) * d)
        direction = slide.direction
        total[rows, normals + slide.contact] -= reduced.frictions[slide.contact] * direction
        if d == 2:
            turn = slide.turning * (np.eye(2) - direction[:, None] * direction)
            total[rows, rows] -= turn
            turn *= reduced.slope[rows.start]
            total[rows] += turn @ reduced.delassus[rows]
            right[rows] -= turn @ reduced.free[rows]
