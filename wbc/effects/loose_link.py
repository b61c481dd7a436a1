"""The motion of a link behind a gear with play, driven by the measured motion of its motor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.robot import LinkResponse

_STEP = 5e-4  # [s]
_COARSE = 2e-3  # [s], while contacts and beginnings are only ranked
_START = 0.6  # [s] of the log by which the link's first position and speed are chosen
_SHORT, _LONG = 3.0, 10.0  # [s] of each log on which many, and on which few contacts are ranked
_CLOUD = 16  # contacts tried around a good one


@dataclass(frozen=True)
class Contact:
    """The flanks of a gear.

    Attributes:
        stiffness: [N m/rad].
        damping: [N m s/rad].
        play: whole free play [rad].
    """

    stiffness: float
    damping: float
    play: float

    def scaled(self, stiffness: float, damping: float, play: float) -> Contact:
        """Return the contact with every number multiplied."""
        factors = zip(
            (stiffness, damping, play), (self.stiffness, self.damping, self.play), strict=True
        )
        return Contact(*(float(factor * value) for factor, value in factors))


_GRID = tuple(
    Contact(stiffness, damping, float(play))
    for play in np.geomspace(0.002, 0.12, 9)
    for stiffness in (1000.0, 5000.0, 25000.0)
    for damping in (5.0, 20.0)
)


def loose_deflection(response: LinkResponse, contact: Contact) -> FloatArray:
    """Return the deflection of the link (N, 3): position, rate, second derivative.

    inertia d_dd + drag d_d + pull d + load = -k dz(d) - c d_d while in contact, with the dead zone
    dz of the play. Where in its play the link began, and how fast, is in no channel: it is chosen
    by what the first moments of the log leaves unexplained.

    Args:
        response: of the link along a log.
        contact: the flanks.
    """
    d, v = _beginning(response, contact)
    row = response.row
    load, inertia = response.load[:, row].tolist(), response.inertia[:, row].tolist()
    drag, pull = response.damping[:, row].tolist(), response.stiffness[:, row].tolist()
    parts = max(1, round(response.step / _STEP))
    h, half = response.step / parts, 0.5 * contact.play
    stiffness, damping = contact.stiffness, contact.damping
    late = float(_weight_of_the_end(np.array(stiffness), min(inertia), h))
    early = 1.0 - late
    result = np.zeros((len(load), 3))
    for k in range(len(load) - 1):
        m, b, p = inertia[k], drag[k], pull[k]
        slope = (load[k + 1] - load[k]) / parts
        torque = load[k] - early * slope
        result[k, 0], result[k, 1] = d, v
        for _ in range(parts):
            torque += slope
            middle = d + 0.5 * h * v
            if middle > half:
                rate, spring, rest = b + damping, p + stiffness, stiffness * half
            elif middle < -half:
                rate, spring, rest = b + damping, p + stiffness, -stiffness * half
            else:
                rate, spring, rest = b, p, 0.0
            push = torque + rate * early * v + spring * (d + late * h * early * v) - rest
            new = (m * v - h * push) / (m + h * late * (rate + h * late * spring))
            d += h * (early * v + late * new)
            v = new
    result[-1] = d, v, 0.0
    # Averaged over the two neighbouring intervals, so that it belongs to the sample's own time.
    result[:, 2] = np.gradient(result[:, 1], response.step)
    return result


def best_contacts(responses: Sequence[LinkResponse], count: int) -> list[Contact]:
    """Return the `count` contacts whose deflection leaves least unexplained, best first.

    A link that bounces follows no gradient: a coarse grid is integrated side by side over the
    seconds of each log in which most is unexplained, then clouds of contacts around the best over
    the logs from their beginning. A link without inertia about the joint (a point on its axis)
    swings behind nothing: the list is empty.

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
    ranked = _ranked(_GRID, responses, busiest, _COARSE)
    length = min(int(_LONG / step), shortest)
    beginning = [slice(0, length) for _ in responses]
    ranked = _ranked(ranked[:_CLOUD], responses, beginning, _COARSE)
    random = np.random.default_rng(0)
    for width, finest in ((0.3, _COARSE), (0.1, _STEP)):
        kept = ranked[:2]
        cloud = [c.scaled(*np.exp(width * row)) for c in kept for row in _normal(random)]
        ranked = _ranked([*kept, *cloud], responses, beginning, finest)
    return ranked[:count]


def _normal(random: np.random.Generator) -> FloatArray:
    """Return factors' logarithms: flanks are known far worse than the play between them."""
    return np.asarray(random.standard_normal((_CLOUD, 3)) * (2.0, 2.0, 0.5))


