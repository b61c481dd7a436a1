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
Where the ranges of the step before still hold, the motion goes on there. Otherwise all are tried,
and of several solutions the one is taken whose gears carry most nearly what they did. Without a
step before, several solutions are refused.

A spring in series adds its compliance 1/s to Lambda's diagonal. With 1/s > |eta_b| / M the sum is
positive definite whatever Lambda is: gears that yield that much have one solution in every step.
Row i is written times hold = s Lambda_ii / (1 + s Lambda_ii), which no weak spring makes large.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.errors import SimulationError
from wbc.mechanics.newton import FULL_STEPS, SHORTENED, distance, newton, proximal
from wbc.mechanics.rows import RowSystem

_SLOWEST = 1e-9
"""[rad/s] below which two solutions count as one."""

_MOST = 6
"""Gears tried in all ranges: 3^6 solves take about a tenth of a second."""

_SYSTEMS = 300  # linear systems of proximal rounds for one choice of ranges
_HIGH, _FALL, _LOW = range(3)
_NAMES = "driving", "driven back", "locked"
_UP, _DOWN, _INERTIA, _BACKWARD, _FRICTION, _DAMPING, _STIFFNESS, _PRELOAD = 0, 1, 2, 4, 5, 6, 7, 8


def falling_rows(laws: FloatArray) -> BoolArray:
    """Return which rows (m,) have a falling branch (eta_b < 0).

    The branch of a gear that brings the impulse up runs from w = up/M down to rest.
    """
    brought = np.maximum(laws[:, _UP], -laws[:, _DOWN])
    return np.asarray((laws[:, _BACKWARD] < 0.0) & (brought > _SLOWEST * laws[:, _INERTIA]))


def undecided_rows(system: RowSystem) -> IntArray:
    """Return the falling rows (f,) if the step may have several solutions; none where it has one.

    Any other row may be rigid in another solution (a gear that sticks, a point that holds), and a
    rigid row lowers Lambda most: they are all taken out of it.
    """
    laws = system.laws
    rows = np.flatnonzero(falling_rows(laws))
    rest = np.setdiff1d(np.arange(len(system.free)), rows)
    hold = np.ones(len(system.free))
    hold[: len(laws)] = _hold(system)
    scaled = np.sqrt(hold)
    yielding = scaled[:, None] * system.delassus * scaled
    yielding[np.diag_indices(len(hold))] += (1.0 - hold) * _diagonal(system)
    own = yielding[np.ix_(rows, rows)]
    cross = yielding[np.ix_(rows, rest)]
    held = yielding[np.ix_(rest, rest)]
    own = own - cross @ np.linalg.pinv(held, hermitian=True, rcond=1e-10) @ cross.T
    falling = hold[rows] * laws[rows, _BACKWARD] / laws[rows, _INERTIA]
    margin = np.linalg.eigvalsh(own + np.diag(falling))
    return rows if margin[0] <= 0.0 else rows[:0]


def _diagonal(system: RowSystem) -> FloatArray:
    """Return the compliance (r,) of each row, made positive where a row moves nothing."""
    return np.asarray(1e9 * system.spring)


def _hold(system: RowSystem) -> FloatArray:
    """Return s Lambda_ii / (1 + s Lambda_ii) (m,) of the elements: 1 where there is no spring."""
    stiffness = system.laws[:, _STIFFNESS]
    soft = np.isfinite(stiffness)
    ratio = np.where(soft, stiffness, 0.0) * _diagonal(system)[: len(stiffness)]
    return np.where(soft, ratio / (1.0 + ratio), 1.0)


def solve_in_ranges(
    system: RowSystem, rows: IntArray, start: FloatArray, tolerance: float, names: Sequence[str]
) -> tuple[FloatArray, int]:
    """Return row impulses (r,) that solve the step, and the number of linear systems solved.

    Args:
        system: of the step.
        rows: (f,) its falling rows.
        start: row impulses (r,) of the step before, zeros for none.
        tolerance: largest distance of a row from its law.
        names: of the dissipative rows; may be shorter.

    Raises:
        SimulationError: no solution, several without a step before, or too many gears to try.
    """
    called = ", ".join(f"'{names[i]}'" if i < len(names) else f"row {i}" for i in rows.tolist())
    used, before = 0, _ranges_of(system, rows, start)
    if start.any():
        for impulse, count in _candidates(system, rows, before, start, tolerance):
            used += count
            same = np.array_equal(_ranges_of(system, rows, impulse), before)
            if same and distance(system, impulse) <= tolerance:
                return impulse, used
    if len(rows) > _MOST:
        raise SimulationError(
            f"{len(rows)} self-locking gears ({called}) turn at once against rotors so light that "
            f"their steps may have several solutions; no more than {_MOST} are tried. Give them "
            "more rotor inertia or backward efficiencies nearer to zero."
        )
    found: list[tuple[FloatArray, FloatArray]] = []
    apart = 1e4 * tolerance
    for ranges in product((_HIGH, _FALL, _LOW), repeat=len(rows)):
        for impulse, count in _candidates(system, rows, np.array(ranges), start, tolerance):
            used += count
            if distance(system, impulse) > tolerance:
                continue
            speed = system.delassus @ impulse
            if all(np.abs(speed - other).max() > apart for _, other in found):
                found.append((impulse, speed))
    if found and (len(found) == 1 or start.any()):
        moved = [np.abs(impulse[rows] - start[rows]).max() for impulse, _ in found]
        return found[int(np.argmin(moved))][0], used
    several = "no solution that could be found"
    if found:
        ways = [_ranges_of(system, rows, impulse) for impulse, _ in found]
        told = "; ".join(", ".join(_NAMES[i] for i in way.tolist()) for way in ways)
        several = f"{len(found)} solutions"
        called = f"{called} ({told})"
    yields = float((system.laws[rows, _INERTIA] / -system.laws[rows, _BACKWARD]).min())
    raise SimulationError(
        f"the step has {several} with the self-locking gears {called}: they turn against rotors "
        "too light for what their gears lock. Let the gears yield, as real teeth do (`stiffness`): "
        f"with stiffness dt^2 / 4 + damping dt below {yields:.3g} kg m^2 every step has one "
        "solution. Or give them more rotor inertia, or backward efficiencies nearer to zero."
    )


