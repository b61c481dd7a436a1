"""The motion of links behind soft gears, driven by the measured motion of their motors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import CubicSpline

from wbc.arrays import FloatArray
from wbc.robot import LinkResponse

_STEP = 1e-3  # [s]; the frequency of a swing w comes out wrong by the share (w h)^2 / 12
_SEEN = 1.0  # [rad] of its period that a swing may turn per sample and still be in a channel
_SLACK = 1e-9  # [N m/rad] below which a spring holds nothing

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
    paths = _solutions(responses, springs)
    start = chosen_start(responses, springs, paths)
    return [path[..., 0] + path[..., 1:] @ start for path in paths]


def soft_start(responses: Sequence[LinkResponse], springs: Sequence[Spring]) -> FloatArray:
    """Return the deflections and then the rates (2 n,) with which the log began."""
    return chosen_start(responses, springs, _solutions(responses, springs))


def chosen_start(
    responses: Sequence[LinkResponse], springs: Sequence[Spring], paths: Sequence[FloatArray]
) -> FloatArray:
    """Return how much of the free swings (2 n,) leaves least unexplained at the n joints.

    Args:
        responses: of the n links along one log.
        springs: of their gears.
        paths: of each gear, (N, 3, 1 + 2 n): deflections without and of every free swing.
    """
    gears = list(zip(responses, springs, strict=True))
    seen = [r.step * own_frequency(r, spring) < _SEEN for r, spring in gears] * 2
    wanted, columns = [], []
    for response in responses:
        parts = zip(responses, paths, strict=True)
        torques = np.sum([other.torque_on(response.row, path) for other, path in parts], axis=0)
        wanted.append(response.left(torques[:, 0]))
        columns.append(response.band(torques[:, 1:]))
    typical = np.transpose([typical_start(r, spring) for r, spring in gears]).ravel()
    start = np.zeros(len(seen))
    start[seen] = likely_start(
        np.concatenate(columns)[:, seen], np.concatenate(wanted), typical[seen]
    )
    return start


def typical_start(response: LinkResponse, spring: Spring) -> FloatArray:
    """Return the deflection [rad] to which the largest load winds up a gear, and its rate, (2,)."""
    largest = float(np.max(np.abs(response.load[:, response.row])))
    return largest / _pull(spring) * np.array([1.0, own_frequency(response, spring)])


def likely_start(columns: FloatArray, wanted: FloatArray, typical: FloatArray) -> FloatArray:
    """Return the start (n,) that leaves least of `wanted`, starts being as large as is typical.

    A swing that dies down before the first sample that is judged is in no channel: a start of any
    size would write its last trace into the noise.

    Args:
        columns: (R, n) what unit starts add.
        wanted: (R,) what no start explains of it is the noise against which starts are weighed.
        typical: (n,) standard deviations that are expected of starts.
    """
    scaled = columns * typical
    any_size = np.linalg.lstsq(scaled, wanted, rcond=None)[0]
    scatter = float(np.sqrt(np.mean((wanted - scaled @ any_size) ** 2)))
    rows = np.concatenate([scaled, scatter * np.eye(typical.size)])
    aims = np.concatenate([wanted, np.zeros(typical.size)])
    return np.asarray(typical * np.linalg.lstsq(rows, aims, rcond=None)[0])


def own_frequency(response: LinkResponse, spring: Spring) -> float:
    """Return the angular frequency [rad/s] at which a link swings behind a spring."""
    inertia = float(np.mean(response.inertia[:, response.row]))
    return float(np.sqrt(_pull(spring) / inertia))


def _pull(spring: Spring) -> float:
    return max(spring[0], _SLACK)


def steps_per_sample(step: float) -> int:
    """Return into how many steps a sample [s] is cut."""
    return max(1, round(step / _STEP))


def coupled(
    responses: Sequence[LinkResponse], springs: Sequence[Spring]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return inertia, drag and pull (N, n, n), springs included: what row i feels of joint j."""
    rows = [response.row for response in responses]

    def samples(name: str) -> FloatArray:
        return np.stack([getattr(r, name)[:, rows] for r in responses], axis=-1)

    drag = samples("damping") + np.diag([damping for _, damping in springs])
    pull = samples("stiffness") + np.diag([stiffness for stiffness, _ in springs])
    return samples("inertia"), drag, pull


def _solutions(responses: Sequence[LinkResponse], springs: Sequence[Spring]) -> list[FloatArray]:
    """Return per gear the deflections (N, 3, 1 + 2 n): from rest, then from unit starts."""
    rows, step = [response.row for response in responses], responses[0].step
    inertia, drag, pull = coupled(responses, springs)
    load = responses[0].load[:, rows]
    d, v = swings(inertia, drag, pull, load, step, steps_per_sample(step))
    needed = drag @ v + pull @ d
    needed[..., 0] += load
    a = -np.linalg.solve(inertia, needed)
    return [np.stack([d[:, i], v[:, i], a[:, i]], axis=1) for i in range(len(rows))]


def swings(
    inertia: FloatArray,
    drag: FloatArray,
    pull: FloatArray,
    load: FloatArray,
    step: float,
    parts: int,
) -> tuple[FloatArray, FloatArray]:
    """Return deflections and rates (N, n, 1 + 2 n): from rest, then from unit starts.

    The unit starts are a deflection of each gear and then a rate of each.

    Args:
        inertia, drag, pull: (N, n, n), springs and dampers included.
        load: (N, n).
        step: distance of the samples [s].
        parts: steps per sample.
    """
    from wbc.effects.soft_steps import follow_soft  # it loads the compiler

    count, n = load.shape
    fine = np.arange((count - 1) * parts + 1) / parts
    h = step / parts
    between = load if parts == 1 else CubicSpline(np.arange(count), load)(fine)
    d = np.zeros((fine.size, n, 1 + 2 * n))
    d[0, :, 1 : 1 + n] = np.eye(n)
    # The first step: d1 = d0 + h v0 + h^2 a0 / 2.
    push = np.concatenate([load[0][:, None], pull[0], drag[0]], axis=1)
    d[1] = -0.5 * h**2 * np.linalg.solve(inertia[0], push)
    d[1, :, 1:] += np.concatenate([np.eye(n), h * np.eye(n)], axis=1)
    follow_soft(inertia, drag, pull, between, step, parts, d)
    v = np.zeros((count, n, 1 + 2 * n))
    v[0, :, 1 + n :] = np.eye(n)
    v[1:-1] = (d[parts + 1 :: parts][: count - 2] - d[parts - 1 :: parts][: count - 2]) / (2.0 * h)
    v[-1] = (d[-1] - d[-2]) / h
    return d[::parts], v
