"""Steps with self-locking gears (eta_b < 0): one solution, none or several, decided by solving.

A self-locking gear that turns against its rotor's momentum b has a tent for a law. Along its
direction, with T the impulse on the links and w the speed:

    high    T >= 0                  the motor drives: like any gear
    fall    -b/|eta_b| <= T <= 0    M w = b + |eta_b| T: the harder it is driven back, the slower
    low     T <= -b/|eta_b|         w = 0: locked

Where Lambda + diag(eta_b / M) is positive definite, Lambda being the compliance of the falling rows
with all other rows held, the whole step is strictly monotone and has one solution. Otherwise each
of these gears is held to one of the three ranges at a time: `high` and `low` are monotone laws,
`fall` is a line that is eliminated. What solves the rest and lies in its ranges solves the step.

A spring in series adds its compliance 1/s to Lambda's diagonal. With 1/s > |eta_b| / M the sum is
positive definite whatever Lambda is: gears that yield that much have one solution in every step.
Row i is written times hold = s Lambda_ii / (1 + s Lambda_ii), which no weak spring makes large.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.errors import SimulationError
from wbc.sim.laws.elements import Elements, falling_rows
from wbc.sim.solve.newton import newton
from wbc.sim.solve.proximal import proximal
from wbc.sim.solve.reduced import IN_IMPULSES, Reduced, row_laws

_SLOWEST = 1e-9
"""[rad/s] below which two solutions count as one."""

_MOST = 6
"""Gears tried in all ranges: 3^6 solves take about a tenth of a second."""

_HIGH, _FALL, _LOW = range(3)


def undecided_rows(reduced: Reduced) -> IntArray:
    """Return the falling rows (f,) if the step may have several solutions; none where it has one.

    Any other row may be rigid in another solution (a gear that sticks, a point that holds), and a
    rigid row lowers Lambda most: they are all taken out of it.
    """
    rows = np.flatnonzero(falling_rows(reduced.program.elements, _SLOWEST))
    if rows.size == 0:
        return rows
    elements = reduced.program.elements
    rest = np.setdiff1d(np.arange(len(reduced.free)), rows)
    hold = np.ones(len(reduced.free))
    hold[: reduced.elements] = _hold(reduced)
    scaled = np.sqrt(hold)
    yielding = scaled[:, None] * reduced.delassus * scaled
    yielding[np.diag_indices(len(hold))] += (1.0 - hold) * reduced.diagonal
    own = yielding[np.ix_(rows, rows)]
    cross = yielding[np.ix_(rows, rest)]
    held = yielding[np.ix_(rest, rest)]
    own = own - cross @ np.linalg.pinv(held, hermitian=True, rcond=1e-10) @ cross.T
    falling = hold[rows] * elements.backward[rows] / elements.inertia[rows]
    margin = np.linalg.eigvalsh(own + np.diag(falling))
    return rows if margin[0] <= 0.0 else rows[:0]


def _hold(reduced: Reduced) -> FloatArray:
    """Return s Lambda_ii / (1 + s Lambda_ii) (m,) of the elements: 1 where there is no spring."""
    stiffness = reduced.program.elements.stiffness
    soft = np.isfinite(stiffness)
    ratio = np.where(soft, stiffness, 0.0) * reduced.diagonal[: reduced.elements]
    return np.where(soft, ratio / (1.0 + ratio), 1.0)


def solve_in_ranges(
    reduced: Reduced,
    rows: IntArray,
    start: FloatArray,
    tolerance: float,
    names: Sequence[str],
) -> tuple[FloatArray, int]:
    """Return the row impulses of the one solution, and the number of linear systems solved.

    Args:
        reduced: the step.
        rows: (f,) its falling rows.
        start: row impulses (r,) to start from.
        tolerance: largest distance of a row from its law.
        names: of the dissipative rows; may be shorter.

    Raises:
        SimulationError: no solution, several, or too many gears to try.
    """
    called = ", ".join(f"'{names[i]}'" if i < len(names) else f"row {i}" for i in rows.tolist())
    if len(rows) > _MOST:
        raise SimulationError(
            f"{len(rows)} self-locking gears ({called}) turn at once against rotors so light that "
            f"their steps may have several solutions; no more than {_MOST} are tried. Give them "
            "more rotor inertia or backward efficiencies nearer to zero."
        )
    found: list[FloatArray] = []
    used, apart = 0, 1e4 * tolerance
    for ranges in product((_HIGH, _FALL, _LOW), repeat=len(rows)):
        for impulse, count in _candidates(reduced, rows, np.array(ranges), start, tolerance):
            used += count
            if reduced.distance(impulse) > tolerance:
                continue
            velocity = reduced.velocity(impulse)
            if all(np.abs(velocity - reduced.velocity(p)).max() > apart for p in found):
                found.append(impulse)
    if len(found) == 1:
        return found[0], used
    several = f"{len(found)} solutions" if found else "no solution that could be found"
    e = reduced.program.elements
    yields = float((e.inertia[rows] / -e.backward[rows]).min())
    raise SimulationError(
        f"the step has {several} with the self-locking gears {called}: they turn against rotors "
        "too light for what their gears lock. Let the gears yield, as real teeth do (`stiffness`): "
        f"with stiffness dt^2 / 4 + damping dt below {yields:.3g} kg m^2 every step has one "
        "solution. Or give them more rotor inertia, or backward efficiencies nearer to zero."
    )


def _candidates(
    reduced: Reduced, rows: IntArray, ranges: IntArray, start: FloatArray, tolerance: float
) -> list[tuple[FloatArray, int]]:
    """Return row impulses (r,) with the falling rows held to their ranges, and the work."""
    inner, fixed, kept = _held_to(reduced, rows, ranges)
    result = []
    for origin in (start[kept], np.zeros(len(kept))):
        part, used, done = newton(inner, origin, 0.1 * tolerance, 8)
        if not done:
            part, count, done = proximal(inner, origin, 0.1 * tolerance)
            used += count
        if not done:
            continue
        impulse = np.zeros(len(reduced.free))
        impulse[kept] = part
        if len(fixed):
            impulse[fixed] = _on_the_line(reduced, fixed, kept, part)
        result.append((impulse, used))
        if not start[kept].any():
            break
    return result


def _lines(reduced: Reduced, fixed: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return L (f, f), hold (f,) and right (f,) of the `fixed` rows on their falling lines.

    On its line a row obeys M w + eta_b (T + s f + B w) = b, s the direction, and its spring carries
    T = p + stiffness (w - u). With w eliminated, and times hold: L T = right - hold u', where u' is
    the speed u that the other rows leave it.
    """
    e: Elements = reduced.program.elements
    forward = e.up[fixed] > 0.0
    brought = np.where(forward, e.up[fixed], e.down[fixed])
    rub = np.where(forward, e.friction[fixed], -e.friction[fixed])
    total = e.inertia[fixed] + e.backward[fixed] * e.damping[fixed]
    slope, offset = e.backward[fixed] / total, (brought - e.backward[fixed] * rub) / total
    hold = _hold(reduced)[fixed]
    yields = (1.0 - hold) * reduced.diagonal[fixed]
    lines = hold[:, None] * reduced.delassus[np.ix_(fixed, fixed)]
    return lines + np.diag(yields + hold * slope), hold, hold * offset + yields * e.preload[fixed]


