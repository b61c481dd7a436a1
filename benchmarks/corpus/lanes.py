"""Flaws of many runs as arrays over lanes, for the plant in closed loop."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.corpus.flaws import Flaw, changed_machine, loss_gains, per_joint
from benchmarks.corpus.machine import Machine
from benchmarks.corpus.unlisted import UnlistedTorques

_JOINT = {
    "viscous": ("viscous_friction", "coefficient", 0.0),
    "forward_viscous": ("directional_viscous_friction", "positive_direction", 0.0),
    "backward_viscous": ("directional_viscous_friction", "negative_direction", 0.0),
    "drag": ("quadratic_drag", "coefficient", 0.0),
    "coulomb": ("coulomb_friction", "level", 0.0),
    "stribeck": ("stribeck_friction", "level", 0.0),
    "stribeck_speed": ("stribeck_friction", "speed", 1.0),
    "spring": ("joint_spring", "stiffness", 0.0),
    "rest": ("joint_spring", "rest", 0.0),
    "ripple": ("torque_ripple", "amplitude", 0.0),
    "order": ("torque_ripple", "order", 0.0),
    "phase": ("torque_ripple", "phase", 0.0),
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


class Lanes:
    """What is wrong in every lane; attributes are (B, 2) arrays named as in `_JOINT`."""

    def __init__(self, machines: Sequence[Machine], flaws: Sequence[Sequence[Flaw]]) -> None:
        pairs = list(zip(machines, flaws, strict=True))
        self.machines = [changed_machine(machine, found) for machine, found in pairs]
        self._values = {
            name: _table([per_joint(m, f, *entry) for m, f in pairs], entry[2])
            for name, entry in _JOINT.items()
        }
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

    def __getattr__(self, name: str) -> np.ndarray:
        try:
            return self.__dict__["_values"][name]
        except KeyError:
            raise AttributeError(name) from None

    def drive(self, command: np.ndarray, omega: np.ndarray, t: float) -> np.ndarray:
        """Return the torque (B, 2) that arrives on the rotors for the reported one."""
        torque = np.clip(command, -self.limit, self.limit)
        power = np.maximum(np.sum(command * omega, axis=1, keepdims=True), 0.0)
        torque = torque * (1.0 - self.sag[:, None] * power)
        warm = self.warming * (1.0 - np.exp(-t / self.warming))
        torque = torque * self.factor * (1.0 - self.fading * warm)
        torque = torque - np.clip(torque, -self.dead, self.dead)
        return torque / (1.0 + self.soft_drive * np.abs(torque)) + self.offset

    def smooth(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return the torque (B, 2) of smooth effects beside the joints."""
        return (
            -self.viscous * v
            - np.where(v > 0.0, self.forward_viscous, self.backward_viscous) * v
            - self.drag * np.abs(v) * v
            - self.spring * (q - self.rest)
            + self.ripple * np.sin(self.order * q + self.phase)
        )

    def level(self, v: np.ndarray) -> np.ndarray:
        """Return the level (B, 2) of dry friction."""
        return self.coulomb + self.stribeck * np.exp(-((v / self.stribeck_speed) ** 2))

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
