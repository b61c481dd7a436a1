"""The motion of a link behind a soft gear, driven by the measured motion of its motor."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import solve_banded

from wbc.arrays import FloatArray
from wbc.robot import LinkResponse

_STEP = 1e-3  # [s]; the frequency of a swing w comes out wrong by the share (w h)^2 / 12


def soft_deflection(response: LinkResponse, stiffness: float, damping: float) -> FloatArray:
    """Return the deflection of the link (N, 3): position, rate, second derivative.

    inertia d_dd + (drag + c) d_d + (pull + k) d + load = 0, linear in d, so that the deflection is
    one motion from rest plus two free swings; how much of these the log began with is chosen by
    what the log leaves unexplained.

    Args:
        response: of the link along a log.
        stiffness: k of the gear [N m/rad].
        damping: c of the gear [N m s/rad].
    """
    parts = max(1, round(response.step / _STEP))
    forced, *free = _solutions(response, stiffness, damping, parts)
    start = _start(response, forced, free)
    return np.asarray(forced + start[0] * free[0] + start[1] * free[1])


def _start(response: LinkResponse, forced: FloatArray, free: Sequence[FloatArray]) -> FloatArray:
    """Return how much of the two free swings (2,) leaves least unexplained."""
    torques = response.own_torque([forced, *free])
    wanted = response.left(torques[:, 0])
    columns = response.band(torques[:, 1:])
    return np.asarray(np.linalg.lstsq(columns, wanted, rcond=1e-6)[0])


def _solutions(
    response: LinkResponse, stiffness: float, damping: float, parts: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the deflections (N, 3) from rest, from a unit deflection, from a unit rate.

    Newmark's rule with average acceleration, which takes no energy out of a swing, as one banded
    system for all samples.
    """
    row, count = response.row, len(response.load)
    fine = np.arange((count - 1) * parts + 1) / parts
    coarse = np.arange(count)
    h = response.step / parts

    def between(values: FloatArray) -> FloatArray:
        return values if parts == 1 else np.interp(fine, coarse, values)

    inertia = between(response.inertia[:, row])
    drag = between(response.damping[:, row]) + damping
    pull = between(response.stiffness[:, row]) + stiffness
    load = response.load[:, row]
    load = load if parts == 1 else CubicSpline(coarse, load)(fine)
    after = inertia / h**2 + drag / (2.0 * h) + pull / 4.0
    here = -2.0 * inertia / h**2 + pull / 2.0
    before = inertia / h**2 - drag / (2.0 * h) + pull / 4.0
    mean = load.copy()
    mean[1:-1] = (load[2:] + 2.0 * load[1:-1] + load[:-2]) / 4.0
    known = np.zeros((fine.size, 3))
    known[2:, 0] = -mean[1:-1]
    known[0, 1] = 1.0
    # The first step: d1 = d0 + h v0 + h^2 a0 / 2.
    known[1] = (
        -0.5 * h**2 * load[0] / inertia[0],
        1.0 - 0.5 * h**2 * pull[0] / inertia[0],
        h - 0.5 * h**2 * drag[0] / inertia[0],
    )
    bands = np.zeros((3, fine.size))
    bands[0, :2] = 1.0
    bands[0, 2:] = after[1:-1]
    bands[1, 1:-1] = here[1:-1]
    bands[2, :-2] = before[1:-1]
    d = solve_banded((2, 0), bands, known, check_finite=False)
    v = np.gradient(d, h, axis=0)
    v[0] = (0.0, 0.0, 1.0)
    a = -(drag[:, None] * v + pull[:, None] * d) / inertia[:, None]
    a[:, 0] -= load / inertia
    return tuple(np.stack([d[::parts, k], v[::parts, k], a[::parts, k]], axis=1) for k in range(3))  # type: ignore[return-value]
