"""Every solution of a small step program, found by trying all modes. Shares nothing with wbc.sim.

Written from the mesh law as it stands in the books: t is what the rotor gives to the mesh,
T = eta_f t where the motor drives, t = eta_b T where the joint drives, and at rest any T for which
some t within the rotor's stiction lies between eta_b T and T / eta_f.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Case:
    """A random step: w = free + Lambda T, gears first, then planar contacts (normal, tangent)."""

    Lambda: np.ndarray
    free: np.ndarray
    brought: np.ndarray
    coulomb: np.ndarray
    inertia: np.ndarray
    eta_f: np.ndarray
    eta_b: np.ndarray
    mu: np.ndarray


STUCK, UP_FORWARD, UP_BACKWARD, DOWN_FORWARD, DOWN_BACKWARD = range(5)
OPEN, STICK, SLIDE_PLUS, SLIDE_MINUS = range(4)


def solutions(case: Case, tolerance: float = 1e-9) -> tuple[np.ndarray, np.ndarray]:
    """Return impulses (S, r) and speeds (S, r) of all solutions, duplicates included."""
    m, k = len(case.brought), len(case.mu)
    modes = np.array(list(itertools.product(*([range(5)] * m + [range(4)] * k))), dtype=int)
    modes = modes.reshape(-1, m + k)
    gears, contacts = modes[:, :m], modes[:, m:]
    sign = np.array([0, 1, 1, -1, -1])[gears]
    forward = np.array([False, True, False, True, False])[gears]
    gain = np.where(forward, 1.0 / case.eta_f, case.eta_b)
    size = m + 2 * k
    on_speed = np.zeros((len(modes), size, size))
    on_impulse = np.zeros((len(modes), size, size))
    right = np.zeros((len(modes), size))
    own = np.arange(m)
    on_speed[:, own, own] = np.where(sign == 0, 1.0, case.inertia)
    on_impulse[:, own, own] = np.where(sign == 0, 0.0, gain)
    right[:, :m] = np.where(sign == 0, 0.0, case.brought - sign * case.coulomb)
    for i in range(k):
        n, t, kind = m + i, m + k + i, contacts[:, i]
        on_speed[:, n, n] = kind != OPEN
        on_impulse[:, n, n] = kind == OPEN
        on_speed[:, t, t] = kind == STICK
        on_impulse[:, t, t] = kind != STICK
        slide = np.where(kind == SLIDE_PLUS, 1.0, np.where(kind == SLIDE_MINUS, -1.0, 0.0))
        on_impulse[:, t, n] = slide * case.mu[i]
    system = on_speed @ case.Lambda + on_impulse
    regular = np.abs(np.linalg.det(system)) > 1e-300
    impulse = np.full(right.shape, np.nan)
    rest = right - on_speed @ case.free
    impulse[regular] = np.linalg.solve(system[regular], rest[regular][:, :, None])[:, :, 0]
    speed = case.free + impulse @ case.Lambda.T
    scale = tolerance * (1.0 + np.abs(case.free).max())
    good = regular & np.isfinite(impulse).all(axis=1)
    for i in range(m):
        good &= _gear_holds(case, i, sign[:, i], forward[:, i], impulse, speed, scale)
    for i in range(k):
        good &= _contact_holds(case, i, contacts[:, i], impulse, speed, scale)
    return impulse[good], speed[good]


def _gear_holds(case, i, sign, forward, impulse, speed, scale):
    T, w = impulse[:, i], speed[:, i]
    force = scale / case.Lambda[i, i]
    driving = np.where(forward, sign * T >= -force, sign * T <= force)
    moving = (sign * w >= -scale) & driving
    one, other = T / case.eta_f[i], T * case.eta_b[i]
    low, high = np.minimum(one, other), np.maximum(one, other)
    slack = force / min(case.eta_f[i], 1.0)
    resting = (low <= case.brought[i] + case.coulomb[i] + slack) & (
        high >= case.brought[i] - case.coulomb[i] - slack
    )
    return np.where(sign == 0, resting, moving)


def _contact_holds(case, i, kind, impulse, speed, scale):
    m, k = len(case.brought), len(case.mu)
    n, t = m + i, m + k + i
    force = scale / case.Lambda[n, n]
    pn, pt, un, ut = impulse[:, n], impulse[:, t], speed[:, n], speed[:, t]
    return np.select(
        [kind == OPEN, kind == STICK, kind == SLIDE_PLUS],
        [
            un >= -scale,
            (pn >= -force) & (np.abs(pt) <= case.mu[i] * pn + force),
            (pn >= -force) & (ut >= -scale),
        ],
        (pn >= -force) & (ut <= scale),
    )
