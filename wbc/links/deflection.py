"""How links behind gears that yield moved along a log, driven by their motors' measured motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from wbc.arrays import FloatArray
from wbc.links.driven_links import DrivenLinks
from wbc.links.response import LinkResponse
from wbc.links.striking_start import striking_start
from wbc.links.swing_start import chosen_start, shown
from wbc.transmission import Flanks

_VARIED = 1e-6  # [rad, rad/s] of a start, for what it changes


class FreeSwings(NamedTuple):
    """What unit changes of a start change in the motion of links behind springs.

    Attributes:
        links: whose.
        paths: of each link (N, 3 or 4, 2 n).
        columns: (R, 2 n) of it in the log.
    """

    links: DrivenLinks
    paths: FloatArray
    columns: FloatArray


class Deflections(NamedTuple):
    """How links moved relative to their motors.

    Attributes:
        paths: of each link (N, 3): deflection, rate, second derivative; where any of the links has
            dry friction a fourth column is that [N m]. Not finite where a link flies off.
        start: a start (2, n), at least as good as that of the paths, for another round.
        free: of links whose motion is linear in its start, for another round.
    """

    paths: list[FloatArray]
    start: FloatArray
    free: FreeSwings | None = None

    @property
    def finite(self) -> bool:
        """Whether every link stayed behind its gear."""
        return all(bool(np.isfinite(path).all()) for path in self.paths)

    @property
    def largest(self) -> float:
        """The largest deflection [rad]."""
        return max(float(np.abs(path[:, 0]).max()) for path in self.paths)

    def change(self, before: Deflections) -> float:
        """Return by how much any deflection differs [rad]."""
        pairs = zip(self.paths, before.paths, strict=True)
        return max(float(np.abs(now[:, 0] - then[:, 0]).max()) for now, then in pairs)


def deflections(
    responses: Sequence[LinkResponse],
    gears: Sequence[Flanks],
    before: Deflections | None = None,
    hold: bool = False,
) -> Deflections:
    """Return the motion of all links together (`DrivenLinks.follow`), from the likeliest start.

    How the links moved when the log began is in no channel: it is chosen by what the log leaves
    unexplained. Behind springs that is least squares; behind play starts are drawn. Beside dry
    friction a start behind springs is only made better, for the next round.

    Args:
        responses: of the n links along one log, under the same load.
        gears: in front of them.
        before: what a round before returned, under another load; None at first.
        hold: whether to keep the start of the round before, where there is dry friction.
    """
    links = DrivenLinks.of(responses)
    if any(gear.play > 0.0 for gear in gears):
        return _struck(responses, links, gears, None if before is None else before.start)
    if not links.rubs:
        return _swung(responses, links, gears, None if before is None else before.free)
    start = _as_if_at_motors(responses, gears) if before is None else before.start
    found = _held(responses, links, gears, start)
    return found._replace(start=start) if hold else found


def _struck(
    responses: Sequence[LinkResponse],
    links: DrivenLinks,
    gears: Sequence[Flanks],
    near: FloatArray | None,
) -> Deflections:
    """Return the motion of links of which at least one has play."""
    # Where the links of a trial fly off, so do its numbers: it leaves infinity, and loses.
    with np.errstate(over="ignore", invalid="ignore"):
        start = striking_start(responses, links, gears, near)
        d, v, dry = (path[..., 0] for path in links.follow(gears, start[..., None]))
        # Averaged over the two neighbouring intervals, so that it belongs to the sample's time.
        a = np.gradient(v, links.step, axis=0)
    columns = [d, v, a]
    if links.rubs:
        columns.append(_at_samples(dry))
    return Deflections(list(np.stack(columns, axis=-1).transpose(1, 0, 2)), start)


def _swung(
    responses: Sequence[LinkResponse],
    links: DrivenLinks,
    gears: Sequence[Flanks],
    free: FreeSwings | None,
) -> Deflections:
    """Return the motion of links behind springs, which is linear in its start."""
    rest = np.zeros((2, len(gears)))
    if free is not None and free.links.reacts_as(links):
        paths = _paths(links, gears, rest[..., None])
    else:
        free, paths = None, _paths(links, gears, _varied(rest))
    if not np.isfinite(paths).all():
        return Deflections(list(paths[..., 0]), rest)
    if free is None:
        changes = (paths[..., 1:] - paths[..., :1]) / _VARIED
        free = FreeSwings(links, changes, np.concatenate(shown(responses, list(changes))))
    left = _left(responses, list(paths[..., 0]))
    start = chosen_start(responses, gears, left, free.columns, rest.ravel())
    whole = paths[..., 0] + free.paths @ start
    return Deflections(list(whole), start.reshape(rest.shape), free)


def _held(
    responses: Sequence[LinkResponse],
    links: DrivenLinks,
    gears: Sequence[Flanks],
    start: FloatArray,
) -> Deflections:
    """Return the motion of links behind springs that dry friction holds, and a better start."""
    paths = _paths(links, gears, _varied(start))
    if not np.isfinite(paths).all():
        return Deflections(list(paths[..., 0]), start)
    changes = (paths[..., 1:] - paths[..., :1]) / _VARIED
    columns = np.concatenate(shown(responses, list(changes)))
    path = np.array(paths[..., 0])
    path[:, :, 3] -= links.counted.T
    better = chosen_start(responses, gears, _left(responses, list(path)), columns, start.ravel())
    return Deflections(list(paths[..., 0]), better.reshape(start.shape))


def _varied(start: FloatArray) -> FloatArray:
    """Return a start (2, n) and, beside it, that with one number after the other varied."""
    changes = _VARIED * np.eye(start.size, start.size + 1, k=1)
    return np.asarray(start[..., None] + changes.reshape(*start.shape, -1))


def _paths(links: DrivenLinks, gears: Sequence[Flanks], starts: FloatArray) -> FloatArray:
    """Return motions (n, N, 3, S) behind springs; (n, N, 4, S) where there is dry friction.

    Accelerations are those of the torque balance.
    """
    d, v, dry = links.follow(gears, starts)
    dry = _at_samples(dry)
    parts = [d, v, d] + [dry] * links.rubs
    if np.isfinite(d).all():
        torques = [gear.torque(d[:, k], v[:, k]) for k, gear in enumerate(gears)]
        needed = links.drag @ v + links.pull @ d + links.load[..., None] + dry
        parts[2] = np.asarray(np.linalg.solve(links.inertia, np.stack(torques, axis=1) - needed))
    return np.asarray(np.stack(parts, axis=-1).transpose(1, 0, 3, 2))


def _left(responses: Sequence[LinkResponse], paths: Sequence[FloatArray]) -> FloatArray:
    """Return (R,) what motions (N, 3 or 4) of n links leave unexplained, joint after joint."""
    found = []
    for response in responses:
        pairs = zip(responses, paths, strict=True)
        torques = [other.torque_on(response.row, path[..., None]) for other, path in pairs]
        found.append(response.left(np.sum(torques, axis=0)[:, 0]))
    return np.concatenate(found)


def _as_if_at_motors(responses: Sequence[LinkResponse], gears: Sequence[Flanks]) -> FloatArray:
    """Return the likeliest start (2, n) as if friction followed the motors' speed."""
    load = np.array(responses[0].load)
    for response in responses:
        if response.friction is not None:
            load[:, response.row] += response.friction.counted
    plain = [replace(response, load=load, friction=None) for response in responses]
    return deflections(plain, gears).start


def _at_samples(dry: FloatArray) -> FloatArray:
    """Return means of intervals (N, ...), the last one missing, at the samples between them."""
    result = np.array(dry)
    result[-1] = dry[-2]
    result[1:] = 0.5 * (result[1:] + result[:-1])
    return result
