"""The levels of priority of all sets of contacts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.control.memory import GEAR
from wbc.control.qp.level import Level
from wbc.control.qp.program import Program, Recipe
from wbc.control.rows.contacts import BoundContact, ContactSet
from wbc.control.rows.schedule import ContactRamp

_FEW = 4
_POSES = 3
# A row that others decide keeps 1e-16 of its length, an independent one 1e-3 at a drawn pose.
_DEPENDENT = 1e-9


class Levels:
    """The levels of all sets of contacts, each with a warm start of its own.

    With up to four contacts those of all sets are made at once, so that no tick has to: one takes
    as long as ten ticks.

    Several points of one rigid body repeat each other, as do the feet of a robot that has few
    joints between them: how many rows of contacts are independent is told at drawn poses.

    Attributes:
        whole: all contacts.
        shared: size of the part of a block of results that all programs have, see `PART`.
    """

    def __init__(self, recipe: Recipe, contacts: Mapping[str, BoundContact]) -> None:
        """Remember what programs are made of."""
        self._recipe, self._contacts, self._all = recipe, dict(contacts), tuple(contacts)
        robot, kinematics, generator = recipe.robot, recipe.kinematics, np.random.default_rng(0)
        model, m = robot.model, robot.transmission.size
        self.shared = model.nq + 3 * model.nv + len(GEAR) * m
        self.whole = ContactSet(tuple(contacts.values()), kinematics.model)
        self._drawn: list[FloatArray] = []
        for _ in range(_POSES):
            step = generator.uniform(-1.0, 1.0, model.nv)
            kinematics.update(pin.integrate(model, robot.neutral(), step), np.zeros(model.nv))
            self.whole.fill(kinematics)
            self._drawn.append(self.whole.memory.rows.jacobian.copy())
        self._made: dict[tuple[str, ...], tuple[Level, ...]] = {}
        self._ramp: ContactRamp | None = None
        if self._all and (down := recipe.settings.contact_ramp) > 0.0:
            self._ramp = ContactRamp(self._all, recipe.load, down, rise=0.5 * down)
        self._fresh, self._settled = True, False
        self._wanted: dict[str, float] | None = None
        self._last: tuple[tuple[Level, ...], Mapping[str, float]] = (), {}
        for count in range(len(self._all) + 1 if len(self._all) <= _FEW else 0):
            for names in combinations(self._all, count):
                self._of(names)

    def forget(self) -> None:
        """Start the next tick of every contact set from nothing."""
        self._fresh, self._settled = True, False
        for levels in self._made.values():
            for level in levels:
                level.forget()

    def of(
        self, wanted: Mapping[str, float] | None, dt: float
    ) -> tuple[tuple[Level, ...], Mapping[str, float]]:
        """Return the levels for the contacts that may carry force, and their ceilings [N].

        Args:
            wanted: ceilings that are asked for; None for all contacts without any.
            dt: time until the next tick [s].
        """
        if self._settled and wanted == self._wanted:
            return self._last
        ramp, names = self._ramp, self._all
        asked = dict.fromkeys(names, np.inf) if wanted is None else wanted
        asked = {name: asked[name] for name in names if asked.get(name, 0.0) > 0.0}
        ceilings: Mapping[str, float] = asked
        if ramp is not None:
            ceilings = ramp.step(asked, dt, at_once=self._fresh)
        self._fresh, self._settled = False, ceilings == asked
        self._wanted = None if wanted is None else dict(wanted)
        self._last = self._of(tuple(ceilings)), ceilings
        return self._last

    def _of(self, names: tuple[str, ...]) -> tuple[Level, ...]:
        """Return the levels for some contacts, in the order of all."""
        levels = self._made.get(names)
        if levels is None:
            recipe, chosen = self._recipe, [self._contacts[name] for name in names]
            contacts = ContactSet(tuple(chosen), recipe.kinematics.model, self._rank(names))
            ranks = range(len(recipe.stacks))
            levels = tuple(Level(Program(recipe, contacts, rank), rank) for rank in ranks)
            self._made[names] = levels
        return levels

    def _rank(self, names: Sequence[str]) -> int:
        """Return the greatest number of independent rows of some contacts."""
        if not names:
            return 0
        slices, ranks = dict(zip(self._all, self.whole.slices, strict=True)), list[int]()
        at = np.r_[tuple(slices[name] for name in names)]
        for jacobian in self._drawn:
            rows, lengths = jacobian[at], np.linalg.norm(jacobian[at], axis=1)
            rows = rows[lengths > 0.0] / lengths[lengths > 0.0, None]
            ranks.append(np.linalg.matrix_rank(rows, tol=_DEPENDENT * np.sqrt(rows.size)))
        return max(ranks)
