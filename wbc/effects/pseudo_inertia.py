"""Pseudo-inertias of links in log-Cholesky numbers, and how far they are from their drawing.

The pseudo-inertia of a body is P = sum over the mass of (x, 1)(x, 1)', (4, 4). A link that is drawn
with F F' has F Q F', and Q = U U' with U upper triangular is told by ten numbers (Rucker and
Wensing, 2022): zeros are the drawing, and all numbers are bodies that can exist. All functions take
numbers (..., 10) and matrices (..., 4, 4).
"""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray, IntArray

LOG_CHOLESKY = ("alpha", "d1", "d2", "d3", "s12", "s23", "s13", "t1", "t2", "t3")
"""The ten numbers, named as by Rucker and Wensing (2022)."""

# How wrong drawings usually are, as a standard deviation of the log-Cholesky parameters: 28 % of
# the mass, 28 % of every second moment, and a centre of mass that is off by a fifth of the radius
# of gyration (2 cm for a forearm of 0.35 m): CAD leaves out cables, grease and screws, and takes
# castings for solid. Measured on the recorded Staubli TX40 against its CAD links: rms departures of
# links 3 to 6 are 1.0, 0.6, 0.6 and 0.3 in this unit (links 1 and 2 cannot be told from rotors).
USUAL = 0.2

SPREAD = 0.5
"""Standard deviation of the logarithm of how wrong drawings are beside USUAL."""
ROUNDS = 8
"""Rounds until the factor by which a drawing is wrong repeats itself, to 2e-5 or better."""
_LARGEST_LOG = 2.5  # a mass between 1 / 150 and 150 times that drawn
_LARGEST = 100.0  # of shears, and of shifts in radii of gyration: small flanges carry long tools
LARGEST = np.array([_LARGEST_LOG] * 4 + [_LARGEST] * 6)
"""(10,) Largest size of each number."""
# Of its distance, the radius of gyration of a ball that a fit begins with: from a point, it never
# finds how wide a tool is that is a hundred times as wide as the flange before it.
_BALL = 0.25
_LEAST = float(np.exp(-2.0 * _LARGEST_LOG))  # eigenvalue of Q
_STRAIGHT = 1e-5  # logarithms up to which departures are linear, to as much

_ROWS, _COLUMNS = [0, 1, 0, 0, 1, 2], [1, 2, 2, 3, 3, 3]  # where s12, s23, s13, t1, t2, t3 stand


def factor(numbers: FloatArray) -> FloatArray:
    """Return U (..., 4, 4), upper triangular."""
    upper = np.zeros((*numbers.shape[:-1], 4, 4))
    upper[..., range(3), range(3)] = np.exp(numbers[..., 1:4])
    upper[..., 3, 3] = 1.0
    upper[..., _ROWS, _COLUMNS] = numbers[..., 4:]
    return np.asarray(upper * np.exp(numbers[..., :1, None]))


def matrix_of(numbers: FloatArray) -> FloatArray:
    """Return Q = U U' (..., 4, 4)."""
    upper = factor(numbers)
    return np.asarray(upper @ upper.swapaxes(-1, -2))


def upper_factor(matrix: FloatArray) -> FloatArray:
    """Return U, upper triangular, with U U' = matrix (..., n, n)."""
    return np.asarray(np.linalg.cholesky(matrix[..., ::-1, ::-1])[..., ::-1, ::-1])


def tangents(numbers: FloatArray) -> FloatArray:
    """Return (..., 10, 4, 4) the derivatives of Q = U U' by the numbers."""
    upper, each = factor(numbers), np.zeros((*numbers.shape, 4, 4))
    each[..., 0, :, :] = upper
    for k in range(3):
        each[..., 1 + k, k, k] = upper[..., k, k]
    each[..., range(4, 10), _ROWS, _COLUMNS] = upper[..., 3, 3, None]
    half = each @ upper[..., None, :, :].swapaxes(-1, -2)
    return np.asarray(half + half.swapaxes(-1, -2))


def numbers_of(matrix: FloatArray) -> FloatArray:
    """Return the numbers (..., 10) of Q = U U'."""
    upper = upper_factor(matrix)
    logs = np.log(np.diagonal(upper, axis1=-2, axis2=-1))
    last = logs[..., 3:]
    shears = upper[..., _ROWS, _COLUMNS] / upper[..., 3, 3, None]
    return np.concatenate([last, logs[..., :3] - last, shears], axis=-1)


def departures(numbers: FloatArray) -> FloatArray:
    """Return (..., 10) how far inertias are from their drawing, in units of how wrong these are.

    Their squares sum up to the log-determinant divergence of the two pseudo-inertias,
    tr(Q) - log det Q - 4, over USUAL^2 (Lee, Wensing and Park, 2020). It does not depend on frames
    or units.
    """
    return _stretched(numbers)[0]


