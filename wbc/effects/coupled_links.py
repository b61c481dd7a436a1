"""Links behind gears with play as one motion: what drives them, and where they go from a start."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects.flanks import FINEST, Contact, steps_per_sample, weight_of_the_end
from wbc.robot import LinkFriction, LinkResponse


@dataclass(frozen=True, eq=False)
class CoupledLinks:
    """What drives n links behind gears with play along a log.

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

    @classmethod
    def of(cls, responses: Sequence[LinkResponse]) -> CoupledLinks:
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
        freedom = np.diagonal(np.linalg.inv(self.inertia), axis1=1, axis2=2)
        return np.asarray(1.0 / np.max(freedom, axis=0))

    def part(self, samples: slice) -> CoupledLinks:
        """Return some of the samples."""
        names = (f.name for f in fields(self) if f.name != "step")
        return replace(self, **{name: getattr(self, name)[samples] for name in names})

    def follow(
        self, contacts: Sequence[Contact], start: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return deflections, rates and dry friction (N, n) from a start (2, n)."""
        from wbc.effects.link_steps import follow_striking  # it loads the compiler

        d, v, dry = np.zeros((3, *self.load.shape))
        d[0], v[0] = start
        links = self.inertia, self.drag, self.pull, self.load, self.speed, self.level
        follow_striking(*links, *self._steps(contacts, FINEST), d, v, dry)
        return d, v, dry

    def torques(self, contacts: Sequence[Contact], starts: FloatArray, finest: float) -> FloatArray:
        """Return additional torques (N, n, B) from starts (B, 2, n)."""
        from wbc.effects.link_steps import rank_striking  # it loads the compiler

        torques = np.zeros((*self.load.shape, len(starts)))
        links = self.inertia, self.drag, self.pull, self.load, self.speed, self.level
        rank_striking(*links, self.counted, *self._steps(contacts, finest), starts, torques)
        return torques

    def _steps(
        self, contacts: Sequence[Contact], finest: float
    ) -> tuple[float, int, FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return samples' distance, steps per sample, theta, and the flanks' numbers (n,)."""
        stiffness, damping, play = (
            np.array([getattr(contact, name) for contact in contacts], dtype=float)
            for name in ("stiffness", "damping", "play")
        )
        pairs = list(zip(stiffness, self.least_inertia, strict=True))
        parts = max(steps_per_sample(self.step, k, m, finest) for k, m in pairs)
        h = self.step / parts
        late = np.array([float(weight_of_the_end(np.array(k), m, h)) for k, m in pairs])
        return self.step, parts, late, stiffness, damping, 0.5 * play
