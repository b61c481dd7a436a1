"""The motion of links behind soft gears, driven by the measured motion of their motors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import solve_banded

from wbc.arrays import FloatArray
from wbc.robot import LinkResponse

_STEP = 1e-3  # [s]; the frequency of a swing w comes out wrong by the share (w h)^2 / 12

Spring = tuple[float, float]
"""Stiffness [N m/rad] and damping [N m s/rad] of a gear."""


def soft_deflections(
    responses: Sequence[LinkResponse], springs: Sequence[Spring]
) -> list[FloatArray]:
    """Return the deflection of every link (N, 3): position, rate, second derivative.

    inertia d_dd + (drag + c) d_d + (pull + k) d + load = 0, linear in the deflections d of all
    soft gears of a robot, which shake one another through the off-diagonal inertia. They are one
    motion from rest plus two free swings per gear; how much of these the log began with is chosen
    by what the log leaves unexplained.

    Args:
        responses: of the n links along one log, under the same load.
        springs: of their gears.
    """
    parts = max(1, round(responses[0].step / _STEP))
    paths = _solutions(responses, springs, parts)
    start = _start(responses, paths)
    return [path[..., 0] + path[..., 1:] @ start for path in paths]


def _start(responses: Sequence[LinkResponse], paths: Sequence[FloatArray]) -> FloatArray:
    """Return how much of the free swings (2 n,) leaves least unexplained at the n joints."""
    wanted, columns = [], []
    for response in responses:
        parts = zip(responses, paths, strict=True)
        torques = np.sum([other.torque_on(response.row, path) for other, path in parts], axis=0)
        wanted.append(response.left(torques[:, 0]))
        columns.append(response.band(torques[:, 1:]))
    found = np.linalg.lstsq(np.concatenate(columns), np.concatenate(wanted), rcond=1e-6)
    return np.asarray(found[0])


def _solutions(
    responses: Sequence[LinkResponse], springs: Sequence[Spring], parts: int
) -> list[FloatArray]:
    """Return per gear the deflections (N, 3, 1 + 2 n): from rest, then from unit starts.

    The unit starts are a deflection of each gear and then a rate of each. Newmark's rule with
    average acceleration, which takes no energy out of a swing, as one banded system of n x n blocks
    for all samples.
    """
    n, count = len(responses), len(responses[0].load)
    rows = [response.row for response in responses]
    fine = np.arange((count - 1) * parts + 1) / parts
    coarse = np.arange(count)
    h = responses[0].step / parts

    def between(name: str) -> FloatArray:
        """Return (fine, n, n): what row i feels of joint j."""
        blocks = np.stack([getattr(r, name)[:, rows] for r in responses], axis=-1)
        return blocks if parts == 1 else _interpolated(fine, blocks)

    inertia = between("inertia")
    drag = between("damping") + np.diag([damping for _, damping in springs])
    pull = between("stiffness") + np.diag([stiffness for stiffness, _ in springs])
    load = responses[0].load[:, rows]
    load = load if parts == 1 else CubicSpline(coarse, load)(fine)
    mean = (load[2:] + 2.0 * load[1:-1] + load[:-2]) / 4.0
    known = np.zeros((fine.size, n, 1 + 2 * n))
    known[2:, :, 0] = -mean
    known[0, :, 1 : 1 + n] = np.eye(n)
    # The first step: d1 = d0 + h v0 + h^2 a0 / 2.
    push = np.concatenate([load[0][:, None], pull[0], drag[0]], axis=1)
    known[1] = -0.5 * h**2 * np.linalg.solve(inertia[0], push)
    known[1, :, 1:] += np.concatenate([np.eye(n), h * np.eye(n)], axis=1)
    bands = np.zeros((4 * n - 1, fine.size, n))
    after = inertia / h**2 + drag / (2.0 * h) + pull / 4.0
    here = -2.0 * inertia / h**2 + pull / 2.0
    before = inertia / h**2 - drag / (2.0 * h) + pull / 4.0
    for i in range(n):
        bands[n - 1, :2, i] = 1.0
        for j in range(n):
            diagonal = n - 1 + i - j
            bands[diagonal, 2:, j] = after[1:-1, i, j]
            bands[diagonal + n, 1:-1, j] = here[1:-1, i, j]
            bands[diagonal + 2 * n, :-2, j] = before[1:-1, i, j]
    shape = (3 * n - 1, n - 1)
    flat = known.reshape(fine.size * n, -1)
    d = solve_banded(shape, bands.reshape(4 * n - 1, -1), flat, check_finite=False)
    d = d.reshape(known.shape)
    v = np.gradient(d, h, axis=0)
    v[0] = 0.0
    v[0, :, 1 + n :] = np.eye(n)
    d, v = d[::parts], v[::parts]
    needed = drag[::parts] @ v + pull[::parts] @ d
    needed[..., 0] += load[::parts]
    a = -np.linalg.solve(inertia[::parts], needed)
    return [np.stack([d[:, i], v[:, i], a[:, i]], axis=1) for i in range(n)]


def _interpolated(fine: FloatArray, blocks: FloatArray) -> FloatArray:
    """Return `blocks` (N, n, n) at the `fine` samples, linear between neighbours."""
    below = np.minimum(fine.astype(int), len(blocks) - 2)
    share = (fine - below)[:, None, None]
    return np.asarray((1.0 - share) * blocks[below] + share * blocks[below + 1])
