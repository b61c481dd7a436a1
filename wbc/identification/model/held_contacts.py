"""What contacts that hold say about encoders: their points do not move."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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

_STEPS = 4  # rounds in which zeros and the sizes of movements settle
_LEAST = 1e-9  # of the largest variance: below it an axis cannot move at all


@dataclass(frozen=True, eq=False)
class HeldContacts:
    """The contacts of a set of logs whose forces no sensor measured, while they hold.

    Attributes:
        robot: as believed.
        records: one per log.
        holds: one per log: contact name -> (rows,) whether it holds.
        axes: numbers of the contacts' axes that can move.
        noise: (axes,) mean square [m^2] that the encoders' noise makes of what does not move.
        samples: (axes,) independent samples of all logs together.
        first: (axes,) mean square of what moves as the encoders report it, over `noise`.
    """

    robot: Robot
    records: tuple[Record, ...]
    holds: tuple[Mapping[str, BoolArray], ...]
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
        rows = [(_position(robot, record), _holds(record, names)) for record in records]
        variances = [np.nan_to_num(r.noise.position) * r.bandwidth.kinematics for r in records]
        each = zip(rows, variances, strict=True)
        noise = np.concatenate([stray_noise(robot, *row, v) for row, v in each]).mean(axis=0)
        axes = np.flatnonzero(noise > _LEAST * np.max(noise, initial=0.0))
        if not axes.size:
            return None
        parts = [strays(robot, *row)[:, axes] for row in rows]
        first = np.mean(np.concatenate(parts) ** 2, axis=0) / noise[axes]
        holds = tuple(held for _, held in rows)
        held = np.concatenate([np.stack([*each.values()], axis=1) for each in holds])
        samples = np.repeat(held.sum(axis=0), 3)[axes] / correlated_rows(parts, 1.0)
        return cls(robot, tuple(records), holds, axes, noise[axes], samples, first)

    def evidence(self, fit: Fit, noise: FloatArray) -> float:
        """Return by how much a fit makes it more probable that contacts hold [nats].

        Their movement is as likely as a Gaussian of unknown size allows, never below that of the
        encoders' noise; n independent samples with mean squares s cost n/2 log max(s, 1). The fit's
        zeros go to where they are most probable beside what the torques say of them.

        Args:
            fit: of the causes.
            noise: (outputs,) mean square of what a fit leaves over independent samples per row.
        """
        zeros = [k for k, effect in enumerate(fit.effects) if "true" in effect.acts_by]
        rows = [row for row, (k, _) in enumerate(fit.parameters) if k in zeros]
        if not rows or fit.failed:
            return 0.0
        a = (fit.jacobian / np.sqrt(noise)[:, None]).reshape(-1, len(fit.parameters))
        usual = fit.usual.jacobian
        known = beside_others(a.T @ a + usual.T @ usual, rows)

        def ways(step: FloatArray) -> FloatArray:
            """Return what the contacts move by with zeros changed, in units of their scales."""
            slots = zip([fit.parameters[row] for row in rows], step.tolist(), strict=True)
            changes = {(k, p.name): change * p.scale for (k, p), change in slots}
            return self._strays(with_changes(fit.effects, changes, clip=True))

        here = ways(np.zeros(len(rows)))
        slopes = np.stack([(ways(one) - here) / STEP for one in STEP * np.eye(len(rows))], axis=2)
        left = here
        costs = [self._cost(here)]
        for _ in range(_STEPS):
            weight = np.sqrt(self.samples / _squares(left) / len(left))
            a = (slopes * weight[:, None]).reshape(-1, len(rows))
            moved = -np.linalg.lstsq(a.T @ a + known, a.T @ (here * weight).ravel(), rcond=1e-9)[0]
            left = here + slopes @ moved
            costs.append(self._cost(left) + 0.5 * float(moved @ known @ moved))
        first = 0.5 * float(self.samples @ np.log(np.maximum(self.first, 1.0)))
        return first - min(costs)

    def _cost(self, ways: FloatArray) -> float:
        return 0.5 * float(self.samples @ np.log(_squares(ways)))

    def _strays(self, effects: Sequence[Effect]) -> FloatArray:
        """Return (rows, axes) what the contacts move by, over the deviation of noise."""
        robot = self.robot.with_effects(*effects)
        logs = zip(self.records, self.holds, strict=True)
        parts = [strays(robot, _position(robot, record), holds) for record, holds in logs]
        return np.asarray(np.concatenate(parts)[:, self.axes] / np.sqrt(self.noise))


def _position(robot: Robot, record: Record) -> FloatArray:
    """Return q (rows, nq) as the effects of a robot say it truly is."""
    return record.thinned(record.motion_of(robot).position)


def _holds(record: Record, names: Sequence[str]) -> dict[str, BoolArray]:
    """Return when (rows,) each contact holds in a log."""
    edge = 1 + int(record.rate / record.bandwidth.kinematics)
    none = np.zeros(len(record.torque), dtype=bool)
    return {
        name: record.thinned(settled(record.active.get(name, none), edge).astype(float)) > 0.5
        for name in names
    }


def _squares(ways: FloatArray) -> FloatArray:
    """Return (axes,) the mean squares of strays (rows, axes), never below those of noise."""
    return np.asarray(np.maximum(np.mean(ways**2, axis=0), 1.0))
