"""Causes that a stepping plant adds as torques: those outside the library's list, and bristles."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.corpus.flaws import Flaw
from benchmarks.corpus.machine import Machine

TORQUES = (
    "presliding",
    "bouc_wen",
    "one_sided_cable",
    "asymmetric_nonlinear_friction",
    "position_dependent_friction",
    "cross_viscous",
    "tendon",
    "growing_friction",
    "cubic_damping",
    "intermittent_slip",
    "hidden_pendulum",
)
DRIVES = ("torque_dead_zone", "soft_saturation")
SENSORS = ("encoder_eccentricity",)
DRAWN = (*TORQUES, *DRIVES, *SENSORS)
"""What a case of a cause outside the list is drawn from: presliding is an effect by now, and stays
there so that every number of a seed is the case that it was."""
NAMES = tuple(name for name in DRAWN if name != "presliding")
TWO_JOINTS = ("cross_viscous", "tendon")
_SLOW = 0.004  # [rad/s] below which a direction is not sharp


class UnlistedTorques:
    """The torques of one run, with the memory that they need."""

    def __init__(self, machine: Machine, flaws: Sequence[Flaw]) -> None:
        self._flaws = [flaw for flaw in flaws if flaw.effect in TORQUES]
        self._joint = [machine.driven.index(flaw.where) for flaw in self._flaws]
        self._memory = np.zeros((len(self._flaws), 2))

    def __bool__(self) -> bool:
        return bool(self._flaws)

    def along(self, time: np.ndarray, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return the torques (N, m) along a motion of the joints."""
        if not self:
            return np.zeros_like(v)
        step = float(time[1] - time[0])
        rows = zip(time, q, v, a, strict=True)
        return np.array([self.step(step, float(t), *row) for t, *row in rows])

    def step(self, h: float, t: float, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return the torque (m,) on the joints now, and go on by h."""
        torque = np.zeros_like(v)
        for k, (flaw, j) in enumerate(zip(self._flaws, self._joint, strict=True)):
            torque[j] += self._torque(k, h, t, q, v, a)
            if flaw.effect == "tendon":
                p = flaw.values
                torque[j - 1] -= p["size"] * (q[j] + q[j - 1] - p["rest"])
        return torque

    def _torque(
        self, k: int, h: float, t: float, q: np.ndarray, v: np.ndarray, a: np.ndarray
    ) -> float:
        """Return the torque of one cause at its joint, and let its memory go on."""
        name, p = self._flaws[k].effect, self._flaws[k].values
        j, memory = self._joint[k], self._memory[k]
        speed, way = float(v[j]), float(np.tanh(v[j] / _SLOW))
        if name == "presliding":
            # Exact over a step of constant speed, so that any step is stable.
            target = np.sign(speed)
            memory[0] = target + (memory[0] - target) * np.exp(-abs(speed) * h / p["length"])
            return -p["level"] * float(memory[0])
        size = p["size"]
        if name == "bouc_wen":
            z = float(memory[0])
            memory[0] = np.clip(
                z + h * p["rate"] * speed * (1.0 - z * z * (speed * z > 0.0)), -1.0, 1.0
            )
            return -size * float(memory[0])
        if name == "one_sided_cable":
            return -size * max(0.0, float(q[j]) - p["rest"]) ** 2
        if name == "asymmetric_nonlinear_friction":
            return -size * way * (np.sqrt(abs(speed)) + 0.3 if speed > 0.0 else 0.1)
        if name == "position_dependent_friction":
            return -size * way * max(0.0, np.sin(p["order"] * float(q[j]) + p["phase"]))
        if name == "cross_viscous":
            return -size * float(v[j - 1])
        if name == "tendon":
            return -size * float(q[j] + q[j - 1] - p["rest"])
        if name == "growing_friction":
            return -size * way * t
        if name == "cubic_damping":
            return -size * speed**3
        if name == "intermittent_slip":
            return -size * way * float(np.sin(p["rate"] * t) + np.sin(1.618 * p["rate"] * t) > 1.1)
        # A damped pendulum inside the link: the joint's acceleration drives it, it reacts on the
        # joint.
        rate, damping = p["rate"], 2.0 * p["damping"] * p["rate"]
        push = rate**2 * memory[0] + damping * memory[1]
        memory[1] += h * (-push - float(a[j]))
        memory[0] += h * memory[1]
        return float(size * push)
