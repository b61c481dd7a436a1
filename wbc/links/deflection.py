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
from wbc.links.swing_start import chosen_start
from wbc.transmission import Flanks

_VARIED = 1e-6  # [rad, rad/s] of a start, for what it changes


class Deflections(NamedTuple):
    """How links moved relative to their motors.

    Attributes:
        paths: of each link (N, 3): deflection, rate, second derivative; where any of the links has
            dry friction a fourth column is that [N m]. Not finite where a link flies off.
        start: a start (2, n), at least as good as that of the paths, for another round.
    """

    paths: list[FloatArray]
    start: FloatArray

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
    responses: Sequence[LinkResponse], gears: Sequence[Flanks], start: FloatArray | None = None
) -> Deflections:
    """Return the motion of all links together (`DrivenLinks.follow`), from the likeliest start.

    How the links moved when the log began is in no channel: it is chosen by what the log leaves
    unexplained. Behind springs that is least squares; behind play starts are drawn. Beside dry
    friction a start behind springs is only made better, for the next round.

    Args:
        responses: of the n links along one log, under the same load.
        gears: in front of them.
        start: what a round before returned (2, n); None at first.
    """
    links = DrivenLinks.of(responses)
    if any(gear.play > 0.0 for gear in gears):
        return _struck(responses, links, gears, start)
    if links.rubs and start is None:
        start = _as_if_at_motors(responses, gears)
    return _swung(responses, links, gears, start)


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
    start: FloatArray | None,
) -> Deflections:
    """Return the motion of links behind springs, which changes smoothly with its start."""
    count = len(gears)
    begun = np.zeros((2, count)) if start is None else start
    varied = begun[..., None] + _VARIED * np.eye(2 * count, 2 * count + 1, k=1).reshape(
        2, count, -1
    )
    d, v, dry = links.follow(gears, varied)
    if not np.isfinite(d).all():
        return Deflections(list(np.full((count, len(d), 3), np.inf)), begun)
    dry = _at_samples(dry)
    torques = [gear.torque(d[:, k], v[:, k]) for k, gear in enumerate(gears)]
    needed = links.drag @ v + links.pull @ d + links.load[..., None] + dry
    a = np.linalg.solve(links.inertia, np.stack(torques, axis=1) - needed)
    paths = np.stack([d, v, a, dry][: 4 if links.rubs else 3], axis=-1).transpose(1, 0, 3, 2)
    changes = np.concatenate([paths[..., :1], (paths[..., 1:] - paths[..., :1]) / _VARIED], axis=-1)
    if links.rubs:
        changes[:, :, 3, 0] -= links.counted.T
    more = chosen_start(responses, gears, list(changes))
    better = begun + more.reshape(2, count)
    if links.rubs:
        return Deflections(list(paths[..., 0]), better)
    # Linear in the start: the motion from the better one is known.
    return Deflections(list(changes[..., 0] + changes[..., 1:] @ more), better)


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