def _forward(system: RowSystem, rows: IntArray) -> BoolArray:
    """Return whether falling rows (f,) bring their impulse up."""
    return np.asarray(system.laws[rows, _UP] > 0.0)


def _ranges_of(system: RowSystem, rows: IntArray, impulse: FloatArray) -> IntArray:
    """Return the ranges (f,) of the falling rows at row impulses (r,)."""
    forward, laws = _forward(system, rows), system.laws[rows]
    brought = np.where(forward, laws[:, _UP], -laws[:, _DOWN])
    along = np.where(forward, impulse[rows], -impulse[rows]) + laws[:, _FRICTION]
    locked = along < brought / laws[:, _BACKWARD]
    return np.where(along >= 0.0, _HIGH, np.where(locked, _LOW, _FALL))


def _candidates(
    system: RowSystem, rows: IntArray, ranges: IntArray, start: FloatArray, tolerance: float
) -> list[tuple[FloatArray, int]]:
    """Return row impulses (r,) with the falling rows held to their ranges, and the work."""
    inner, fixed, kept = _held_to(system, rows, ranges)
    result = []
    for origin in (np.ascontiguousarray(start[kept]), np.zeros(len(kept))):
        part, used = np.empty(len(kept)), 1
        if len(kept):
            used = newton(inner, origin, 0.1 * tolerance, FULL_STEPS, SHORTENED, part)
            if used < 0:
                used = proximal(inner, origin, 0.1 * tolerance, _SYSTEMS, part) - used
        if used > 0:
            impulse = np.zeros(len(system.free))
            impulse[kept] = part
            if len(fixed):
                impulse[fixed] = _on_the_line(system, fixed, kept, part)
            result.append((impulse, used))
        if not start[kept].any():
            break
    return result


def _lines(system: RowSystem, fixed: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return L (f, f), hold (f,) and right (f,) of the `fixed` rows on their falling lines.

    On its line a row obeys M w + eta_b (T + s f + B w) = b, s the direction, and its spring carries
    T = p + stiffness (w - u). With w eliminated, and times hold: L T = right - hold u', where u' is
    the speed u that the other rows leave it.
    """
    laws, forward = system.laws[fixed], _forward(system, fixed)
    backward = laws[:, _BACKWARD]
    brought = np.where(forward, laws[:, _UP], laws[:, _DOWN])
    rub = np.where(forward, laws[:, _FRICTION], -laws[:, _FRICTION])
    total = laws[:, _INERTIA] + backward * laws[:, _DAMPING]
    slope, offset = backward / total, (brought - backward * rub) / total
    hold = _hold(system)[fixed]
    yields = (1.0 - hold) * _diagonal(system)[fixed]
    lines = hold[:, None] * system.delassus[np.ix_(fixed, fixed)]
    return lines + np.diag(yields + hold * slope), hold, hold * offset + yields * laws[:, _PRELOAD]


def _on_the_line(
    system: RowSystem, fixed: IntArray, kept: IntArray, part: FloatArray
) -> FloatArray:
    """Return T (f,) of the rows on their lines, for the impulses `part` of the others."""
    lines, hold, right = _lines(system, fixed)
    free = system.free[fixed] + system.delassus[np.ix_(fixed, kept)] @ part
    return np.asarray(np.linalg.lstsq(lines, right - hold * free, rcond=None)[0])


def _held_to(
    system: RowSystem, rows: IntArray, ranges: IntArray
) -> tuple[RowSystem, IntArray, IntArray]:
    """Return the system of the remaining rows, the rows on their lines, and those that remain."""
    high, low, fixed = (rows[ranges == kind] for kind in (_HIGH, _LOW, _FALL))
    laws = system.laws.copy()
    laws[np.concatenate((high, low)), _BACKWARD] = 0.0
    laws[low, _UP], laws[low, _DOWN] = -np.inf, np.inf
    kept = np.setdiff1d(np.arange(len(system.free)), fixed)
    delassus, free = system.delassus[np.ix_(kept, kept)], system.free[kept]
    if len(fixed):
        lines, hold, right = _lines(system, fixed)
        cross = system.delassus[np.ix_(fixed, kept)]
        both = np.column_stack((hold[:, None] * cross, hold * system.free[fixed] - right))
        through = np.linalg.lstsq(lines, both, rcond=None)[0]
        delassus = delassus - cross.T @ through[:, :-1]
        free = free - cross.T @ through[:, -1]
    inner = system._replace(
        half=np.ascontiguousarray(system.half[:, kept]),
        ways=np.empty((0, 0)),
        delassus=np.ascontiguousarray(delassus),
        free=free,
        spring=system.spring[kept],
        slope=system.slope[kept],
        laws=np.ascontiguousarray(laws[kept[kept < len(laws)]]),
    )
    return inner, fixed, kept
