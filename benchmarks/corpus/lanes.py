"""Flaws of many runs as arrays over lanes, for the plant in closed loop."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.corpus.flaws import AtJoints, Flaw, changed_machine, loss_gains, per_joint
from benchmarks.corpus.machine import Machine
from benchmarks.corpus.unlisted import UnlistedTorques

_DRIVES = {
    "factor": ("torque_constant", "factor", 1.0),
    "offset": ("torque_offset", "offset", 0.0),
    "delay": ("actuation_delay", "delay", 0.0),
    "limit": ("current_limit", "limit", np.inf),
    "fading": ("thermal_drift", "rate", 0.0),
    "warming": ("thermal_drift", "time_constant", 1.0),
    "dead": ("torque_dead_zone", "size", 0.0),
    "soft_drive": ("soft_saturation", "size", 0.0),
    "lash": ("backlash", "width", 0.0),
}


class Lanes(AtJoints):
    """What is wrong in every lane: (B, 2) arrays, those of drives named as in `_DRIVES`."""

    def __init__(self, machines: Sequence[Machine], flaws: Sequence[Sequence[Flaw]]) -> None:
        pairs = list(zip(machines, flaws, strict=True))
        self.machines = [changed_machine(machine, found) for machine, found in pairs]

        def everywhere(effect: str, parameter: str, absent: float) -> np.ndarray:
            return _table([per_joint(m, f, effect, parameter, absent) for m, f in pairs], absent)

        super().__init__(everywhere)
        self._values |= {name: everywhere(*entry) for name, entry in _DRIVES.items()}
        self.rotor = _table([m.reflected for m in self.machines], 1e-3)
        gains = [loss_gains(m, f) for m, f in pairs]
        # Friction as a share of the mesh torque, while the motor drives and the joint drives.
        self.forward = 1.0 - 1.0 / _table([g[0] for g in gains], 1.0)
        self.backward = 1.0 / _table([g[1] for g in gains], 1.0) - 1.0
        self.sag = np.array(
            [sum(x.values["coefficient"] for x in f if x.effect == "supply_sag") for f in flaws]
        )
        self.stiffness = _soft(pairs, "stiffness", np.inf)
        self.damping = _soft(pairs, "damping", 0.0)
        self._unlisted = [UnlistedTorques(m, f) for m, f in pairs]

    def drive(self, command: np.ndarray, omega: np.ndarray, t: float) -> np.ndarray:
        """Return the torque (B, 2) that arrives on the rotors for the reported one."""
        torque = np.clip(command, -self.limit, self.limit)
        power = np.maximum(np.sum(command * omega, axis=1, keepdims=True), 0.0)
        torque = torque * (1.0 - self.sag[:, None] * power)
        warm = self.warming * (1.0 - np.exp(-t / self.warming))
        torque = torque * self.factor * (1.0 - self.fading * warm)
        torque = torque - np.clip(torque, -self.dead, self.dead)
        return torque / (1.0 + self.soft_drive * np.abs(torque)) + self.offset

    def unlisted(
        self, h: float, t: float, q: np.ndarray, v: np.ndarray, a: np.ndarray, into: np.ndarray
    ) -> None:
        """Add the torques of causes outside the list to `into` (B, 2)."""
        for b, source in enumerate(self._unlisted):
            if source:
                n = len(self.machines[b].driven)
                into[b, :n] += source.step(h, t, q[b, :n], v[b, :n], a[b, :n])


def _table(rows: Sequence[np.ndarray], absent: float) -> np.ndarray:
    """Return (B, 2); a pendulum has nothing at the joint that it lacks."""
    result = np.full((len(rows), 2), absent)
    for k, row in enumerate(rows):
        result[k, : len(row)] = row
    return result


def _soft(
    pairs: Sequence[tuple[Machine, Sequence[Flaw]]], parameter: str, absent: float
) -> np.ndarray:
    soft = [per_joint(m, f, "joint_compliance", parameter, absent) for m, f in pairs]
    loose = [per_joint(m, f, "backlash", parameter, absent) for m, f in pairs]
    rows = [np.where(a != absent, a, b) for a, b in zip(soft, loose, strict=True)]
    return _table(rows, absent)
