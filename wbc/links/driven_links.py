"""Links behind gears that yield as one motion: how they react, what drives them, where they go."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import astuple, dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from wbc.arrays import FloatArray, IntArray
from wbc.transmission import Flanks


@dataclass(frozen=True, eq=False)
class LinkFriction:
    """Dry friction that holds the link behind a gear, along a log.

    Attributes:
        velocity: (N,) of the motor, at the joint [rad/s]; the link's is larger by d_d.
        level: (N,) >= 0 of the friction [N m].
        counted: (N,) friction of a link without deflection, level sgn(velocity) [N m]: what is
            unexplained has it, the load does not.
    """

    velocity: FloatArray
    level: FloatArray
    counted: FloatArray


@dataclass(frozen=True, eq=False)
class LinkResponse:
    """How the link behind one gear reacts to a small deflection d of the gear, along a log.

    The link is at q = motor + d. The torque balance of the links, linear in d:

        inertia d_dd + damping d_d + stiffness d + load = torque the gears pass on

    With several soft gears the left side is the sum over their deflections. Dry friction of the
    link adds a torque between -level and level that opposes its speed; a deflection then has a
    fourth column, that torque.

    Attributes:
        step: distance of the samples [s].
        row: index of the joint in v.
        load: (N, nv) torque the links need without deflection [N m].
        inertia: (N, nv) column of the mass matrix [kg m^2].
        damping: (N, nv) derivative of the load by this joint's velocity [N m s/rad].
        stiffness: (N, nv) derivative of the load by this joint's position [N m/rad].
        unexplained: (N,) torque that the log shows and the stiff robot does not explain [N m]: what
            the deflection may account for. How the link moved when the log began is in no
            channel, and is chosen by it.
        band: filter along the first axis to the frequencies in which the torques are compared; it
            takes a log, or the beginning of one.
        rows: numbers of the samples that the filter returns.
        friction: dry friction of the link; None where there is none, or where it rubs at the motor.
    """

    step: float
    row: int
    load: FloatArray
    inertia: FloatArray
    damping: FloatArray
    stiffness: FloatArray
    unexplained: FloatArray
    band: Callable[[FloatArray], FloatArray]
    rows: IntArray
    friction: LinkFriction | None = None

    def beginning(self, seconds: float) -> LinkResponse:
        """Return the response along so much of the log."""
        count = int(seconds / self.step)
        if count >= len(self.unexplained):
            return self
        names = "load", "inertia", "damping", "stiffness", "unexplained"
        own = self.friction
        return replace(
            self,
            **{name: getattr(self, name)[:count] for name in names},
            rows=self.rows[self.rows < count - self.rows[0]],
            friction=None if own is None else LinkFriction(*(v[:count] for v in astuple(own))),
        )

    def torque(self, deflection: FloatArray) -> FloatArray:
        """Return the additional torque (N, nv) of a deflection (N, 3): d, its rate, its second.

        Where the link has dry friction, a fourth column is that.
        """
        result = np.asarray(
            self.stiffness * deflection[:, [0]]
            + self.damping * deflection[:, [1]]
            + self.inertia * deflection[:, [2]]
        )
        if self.friction is not None:
            result[:, self.row] += deflection[:, 3] - self.friction.counted
        return result

    def left(self, torques: FloatArray) -> FloatArray:
        """Return what additional torques (N, ...) at the joint leave unexplained, in the band."""
        size = (len(self.unexplained),) + (1,) * (np.ndim(torques) - 1)
        return self.band(self.unexplained.reshape(size) - torques)


_FINEST = 5e-4  # [s], the shortest step, of a link on stiff flanks
_STEP = 1e-3  # [s] behind a spring: the frequency of a swing w is wrong by the share (w h)^2 / 12
_TURN = 0.25  # [rad] of the swing on a flank that one step may cover
_POSES = 200  # of a log in which inertias are compared
_FARTHEST = 2.0 * np.pi  # [rad]: a link that strays by a whole turn is behind no gear


class Motions(NamedTuple):
    """How n links move in front of their motors, S times.

    Behind springs accelerations are those of the balance at the samples. A strike may be shorter
    than the distance of two samples: behind play they are means over the intervals beside a sample,
    which keeps the impulse and its time. So is dry friction.

    Attributes:
        d, v: (N, n, S) deflections and their rates; those with which a window begins where one
            does.
        a: (N, n, S) their accelerations.
        dry: (N, n, S) dry friction of the links [N m].
        reached: (N, n, S) rates at the ends of the intervals that begin with a sample; the last one
            stays.
        rubbed: (N, n, S) mean dry friction in these intervals [N m].
        ends: (W, 2, n, S) deflections and rates at the ends of the windows.
    """

    d: FloatArray
    v: FloatArray
    a: FloatArray
    dry: FloatArray
    reached: FloatArray
    rubbed: FloatArray
    ends: FloatArray


@dataclass(frozen=True, eq=False)
class DrivenLinks:
    """What drives n links behind gears that yield, along a log.

    Attributes:
        gears: in front of the links.
        inertia, drag, pull: of the links, without their gears (N, n, n): what row i feels of the
            acceleration, rate and deflection of joint j.
        load: torque of the links without deflection (N, n).
        speed, level, counted: of the motors, of the links' dry friction, and the friction that the
            load has already (N, n).
        step: distance of the samples [s].
        coarse: times as long as usual are the steps between.
    """

    gears: Sequence[Flanks]
    inertia: FloatArray
    drag: FloatArray
    pull: FloatArray
    load: FloatArray
    speed: FloatArray
    level: FloatArray
    counted: FloatArray
    step: float
    coarse: float

    @classmethod
    def of(
        cls, responses: Sequence[LinkResponse], gears: Sequence[Flanks], coarse: float
    ) -> DrivenLinks:
        """Return what drives these links along one log, under the same load."""
        rows, load, step = [r.row for r in responses], responses[0].load, responses[0].step
        parts = [[r.inertia, r.damping, r.stiffness] for r in responses]
        inertia, drag, pull = np.take(np.stack(parts, axis=-1), rows, axis=2)
        still = LinkFriction(*np.zeros((3, len(load))))
        rubbing = [astuple(r.friction or still) for r in responses]
        speed, level, counted = np.stack(rubbing, axis=-1)
        motors = speed, level, counted
        return cls(gears, inertia, drag, pull, load[:, rows], *motors, step, coarse)

    @cached_property
    def least_inertia(self) -> FloatArray:
        """What each link (n,) weighs on its flank where all others are free to give way."""
        few = self.inertia[:: max(1, len(self.inertia) // _POSES)]
        freedom = np.diagonal(np.linalg.inv(few), axis1=1, axis2=2)
        return np.asarray(1.0 / np.max(freedom, axis=0))

    @cached_property
    def bounces(self) -> bool:
        """Whether any gear has play."""
        return any(gear.play > 0.0 for gear in self.gears)

    @cached_property
    def rubs(self) -> bool:
        """Whether any link has dry friction."""
        return bool(self.level.any())

    def follow(self, first: IntArray, starts: FloatArray) -> Motions:
        """Return motions, infinite where a link flies off.

            inertia d_dd + drag d_d + pull d + load + friction = torque of the gears (`Flanks`)

        for all links at once: one that strikes its flank throws the others through the off-diagonal
        inertia. Friction takes any value within its level while a link, not its motor, stands
        still, so that a link that sticks winds up its gear. Neither a swing nor a flank that is
        reached gains or loses energy by the step, unless a flank is too stiff to draw: its swing
        then dies (`flank_impulse`).

        Args:
            first: number of the first sample of each window (W,), from 0 on.
            starts: (W, 2, n, S) deflections and rates with which the windows begin.
        """
        from wbc.links.steps import LINKS, follow_links  # it loads the compiler

        parts, flanks = self.parts, np.zeros((len(self.gears), 9))
        h = self.step / parts
        for flank, gear, inertia in zip(flanks, self.gears, self.least_inertia, strict=True):
            late = 0.5 if gear.stiffness * h**2 < inertia else 1.0
            flank[:6] = gear.stiffness, gear.damping, 0.5 * gear.play, h, late, late
        names = "inertia", "drag", "pull", "speed", "level"
        given = {name: getattr(self, name) for name in names}
        given |= {"load": self.loads, "gears": flanks, "first": first, "starts": starts}
        whole = {name: np.ascontiguousarray(array) for name, array in given.items()}
        count, n = self.load.shape
        sizes = {"N": count, "n": n, "W": len(first), "S": starts.shape[3]}
        links = LINKS.of(sizes, **whole, parts=parts)
        follow_links(links, self.step, _FARTHEST)
        v, ends = links.v, links.ends
        reached = np.concatenate([v[1:], v[-1:]])  # where windows end, not where others begin
        reached[first[1:] - 1] = ends[:-1, 1]
        return self.motions((links.d, v, reached, links.dry, ends))

    def motions(self, parts: Iterable[FloatArray]) -> Motions:
        """Return motions of which d, v, reached, rubbed and ends are known, see `Motions`."""
        d, v, reached, rubbed, ends = parts
        dry = at_samples(rubbed)
        if self.bounces:
            a = at_samples((reached - v) / self.step)
        else:
            torques = [gear.torque(d[:, k], v[:, k]) for k, gear in enumerate(self.gears)]
            needed = self.drag @ v + self.pull @ d + self.load[..., None] + dry
            a = np.asarray(np.linalg.solve(self.inertia, np.stack(torques, axis=1) - needed))
        return Motions(d, v, a, dry, reached, rubbed, ends)

    def torques(self, moved: Motions) -> FloatArray:
        """Return the links' additional torques (N, n, S) along motions."""
        rubs = moved.dry - self.counted[..., None]
        return self.inertia @ moved.a + self.drag @ moved.v + self.pull @ moved.d + rubs

    @cached_property
    def parts(self) -> int:
        """Into how many steps a sample is cut."""
        parts = 1
        for gear, inertia in zip(self.gears, self.least_inertia, strict=True):
            if gear.play == 0.0:
                parts = max(parts, round(self.step / (self.coarse * _STEP)))
                continue
            most = max(1.0, self.step / _FINEST)
            wanted = self.step * np.sqrt(gear.stiffness / inertia) / (self.coarse * _TURN)
            parts = max(parts, int(2 ** np.ceil(np.log2(min(max(wanted, 1.0), most)))))
        return parts

    @cached_property
    def loads(self) -> FloatArray:
        """The load at the steps ((N - 1) parts + 1, n)."""
        if self.parts == 1:
            return self.load
        count = len(self.load)
        fine = np.arange((count - 1) * self.parts + 1) / self.parts
        return np.asarray(CubicSpline(np.arange(count), self.load)(fine))


def at_samples(means: FloatArray) -> FloatArray:
    """Return means of intervals (N, ...), the last one missing, at the samples between them."""
    result = np.array(means)
    result[-1] = means[-2]
    result[1:] = 0.5 * (result[1:] + result[:-1])
    return result
