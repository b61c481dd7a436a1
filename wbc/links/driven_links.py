"""Links behind gears that yield as one motion: what drives them, and where they go from a start."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from wbc.arrays import FloatArray
from wbc.links.response import LinkFriction, LinkResponse
from wbc.transmission import Flanks

FINEST = 5e-4
"""The shortest step [s], of a link on stiff flanks."""
COARSE = 2e-3
"""The same while flanks and beginnings are only ranked."""
_STEP = 1e-3  # [s] behind a spring: the frequency of a swing w is wrong by the share (w h)^2 / 12
_TURN = 0.25  # [rad] of the swing on a flank that one step may cover
_POSES = 200  # of a log in which inertias are compared
_FARTHEST = 2.0 * np.pi  # [rad]: a link that strays by a whole turn is behind no gear


@dataclass(frozen=True, eq=False)
class DrivenLinks:
    """What drives n links behind gears that yield, along a log.

    Attributes:
        inertia, drag, pull: of the links, without their gears (N, n, n): what row i feels of the
            acceleration, rate and deflection of joint j.
        load: torque of the links without deflection (N, n).
        speed, level, counted: of the motors, of the links' dry friction, and the friction that the
            load has already (N, n).
        step: distance of the samples [s].
    """

    inertia: FloatArray
    drag: FloatArray
    pull: FloatArray
    load: FloatArray
    speed: FloatArray
    level: FloatArray
    counted: FloatArray
    step: float
    _between: dict[int, FloatArray] = field(default_factory=dict)

    @classmethod
    def of(cls, responses: Sequence[LinkResponse]) -> DrivenLinks:
        """Return what drives these links along one log, under the same load."""
        rows, nothing = [r.row for r in responses], np.zeros(len(responses[0].load))

        def coupled(name: str) -> FloatArray:
            return np.stack([getattr(r, name)[:, rows] for r in responses], axis=-1)

        def rubbing(name: str) -> FloatArray:
            without = LinkFriction(nothing, nothing, nothing)
            return np.stack([getattr(r.friction or without, name) for r in responses], axis=1)

        return cls(
            *(coupled("inertia"), coupled("damping"), coupled("stiffness")),
            responses[0].load[:, rows],
            *(rubbing("velocity"), rubbing("level"), rubbing("counted")),
            responses[0].step,
        )

    @cached_property
    def least_inertia(self) -> FloatArray:
        """What each link (n,) weighs on its flank where all others are free to give way."""
        few = self.inertia[:: max(1, len(self.inertia) // _POSES)]
        freedom = np.diagonal(np.linalg.inv(few), axis1=1, axis2=2)
        return np.asarray(1.0 / np.max(freedom, axis=0))

    @cached_property
    def rubs(self) -> bool:
        """Whether any link has dry friction."""
        return bool(self.level.any())

    def reacts_as(self, other: DrivenLinks) -> bool:
        """Whether the links react to their deflections as others do, whatever loads them."""
        names = "inertia", "drag", "pull", "level"
        return all(np.array_equal(getattr(self, name), getattr(other, name)) for name in names)

    def part(self, samples: slice) -> DrivenLinks:
        """Return some of the samples."""
        names = (f.name for f in fields(self) if f.name not in ("step", "_between"))
        cut = {name: getattr(self, name)[samples] for name in names}
        return replace(self, **cut, _between={})

    def follow(
        self, gears: Sequence[Flanks], starts: FloatArray, coarsest: float = 0.0
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return deflections, rates and friction (N, n, S); infinite where a link flies off.

            inertia d_dd + drag d_d + pull d + load + friction = torque of the gears (`Flanks`)

        for all links at once: one that strikes its flank throws the others through the off-diagonal
        inertia. Friction takes any value within its level while a link, not its motor, stands
        still, so that a link that sticks winds up its gear. Neither a swing nor a flank that is
        reached gains or loses energy by the step, unless a flank is too stiff to draw: its swing
        then dies (`flank_impulse`).

        Args:
            gears: of the links (n,).
            starts: (2, n, S) deflections and rates at the beginning.
            coarsest: [s] no step need be shorter, where motions are only ranked.
        """
        from wbc.links.steps import follow_links  # it loads the compiler

        numbers = np.array([(g.stiffness, g.damping, 0.5 * g.play) for g in gears], dtype=float)
        stiffness, damping, half = np.ascontiguousarray(numbers.T)
        parts = self._parts(gears, coarsest)
        h = self.step / parts
        late = np.where(stiffness * h**2 < self.least_inertia, 0.5, 1.0)
        d, v, dry = np.zeros((3, *self.load.shape, starts.shape[2]))
        d[0], v[0] = starts
        whole = np.ascontiguousarray
        follow_links(
            whole(self.inertia), whole(self.drag), whole(self.pull),
            whole(self._loads(parts)), whole(self.speed), whole(self.level),
            self.step, parts, late, stiffness, damping, half, _FARTHEST, d, v, dry,
        )  # fmt: skip
        return d, v, dry

    def torques(
        self, gears: Sequence[Flanks], starts: FloatArray, coarsest: float = 0.0
    ) -> FloatArray:
        """Return the links' additional torques (N, n, S) from starts, for ranking.

        Accelerations are taken over each interval, which keeps the impulse of a strike that is
        shorter; the last row stays zero. See `follow` for the arguments.
        """
        from wbc.links.steps import torques_of

        d, v, dry = self.follow(gears, starts, coarsest)
        torques = np.zeros_like(d)
        whole = np.ascontiguousarray
        torques_of(
            whole(self.inertia), whole(self.drag), whole(self.pull), whole(self.counted),
            self.step, d, v, dry, torques,
        )  # fmt: skip
        return torques

    def _parts(self, gears: Sequence[Flanks], coarsest: float) -> int:
        """Return into how many steps a sample is cut."""
        parts = 1
        for gear, inertia in zip(gears, self.least_inertia, strict=True):
            if gear.play == 0.0:
                parts = max(parts, round(self.step / max(_STEP, coarsest)))
                continue
            most = max(1.0, self.step / max(FINEST, coarsest))
            wanted = self.step * np.sqrt(gear.stiffness / inertia) / _TURN
            parts = max(parts, int(2 ** np.ceil(np.log2(np.clip(wanted, 1.0, most)))))
        return parts

    def _loads(self, parts: int) -> FloatArray:
        """Return the load at the steps ((N - 1) parts + 1, n)."""
        if parts == 1:
            return self.load
        if parts not in self._between:
            count = len(self.load)
            fine = np.arange((count - 1) * parts + 1) / parts
            self._between[parts] = CubicSpline(np.arange(count), self.load)(fine)
        return self._between[parts]