def _ranked(
    contacts: Sequence[Contact],
    responses: Sequence[LinkResponse],
    parts: Sequence[slice],
    finest: float,
) -> list[Contact]:
    """Return contacts by what they leave unexplained on a part of each log."""
    columns = _Columns.of(responses, parts)
    flanks = _flanks(contacts)
    stiffness, _, play = flanks
    rest = -columns.load[0] / stiffness - np.sign(columns.load[0]) * 0.5 * play
    # Against the flank that carries the load, or between: whichever the log shows.
    starts = np.concatenate([rest, 0.0 * rest], axis=1)
    found = columns.torque(flanks, starts, 0.0 * starts, responses[0].step, finest)
    left = np.zeros(starts.shape)
    for k, (response, part) in enumerate(zip(responses, parts, strict=True)):
        whole = np.zeros((len(response.unexplained), *found.shape[1:3]))
        whole[part] = response.unexplained[part, None, None] - found[..., k]
        left[..., k] = np.sum(response.band(whole) ** 2, axis=0)
    order = np.argsort(left.min(axis=1).sum(axis=1))
    return [contacts[k] for k in order]


def _flanks(contacts: Sequence[Contact]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return stiffness, damping and play (P, 1, 1)."""
    values = np.array([(c.stiffness, c.damping, c.play) for c in contacts])[:, :, None, None]
    return values[:, 0], values[:, 1], values[:, 2]


def _beginning(response: LinkResponse, contact: Contact) -> tuple[float, float]:
    """Return the first deflection and rate: against a flank or between, at rest or falling."""
    step, row = response.step, response.row
    count = min(len(response.load), int(_START / step))
    columns = _Columns.of([response], [slice(0, count)])
    half = 0.5 * contact.play
    fall = float(np.sqrt(half * abs(response.load[0, row]) / abs(response.inertia[0, row])))
    starts = [(x, s) for x in (-half, 0.0, half) for s in (-fall, 0.0, fall)]
    d, v = np.array(starts).T
    found = columns.torque(_flanks([contact]), d[None, :, None], v[None, :, None], step, _COARSE)[
        :, 0, :, 0
    ]
    # The filter needs the whole log; after the window all starts are taken to agree.
    whole = np.zeros((len(response.load), d.size))
    whole[:count] = response.unexplained[:count, None] - found
    k = int(np.argmin(np.sum(response.band(whole) ** 2, axis=0)))
    return float(d[k]), float(v[k])


@dataclass(frozen=True, eq=False)
class _Columns:
    """What drives the links of L logs, each (N, L)."""

    load: FloatArray
    inertia: FloatArray
    drag: FloatArray
    pull: FloatArray

    @classmethod
    def of(cls, responses: Sequence[LinkResponse], parts: Sequence[slice]) -> _Columns:
        def column(name: str) -> FloatArray:
            pairs = zip(responses, parts, strict=True)
            return np.stack([getattr(r, name)[part, r.row] for r, part in pairs], axis=1)

        return cls(column("load"), column("inertia"), column("damping"), column("stiffness"))

    def torque(
        self,
        flanks: tuple[FloatArray, FloatArray, FloatArray],
        d: FloatArray,
        v: FloatArray,
        step: float,
        finest: float,
    ) -> FloatArray:
        """Return the joint's additional torque (N, P, S, L) from S starts each (P, S, L)."""
        stiffness, damping, play = flanks
        half = 0.5 * play
        parts = max(1, round(step / finest))
        h = step / parts
        late = _weight_of_the_end(stiffness, float(self.inertia.min()), h)
        early = 1.0 - late
        result = np.zeros((len(self.load), *d.shape))
        change = np.diff(self.load, axis=0) / parts
        rows = zip(self.load, self.inertia, self.drag, self.pull, change, strict=False)
        for k, (load, m, b, p, slope) in enumerate(rows):
            start, torque = v, load - early * slope
            for _ in range(parts):
                torque = torque + slope
                middle = d + 0.5 * h * v
                flank = np.minimum(np.maximum(middle, -half), half)
                touching = middle != flank
                rate, spring = b + touching * damping, p + touching * stiffness
                ahead = early * v
                push = torque + rate * ahead + spring * (d + h * late * ahead)
                push -= touching * stiffness * flank
                v = (m * v - h * push) / (m + h * late * (rate + h * late * spring))
                d = d + h * (ahead + late * v)
            result[k] = m * (v - start) / step + b * v + p * d
        return result


def _weight_of_the_end(stiffness: FloatArray, inertia: float, step: float) -> FloatArray:
    """Return theta of the step: 1/2 takes no energy out, 1 damps a flank too stiff to draw."""
    return np.where(stiffness * step**2 < inertia, 0.5, 1.0)


def _busiest(torque: FloatArray, length: int) -> slice:
    """Return the window of `length` samples with the largest torque."""
    total = np.concatenate([[0.0], np.cumsum(torque**2)])
    start = int(np.argmax(total[length:] - total[:-length]))
    return slice(start, start + length)
