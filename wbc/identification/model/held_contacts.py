"""What contacts that hold say about encoders: their points do not move."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.identification.model.columns import STEP
from wbc.identification.model.fit import Fit, beside_others
from wbc.identification.model.residual import with_changes
from wbc.identification.records.contacts import settled, stray_noise, strays
from wbc.identification.records.record import Record, correlated_rows
from wbc.robot import Effect, Robot

_STEPS = 4  # Gauss-Newton steps to the most probable zeros
_LEAST = 1e-9  # of the largest variance: below it an axis cannot move at all


@dataclass(frozen=True, eq=False)
class HeldContacts:
    """The contacts of a set of logs whose forces no sensor measured, while they hold.

    Attributes:
        robot: as believed.
        records: one per log.
        names: of the contacts.
        axes: numbers of the contacts' axes that can move.
        noise: (axes,) mean square [m^2] that the encoders' noise makes of what does not move.
        samples: (axes,) independent samples of all logs together.
        first: (axes,) mean square of what moves as the encoders report it, over `noise`.
    """

    robot: Robot
    records: tuple[Record, ...]
    names: tuple[str, ...]
    axes: IntArray
    noise: FloatArray
    samples: FloatArray
    first: FloatArray

    @classmethod
    def of(cls, robot: Robot, records: Sequence[Record]) -> Self | None:
        """Return the contacts that hold, None where there are none."""
        if not robot.floating_size or not any(record.active for record in records):
            return None
        names = list(dict.fromkeys(name for record in records for name in record.active))
        rows = [_rows(robot, record, names) for record in records]
        variances = [np.nan_to_num(r.noise.position) * r.bandwidth.kinematics for r in records]
        each = zip(rows, variances, strict=True)
        noise = np.concatenate([stray_noise(robot, *row, v) for row, v in each]).mean(axis=0)
        axes = np.flatnonzero(noise > _LEAST * np.max(noise, initial=0.0))
        if not axes.size:
            return None
        parts = [strays(robot, *row)[:, axes] for row in rows]
        first = np.mean(np.concatenate(parts) ** 2, axis=0) / noise[axes]
        held = np.concatenate([np.stack([*holds.values()], axis=1) for _, holds in rows])
        samples = np.repeat(held.sum(axis=0), 3)[axes] / correlated_rows(parts, 1.0)
        return cls(robot, tuple(records), tuple(names), axes, noise[axes], samples, first)

    def evidence(self, fit: Fit, noise: FloatArray) -> float:
        """Return by how much a fit makes it more probable that contacts hold [nats].

        Their movement is as likely as a Gaussian of unknown size allows, never below that of the
        encoders' noise; n independent samples with mean squares s cost n/2 log max(s, 1). The fit's
        zeros go to where they are most probable beside what the torques say of them.

        Args:
            fit: of the causes.
            noise: (outputs,) mean square of what a fit leaves over independent samples per row.
        """
        slots = [
            (row, k)
            for row, (k, _) in enumerate(fit.parameters)
            if "true" in fit.effects[k].acts_by
        ]
        if not slots or fit.failed:
            return 0.0
        known = _marginal(fit, noise, [row for row, _ in slots])
        effects, moved = fit.effects, np.zeros(len(slots))
        ways = self._strays(effects)
        best = self._cost(ways)
        for _ in range(_STEPS):
            step = self._step(fit, effects, slots, ways, known, moved)
            for length in (1.0, 0.5, 0.25):
                there = moved + length * step
                changed = _changed(fit, slots, there)
                trial = self._strays(changed)
                cost = self._cost(trial) + 0.5 * float(there @ known @ there)
                if cost < best:
                    break
            else:
                break
            gain, best = best - cost, cost
            effects, moved, ways = changed, there, trial
            if gain < 0.1:
                break
        return 0.5 * float(self.samples @ np.log(np.maximum(self.first, 1.0))) - best

    def _cost(self, ways: FloatArray) -> float:
        squares = np.maximum(np.mean(ways**2, axis=0), 1.0)
        return 0.5 * float(self.samples @ np.log(squares))

    def _step(
        self,
        fit: Fit,
        effects: tuple[Effect, ...],
        slots: Sequence[tuple[int, int]],
        ways: FloatArray,
        known: FloatArray,
        moved: FloatArray,
    ) -> FloatArray:
        """Return the Gauss-Newton step (k,) of the zeros, in units of their scales."""
        columns = [
            (self._strays(_changed(fit, slots, moved + STEP * unit)) - ways) / STEP
            for unit in np.eye(len(slots))
        ]
        squares = np.maximum(np.mean(ways**2, axis=0), 1.0)
        weight = np.sqrt(self.samples / squares / len(ways))
        a = np.stack([(column * weight).ravel() for column in columns], axis=1)
        gram = a.T @ a + known
        moment = a.T @ (ways * weight).ravel() + known @ moved
        return np.asarray(-np.linalg.lstsq(gram, moment, rcond=1e-9)[0])

    def _strays(self, effects: Sequence[Effect]) -> FloatArray:
        """Return (rows, axes) what the contacts move by, over the deviation of noise."""
        robot = self.robot.with_effects(*effects)
        parts = [strays(robot, *_rows(robot, record, self.names)) for record in self.records]
        return np.asarray(np.concatenate(parts)[:, self.axes] / np.sqrt(self.noise))


def _rows(
    robot: Robot, record: Record, names: Sequence[str]
) -> tuple[FloatArray, dict[str, BoolArray]]:
    """Return q (rows, nq) as the effects of a robot say it truly is, and when contacts hold."""
    motion = record.motion_of(robot)
    edge = 1 + int(record.rate / record.bandwidth.kinematics)
    none = np.zeros(len(record.torque), dtype=bool)
    touches = {name: record.active.get(name, none) for name in names}
    holds = {
        name: record.thinned(settled(rows, edge).astype(float)) > 0.5
        for name, rows in touches.items()
    }
    return record.thinned(motion.position), holds


def _marginal(fit: Fit, noise: FloatArray, rows: Sequence[int]) -> FloatArray:
    """Return (k, k) what the torques know of some parameters while all others are free.

    In squared standard deviations, per scale of each parameter.
    """
    count = len(fit.parameters)
    a = (fit.jacobian / np.sqrt(noise)[:, None]).reshape(-1, count)
    gram = a.T @ a + fit.usual.jacobian.T @ fit.usual.jacobian
    return beside_others(gram, rows)


def _changed(fit: Fit, slots: Sequence[tuple[int, int]], change: FloatArray) -> tuple[Effect, ...]:
    """Return the effects of a fit with parameters changed, in units of their scales."""
    changes = {}
    for (row, k), step in zip(slots, change, strict=True):
        parameter = fit.parameters[row][1]
        changes[k, parameter.name] = float(step) * parameter.scale
    return tuple(with_changes(fit.effects, changes, clip=True))
