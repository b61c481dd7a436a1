"""How a robot is recorded: rates and noise, and encoders with wrong zeros or bent shafts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.corpus.flaws import Flaw, per_joint
from benchmarks.corpus.machine import Machine


@dataclass(frozen=True)
class Sensors:
    """How a robot is recorded.

    Attributes:
        rate: [Hz].
        position: rms noise [rad, m].
        bits: of the encoders, per turn.
        velocity: rms noise [rad/s, m/s]; None where velocity is not recorded.
        torque: rms noise as a share of `torque_size`.
        force: rms noise [N].
        conditions: whether the motors' temperatures and the supply's voltage are recorded.
    """

    rate: float
    position: float
    bits: int
    velocity: float | None
    torque: float
    force: float
    conditions: bool = False


def torque_size(torque: np.ndarray) -> np.ndarray:
    """Return the size (m,) that torque noise is a share of; no motor is made for nothing."""
    size = np.sqrt(np.mean(torque**2, axis=0))
    return np.maximum(size, 0.05 * np.max(size))


def reported_motion(
    machine: Machine, flaws: Sequence[Flaw], q: np.ndarray, v: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return what encoders with wrong zeros or bent shafts say, (N, m) each."""
    q = q + per_joint(machine, flaws, "position_offset", "offset", 0.0)
    for flaw in flaws:
        if flaw.effect == "encoder_eccentricity":
            j, p = machine.driven.index(flaw.where), flaw.values
            q, v = q.copy(), v.copy()
            v[:, j] *= 1.0 + p["size"] * np.cos(q[:, j] + p["phase"])
            q[:, j] += p["size"] * np.sin(q[:, j] + p["phase"])
    return q, v
