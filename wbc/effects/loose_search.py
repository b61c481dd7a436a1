"""Which play and flanks explain what a log leaves unexplained."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects.flanks import COARSE, Contact, weight_of_the_end
from wbc.robot import LinkResponse

_FINE = 1e-3  # [s], of the last ranking
_SHORT, _LONG = 3.0, 6.0  # [s] of each log on which many, and on which few contacts are ranked
_CLOUD = 16  # contacts tried around a good one
_HOPELESS = 0.9  # share of what is unexplained that the best of the grid leaves
_GRID = tuple(
    Contact(stiffness, damping, float(play))
    for play in np.geomspace(0.002, 0.12, 9)
    for stiffness in (1000.0, 5000.0, 25000.0)
    for damping in (5.0, 20.0)
)


def best_contacts(responses: Sequence[LinkResponse], count: int) -> list[Contact]:
    """Return the `count` contacts whose deflection leaves least unexplained, best first.

    A link that bounces follows no gradient: a coarse grid is integrated side by side over the
    seconds of each log in which most is unexplained, then, where that promises something, clouds
    of contacts around the best over the logs from their beginning. A link without inertia about
    the joint (a point on its axis) swings behind nothing: the list is empty.

    Args:
        responses: of the joint, one per log.
        count: how many to return.
    """
    row = responses[0].row
    if min(float(np.min(response.inertia[:, row])) for response in responses) <= 0.0:
        return []
    step, shortest = responses[0].step, min(len(r.unexplained) for r in responses)
    length = min(int(_SHORT / step), shortest)
    busiest = [_busiest(response.unexplained, length) for response in responses]
    ranked, share = _ranked(_GRID, responses, busiest, COARSE)
    if share > _HOPELESS:
        return ranked[:count]
    length = min(int(_LONG / step), shortest)
    beginning = [slice(0, length) for _ in responses]
    ranked, _ = _ranked(ranked[:_CLOUD], responses, beginning, COARSE)
    random = np.random.default_rng(0)
    for width, finest in ((0.3, COARSE), (0.1, _FINE)):
        kept = ranked[:2]
        cloud = [c.scaled(*np.exp(width * row)) for c in kept for row in _normal(random)]
        ranked, _ = _ranked([*kept, *cloud], responses, beginning, finest)
    return ranked[:count]


def _normal(random: np.random.Generator) -> FloatArray:
    """Return factors' logarithms: flanks are known far worse than the play between them."""
    return np.asarray(random.standard_normal((_CLOUD, 3)) * (2.0, 2.0, 0.5))


def _ranked(
    contacts: Sequence[Contact],
    responses: Sequence[LinkResponse],
    parts: Sequence[slice],
    finest: float,
) -> tuple[list[Contact], float]:
    """Return contacts by what they leave unexplained on a part of each log, and the least share."""
    columns = _Columns.of(responses, parts)
    flanks = _flanks(contacts)
    stiffness, _, play = flanks
    rest = -columns.load[0] / stiffness - np.sign(columns.load[0]) * 0.5 * play
    # Against the flank that carries the load, or between: whichever the log shows.
    starts = np.concatenate([rest, 0.0 * rest], axis=1)
    found = columns.torque(flanks, starts, 0.0 * starts, responses[0].step, finest)
    left = np.zeros(starts.shape)
    all_of_it = 0.0
    for k, (response, part) in enumerate(zip(responses, parts, strict=True)):
        whole = np.zeros((len(response.unexplained), *found.shape[1:3]))
        whole[part] = response.unexplained[part, None, None] - found[..., k]
        nothing = np.zeros(len(whole))
        nothing[part] = response.unexplained[part]
        all_of_it += float(np.sum(response.band(nothing) ** 2))
        left[..., k] = np.sum(response.band(whole) ** 2, axis=0)
    total = left.min(axis=1).sum(axis=1)
    ranked = [contacts[k] for k in np.argsort(total)]
    return ranked, float(total.min()) / max(all_of_it, 1e-300)


def _flanks(contacts: Sequence[Contact]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return stiffness, damping and play (P, 1, 1)."""
    values = np.array([(c.stiffness, c.damping, c.play) for c in contacts])[:, :, None, None]
    return values[:, 0], values[:, 1], values[:, 2]


@dataclass(frozen=True, eq=False)
class _Columns:
    """What drives the links of L logs, each (N, L)."""

    load: FloatArray
    inertia: FloatArray
    drag: FloatArray
    pull: FloatArray
    speed: FloatArray
    level: FloatArray
    counted: FloatArray

    @classmethod
    def of(cls, responses: Sequence[LinkResponse], parts: Sequence[slice]) -> _Columns:
        def column(name: str) -> FloatArray:
            pairs = zip(responses, parts, strict=True)
            return np.stack([getattr(r, name)[part, r.row] for r, part in pairs], axis=1)

        def rubbing(name: str) -> FloatArray:
            columns = [
                np.zeros(len(r.load)) if r.friction is None else getattr(r.friction, name)
                for r in responses
            ]
            return np.stack([c[part] for c, part in zip(columns, parts, strict=True)], axis=1)

        links = [column(name) for name in ("load", "inertia", "damping", "stiffness")]
        return cls(*links, *(rubbing(name) for name in ("velocity", "level", "counted")))

    def torque(
        self,
        flanks: tuple[FloatArray, FloatArray, FloatArray],
        d: FloatArray,
        v: FloatArray,
        step: float,
        finest: float,
    ) -> FloatArray:
        """Return the joint's additional torque (N, P, S, L) from S starts each (P, S, L)."""
        from wbc.effects.link_steps import rank_loose

        stiffness, damping, play = (values.ravel() for values in flanks)
        parts = max(1, round(step / finest))
        late = weight_of_the_end(stiffness, float(self.inertia.min()), step / parts)
        result = np.zeros((len(self.load), *d.shape))
        for k in range(self.load.shape[1]):
            link = self.load[:, k], self.inertia[:, k], self.drag[:, k], self.pull[:, k]
            rubs = self.speed[:, k], self.level[:, k]
            starts = np.stack([d[..., k], v[..., k]], axis=-1)
            torques = np.zeros((len(self.load), *d.shape[:2]))
            flank = late, stiffness, damping, 0.5 * play
            rank_loose(*link, *rubs, step, parts, *flank, starts, torques)
            result[..., k] = torques - self.counted[:, k, None, None]
            result[-1, ..., k] = 0.0
        return result


def _busiest(torque: FloatArray, length: int) -> slice:
    """Return the window of `length` samples with the largest torque."""
    total = np.concatenate([[0.0], np.cumsum(torque**2)])
    start = int(np.argmax(total[length:] - total[:-length]))
    return slice(start, start + length)