def slopes(numbers: FloatArray) -> FloatArray:
    """Return (..., 10, 10) the derivatives of the departures by the numbers."""
    _, along = _stretched(numbers)
    each = np.zeros((*numbers.shape, numbers.shape[-1]))
    logs, shears = [0, 1, 2, 3], range(4, 10)
    each[..., logs, logs] = along
    each[..., logs, 0] = along
    mass = np.exp(numbers[..., :1]) / USUAL
    each[..., shears, shears] = mass
    each[..., shears, 0] = mass * numbers[..., 4:]
    return each


def _stretched(numbers: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return departures (..., 10), and slopes (..., 4) by logarithms of the diagonal of U."""
    # Their order is alpha alone, alpha + d1, alpha + d2, alpha + d3.
    x = numbers[..., :1] + np.where(np.arange(4) > 0, numbers[..., :4], 0.0)
    small = np.abs(x) < _STRAIGHT
    safe = np.where(small, 1.0, x)
    far = np.sign(safe) * np.sqrt(np.expm1(2.0 * safe) - 2.0 * safe)
    stretched = np.where(small, np.sqrt(2.0) * x, far)
    along = np.where(small, np.sqrt(2.0), np.expm1(2.0 * safe) / far)
    shears = np.exp(numbers[..., :1]) * numbers[..., 4:]
    return np.concatenate([stretched, shears], axis=-1) / USUAL, along / USUAL


def divergence(matrix: FloatArray) -> FloatArray:
    """Return (...) tr(Q) - log det Q - 4, infinite where Q is no body's."""
    squares = np.linalg.eigvalsh(matrix)
    body = np.all(squares > 0.0, axis=-1)
    logs = np.log(np.where(body[..., None], squares, 1.0))
    return np.asarray(np.where(body, np.sum(squares - logs - 1.0, axis=-1), np.inf))


def more_wrong(squares: FloatArray, count: IntArray) -> FloatArray:
    """Return by which factors drawings are likeliest more wrong than usual, 1 or more.

    Of n numbers, d^2 from what is usual in sum, and a factor s whose logarithm has the density of
    Cauchy, -n log s - d^2 / (2 s^2) - log(1 + (log s / w)^2) is largest where
    s^2 = d^2 / (n + 2 log s / (w^2 + (log s)^2)).  A tool on a small flange is further from its
    drawing than any drawing is wrong: beside a normal density it would not be found.

    Args:
        squares: d^2, of each drawing.
        count: n.
    """
    size = np.ones_like(squares)
    for _ in range(ROUNDS):
        told = np.maximum(count + 2.0 * np.log(size) / (SPREAD**2 + np.log(size) ** 2), 1.0)
        size = np.maximum(np.sqrt(squares / told), 1.0)
    return np.asarray(size)


def of_first_order(change: FloatArray) -> FloatArray:
    """Return the log-Cholesky parameters (10,) of the body that has a change of first order.

    What a link needs is linear in Q. To first order Q is 1 + S + S', with S the sum of the
    parameters' own matrices: that is the body meant, however far it is from the drawing. Of what
    somebody mounted, logs tell the weight and the first moments best: where a heavier link would
    lack more of its drawing than drawings usually have too much, a ball that has both stands beside
    the drawn link. Else the eigenvalues of Q are raised until a body can exist.

    Args:
        change: (10,) by which the parameters would change, were they small.
    """
    meant = np.eye(4) + np.tensordot(change, tangents(np.zeros(change.size)), 1)
    more = meant[3, 3] - 1.0
    if more > 0.0 and lacking(meant) > 0.0:
        point = np.append(meant[:3, 3] / more, 1.0)
        wide = (_BALL * np.linalg.norm(point[:3])) ** 2
        meant = np.eye(4) + more * (np.outer(point, point) + np.diag([wide, wide, wide, 0.0]))
    return np.asarray(np.clip(numbers_of(raised(meant, _LEAST)), -LARGEST, LARGEST))


def raised(matrix: FloatArray, least: float) -> FloatArray:
    """Return a symmetric matrix of which no eigenvalue is below `least`."""
    squares, axes = np.linalg.eigh(matrix)
    return np.asarray((axes * np.maximum(squares, least)) @ axes.T)


def lacking(matrix: FloatArray) -> float:
    """Return what a link costs that lacks more than drawings usually have too much [nats].

    A body that somebody mounts raises the eigenvalues of Q (4, 4) and lowers none. The divergence
    is a sum over them: those below 1 are what is drawn and is not there.
    """
    below = np.clip(np.linalg.eigvalsh(matrix), _LEAST, 1.0)
    distances = np.sqrt(np.maximum(below - np.log(below) - 1.0, 0.0)) / USUAL
    return excess(np.pad(distances, (0, LARGEST.size - below.size)))


def excess(distances: FloatArray) -> float:
    """Return what a drawing costs that is more wrong than drawings usually are [nats].

    By what factor drawings are wrong differs: its logarithm has a standard deviation of 0.5, as
    that of drives has. What ten free numbers could explain is paid by holding out.
    """
    size = float(np.sqrt(np.mean(distances**2)))
    return float(0.5 * (np.log(max(size, 1.0)) / SPREAD) ** 2)
