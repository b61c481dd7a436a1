"""Weak form of a differential equation: derivatives moved onto smooth test functions.

For a test function phi that vanishes with its derivatives at the ends of its support,
int phi dy/dt dt = -int (dphi/dt) y dt: an equation that holds at every time holds for these
integrals, and no measured signal is differentiated (Messenger & Bortz, Weak SINDy, Multiscale
Modeling & Simulation 19, 2021, for the polynomial bumps used here).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import sparse

from wbc.arrays import FloatArray, IntArray
from wbc.errors import LogError

_FEWEST_SAMPLES = 8


class WeakOperator(NamedTuple):
    """Sparse operators on sampled signals y (N,) or (N, n).

    phi @ y is int phi_k y dt, so that of dy/dt it is -(dphi @ y), and of d2y/dt2 it is
    ddphi @ y. Every phi_k integrates to one: the entries are weighted means of y.
    """

    phi: sparse.csr_array
    """(K, N), phi_k(t_i) w_i with quadrature weights w."""
    dphi: sparse.csr_array
    """(K, N), dphi_k/dt(t_i) w_i [1/s]."""
    ddphi: sparse.csr_array
    """(K, N), d2phi_k/dt2(t_i) w_i [1/s^2]."""
    centres: FloatArray
    """(K,) middle of each support [s]."""


def weak_operator(
    time: FloatArray, width: float, overlap: float = 0.5, order: int = 6
) -> WeakOperator:
    """Return test functions phi_k(t) = c (1 - x^2)^order, x = 2 (t - centre_k) / width.

    The derivatives are corrected row by row so that parabolas are differentiated without error
    also on jittered stamps: a large mean position must not leak into the derivative.

    Args:
        time: (N,) [s], increasing.
        width: of the support [s]; it acts as a low-pass of about 1.6 / width [Hz] at order 6.
        overlap: share of the support that neighbours have in common, 0 <= overlap < 1.
        order: of the bump, at least 3, so that the second derivative vanishes at the ends too.

    Raises:
        LogError: a width that holds fewer than 8 samples somewhere or exceeds the log, or an
            overlap or order outside its range.
    """
    if not 0.0 <= overlap < 1.0 or order < 3:
        raise LogError(f"overlap {overlap:g} must lie in [0, 1), order {order} must be at least 3.")
    step = float(np.median(np.diff(time)))
    span = float(time[-1] - time[0])
    if not _FEWEST_SAMPLES * step <= width <= span:
        raise LogError(
            f"a test function of {width:g} s does not fit: it must span at least "
            f"{_FEWEST_SAMPLES * step:.3g} s ({_FEWEST_SAMPLES} samples), and at most the log's "
            f"{span:.3g} s."
        )
    count = int((span - width) / (width * (1.0 - overlap)) + 1e-9) + 1
    spare = span - width - (count - 1) * width * (1.0 - overlap)
    centres = time[0] + 0.5 * (width + spare) + width * (1.0 - overlap) * np.arange(count)
    first = np.searchsorted(time, centres - 0.5 * width, side="right")
    last = np.searchsorted(time, centres + 0.5 * width, side="left")
    full = last - first >= _FEWEST_SAMPLES
    return _assemble(time, centres[full], first[full], last[full], width, order)


def _assemble(
    time: FloatArray,
    centres: FloatArray,
    first: IntArray,
    last: IntArray,
    width: float,
    order: int,
) -> WeakOperator:
    lengths = last - first
    pointers = np.concatenate([[0], np.cumsum(lengths)])
    rows = np.repeat(np.arange(centres.size), lengths)
    columns = (
        np.arange(pointers[-1]) - np.repeat(pointers[:-1], lengths) + np.repeat(first, lengths)
    )
    rate = 2.0 / width
    x = rate * (time[columns] - centres[rows])
    quadrature = np.gradient(time)[columns]
    rest = 1.0 - x**2
    phi = rest**order * quadrature
    total = np.bincount(rows, phi)[rows]
    phi /= total
    scale = rest ** (order - 2) * quadrature / total
    dphi = -2.0 * order * rate * x * rest * scale
    ddphi = 2.0 * order * rate**2 * ((2.0 * order - 1.0) * x**2 - 1.0) * scale
    moments: FloatArray = np.stack([np.bincount(rows, phi * x**k) for k in range(5)], axis=1)
    zero = np.zeros(centres.size)
    slope = np.stack([zero, zero - rate, -2.0 * rate * moments[:, 1]], axis=1)
    bend = np.stack([zero, zero, zero + 2.0 * rate**2], axis=1)
    shape = (centres.size, time.size)

    def operator(values: FloatArray) -> sparse.csr_array:
        return sparse.csr_array((values, columns, pointers), shape=shape)

    return WeakOperator(
        operator(phi),
        operator(_corrected(dphi, phi, x, rows, moments, slope)),
        operator(_corrected(ddphi, phi, x, rows, moments, bend)),
        centres,
    )


def _corrected(
    values: FloatArray,
    phi: FloatArray,
    x: FloatArray,
    rows: IntArray,
    moments: FloatArray,
    wanted: FloatArray,
) -> FloatArray:
    """Return values + phi (a0 + a1 x + a2 x^2), its row sums against 1, x, x^2 as wanted (K, 3)."""
    have = np.stack([np.bincount(rows, values * x**k) for k in range(3)], axis=1)
    gram = np.stack([moments[:, k : k + 3] for k in range(3)], axis=1)
    a = np.linalg.solve(gram, (wanted - have)[:, :, None])[rows, :, 0]
    return np.asarray(values + phi * (a[:, 0] + a[:, 1] * x + a[:, 2] * x**2))