def _on_the_line(reduced: Reduced, fixed: IntArray, kept: IntArray, part: FloatArray) -> FloatArray:
    """Return T (f,) of the rows on their lines, for the impulses `part` of the others."""
    lines, hold, right = _lines(reduced, fixed)
    free = reduced.free[fixed] + reduced.delassus[np.ix_(fixed, kept)] @ part
    return np.asarray(np.linalg.lstsq(lines, right - hold * free, rcond=None)[0])


def _held_to(
    reduced: Reduced, rows: IntArray, ranges: IntArray
) -> tuple[Reduced, IntArray, IntArray]:
    """Return the step of the remaining rows, the rows on their lines, and those that remain."""
    e = reduced.program.elements
    high, low, fixed = (rows[ranges == kind] for kind in (_HIGH, _LOW, _FALL))
    backward, up, down = e.backward.copy(), e.up.copy(), e.down.copy()
    backward[high] = backward[low] = 0.0
    up[low], down[low] = -np.inf, np.inf
    kept = np.setdiff1d(np.arange(len(reduced.free)), fixed)
    own = kept[kept < reduced.elements]
    changed = replace(e, backward=backward, up=up, down=down)
    elements = Elements(*(getattr(changed, name)[own] for name in Elements.__slots__))
    delassus, free = reduced.delassus[np.ix_(kept, kept)], reduced.free[kept]
    if len(fixed):
        lines, hold, right = _lines(reduced, fixed)
        cross = reduced.delassus[np.ix_(fixed, kept)]
        both = np.column_stack((hold[:, None] * cross, hold * reduced.free[fixed] - right))
        through = np.linalg.lstsq(lines, both, rcond=None)[0]
        delassus = delassus - cross.T @ through[:, :-1]
        free = free - cross.T @ through[:, -1]
    slope = reduced.slope.copy()
    inner = replace(
        reduced,
        program=replace(reduced.program, elements=elements),
        response=reduced.response[:, kept],
        delassus=np.ascontiguousarray(delassus),
        free=free,
        diagonal=reduced.diagonal[kept],
        spring=reduced.spring[kept],
        slope=slope[kept],
        laws=row_laws(elements),
        elements=len(own),
        ways=IN_IMPULSES,
    )
    return inner, fixed, kept
