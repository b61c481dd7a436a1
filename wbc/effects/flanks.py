"""The motion of a link behind a gear with play, driven by the measured motion of its motor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from wbc.arrays import FloatArray
from wbc.robot import LinkFriction, LinkResponse

FINEST = 5e-4  # [s], at least
_TURN = 0.25  # [rad] of the swing on a flank that one step may cover
COARSE = 2e-3  # [s], while contacts and beginnings are only ranked
_START = 0.6  # [s] of the log by which the link's first position and speed are chosen


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


def loose_deflection(response: LinkResponse, contact: Contact) -> FloatArray:
    """Return the deflection of the link (N, 3): position, rate, second derivative.

    inertia d_dd + drag d_d + pull d + load = -k dz(d) - c d_d while in contact, with the dead zone
    dz of the play, less the link's dry friction, which then is a fourth column. Where in its play
    the link began, and how fast, is in no channel: it is chosen by what the first moments of the
    log leaves unexplained.

    Args:
        response: of the link along a log.
        contact: the flanks.
    """
    link = _Link.of(response)
    d, v, dry = link.follow(contact, [_beginning(response, link, contact)], FINEST)[0]
    # Averaged over the two neighbouring intervals, so that it belongs to the sample's own time.
    columns = [d, v, np.gradient(v, response.step)]
    if response.friction is not None:
        columns.append(np.convolve(dry, (0.5, 0.5))[: len(dry)])
    return np.stack(columns, axis=1)


def _beginning(response: LinkResponse, link: _Link, contact: Contact) -> tuple[float, float]:
    """Return the first deflection and rate: against a flank or between, at rest or falling."""
    count = min(len(link.load), int(_START / link.step))
    first = link.part(count)
    half = 0.5 * contact.play
    fall = float(np.sqrt(half * abs(link.load[0]) / abs(link.inertia[0])))
    starts = [(x, s) for x in (-half, 0.0, half) for s in (-fall, 0.0, fall)]
    # The filter needs the whole log; after the window all starts are taken to agree.
    whole = np.zeros((len(link.load), len(starts)))
    for column, path in enumerate(first.follow(contact, starts, COARSE)):
        whole[:count, column] = response.unexplained[:count] - first.torque(*path)
    k = int(np.argmin(np.sum(response.band(whole) ** 2, axis=0)))
    return starts[k]


@dataclass(frozen=True, eq=False)
class _Link:
    """What drives one link along a log, each (N,), and the distance of the samples [s]."""

    load: FloatArray
    inertia: FloatArray
    drag: FloatArray
    pull: FloatArray
    speed: FloatArray
    level: FloatArray
    counted: FloatArray
    step: float

    @classmethod
    def of(cls, response: LinkResponse) -> _Link:
        row, nothing = response.row, np.zeros(len(response.load))
        rubs = response.friction or LinkFriction(nothing, nothing, nothing)
        return cls(
            response.load[:, row],
            response.inertia[:, row],
            response.damping[:, row],
            response.stiffness[:, row],
            rubs.velocity,
            rubs.level,
            rubs.counted,
            response.step,
        )

    def part(self, count: int) -> _Link:
        """Return the first `count` samples."""
        names = (f.name for f in fields(self) if f.name != "step")
        return replace(self, **{name: getattr(self, name)[:count] for name in names})

    def torque(self, d: FloatArray, v: FloatArray, dry: FloatArray) -> FloatArray:
        """Return the joint's additional torque (N,), accelerations taken over each interval."""
        result = np.zeros(len(d))
        result[:-1] = self.inertia[:-1] * np.diff(v) / self.step
        result[:-1] += self.drag[:-1] * v[:-1] + self.pull[:-1] * d[:-1]
        result[:-1] += dry[:-1] - self.counted[:-1]
        return result

    def follow(
        self, contact: Contact, starts: Sequence[tuple[float, float]], finest: float
    ) -> list[tuple[FloatArray, FloatArray, FloatArray]]:
        """Return the deflection, its rate and the dry friction (N,) each, from every start."""
        from wbc.effects.link_steps import follow_loose

        least = float(self.inertia.min())
        parts = steps_per_sample(self.step, contact.stiffness, least, finest)
        late = float(weight_of_the_end(np.array(contact.stiffness), least, self.step / parts))
        flanks = contact.stiffness, contact.damping, 0.5 * contact.play
        link = self.load, self.inertia, self.drag, self.pull, self.speed, self.level
        paths = []
        for start in starts:
            d, v, dry = np.zeros((3, len(self.load)))
            follow_loose(*link, self.step, parts, late, *flanks, *start, d, v, dry)
            paths.append((d, v, dry))
        return paths


def steps_per_sample(step: float, stiffness: float, inertia: float, finest: float) -> int:
    """Return into how many steps (a power of two) a sample is cut for a flank to be drawn."""
    most = max(1.0, step / finest)
    wanted = step * np.sqrt(stiffness / inertia) / _TURN
    return int(2 ** np.ceil(np.log2(np.clip(wanted, 1.0, most))))


def weight_of_the_end(stiffness: FloatArray, inertia: float, step: float) -> FloatArray:
    """Return theta of the step: 1/2 takes no energy out, 1 damps a flank too stiff to draw."""
    return np.where(stiffness * step**2 < inertia, 0.5, 1.0)
