"""The motion of links behind soft gears that dry friction holds, driven by their motors' motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline

from wbc.arrays import FloatArray
from wbc.effects.soft_link import Spring, chosen_start, coupled, soft_start, steps_per_sample
from wbc.robot import LinkFriction, LinkResponse

_VARIED = 1e-6  # [rad, rad/s] of a start, for what it changes


def rubbing_start(responses: Sequence[LinkResponse], springs: Sequence[Spring]) -> FloatArray:
    """Return the deflections and then the rates (2 n,) with which the log probably began.

    As if friction followed the motors' speed: what is chosen from it is still to be refined.
    """
    load = np.array(responses[0].load)
    for response in responses:
        load[:, response.row] += _friction(response).counted
    return soft_start([replace(response, load=load) for response in responses], springs)


def rubbing_deflections(
    responses: Sequence[LinkResponse], springs: Sequence[Spring], start: FloatArray
) -> tuple[list[FloatArray], FloatArray]:
    """Return the deflection of every link (N, 4) from a start, and a better start.

    inertia d_dd + (drag + c) d_d + (pull + k) d + load + friction = 0 with friction that takes
    any value within its level while the link, not the motor, stands still, so that a link which
    sticks winds up its spring. Columns are position, rate, second derivative and friction.

    Args:
        responses: of the n links along one log, under the same load.
        springs: of their gears.
        start: deflections and then rates (2 n,) at the beginning of the log.
    """
    count = len(responses)
    d, v, a, dry = _follow(responses, springs, _varied(start))
    paths = [np.stack([d[:, i], v[:, i], a[:, i], dry[:, i]], axis=1) for i in range(count)]
    changes = []
    for response, path in zip(responses, paths, strict=True):
        change = np.array(path)
        change[..., 1:] = (path[..., 1:] - path[..., :1]) / _VARIED
        change[:, 3, 0] -= _friction(response).counted
        changes.append(change)
    return [path[..., 0] for path in paths], start + chosen_start(responses, springs, changes)


def held(
    inertia: FloatArray,
    drag: FloatArray,
    pull: FloatArray,
    load: FloatArray,
    friction: LinkFriction,
    step: float,
) -> tuple[FloatArray, FloatArray]:
    """Return deflections and rates (N, 1, 3) of one link: from rest, and what starts change.

    Args:
        inertia, drag, pull: (N, 1, 1), springs and dampers included.
        load: (N, 1).
        friction: of the link.
        step: distance of the samples [s].
    """
    from wbc.effects.link_steps import follow_rubbing  # it loads the compiler

    d, v, dry = np.zeros((3, len(load), 1, 3))
    d[0, 0], v[0, 0] = _varied(np.zeros(2))
    rubbing = friction.velocity[:, None], friction.level[:, None]
    follow_rubbing(inertia, drag, pull, load, *rubbing, step, 1, d, v, dry)
    for path in (d, v):
        path[..., 1:] = (path[..., 1:] - path[..., :1]) / _VARIED
    return d, v


def _varied(start: FloatArray) -> FloatArray:
    """Return a start (2 n,) and, beside it, that with one number after the other varied."""
    changes = np.eye(start.size, start.size + 1, k=1)
    return np.asarray(start[:, None] + _VARIED * changes)


def _follow(
    responses: Sequence[LinkResponse], springs: Sequence[Spring], starts: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return deflections, rates, second derivatives and friction (N, n, S) from starts (2 n, S)."""
    from wbc.effects.link_steps import follow_rubbing  # it loads the compiler

    inertia, drag, pull = coupled(responses, springs)
    rubbing = [_friction(response) for response in responses]
    load = responses[0].load[:, [response.row for response in responses]]
    step, (samples, count) = responses[0].step, load.shape
    parts = steps_per_sample(step)
    coarse, fine = np.arange(samples), np.arange((samples - 1) * parts + 1) / parts

    def between(columns: Sequence[FloatArray]) -> FloatArray:
        return np.stack([np.interp(fine, coarse, column) for column in columns], axis=1)

    driven = load if parts == 1 else CubicSpline(coarse, load)(fine)
    speed, level = between([f.velocity for f in rubbing]), between([f.level for f in rubbing])
    d, v, dry = np.zeros((3, samples, count, starts.shape[1]))
    d[0], v[0] = starts[:count], starts[count:]
    follow_rubbing(inertia, drag, pull, driven, speed, level, step, parts, d, v, dry)
    # Averaged over the two neighbouring intervals, so that it belongs to the sample's own time.
    dry[-1] = dry[-2]
    dry[1:] = 0.5 * (dry[1:] + dry[:-1])
    needed = drag @ v + pull @ d + load[..., None] + dry
    return d, v, np.asarray(-np.linalg.solve(inertia, needed)), dry


def _friction(response: LinkResponse) -> LinkFriction:
    nothing = np.zeros(len(response.load))
    return response.friction or LinkFriction(nothing, nothing, nothing)
