"""Between the torque that a drive reports and the torque that arrives."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.corpus.conditions import Conditions
from benchmarks.corpus.flaws import Flaw, per_joint
from benchmarks.corpus.machine import Machine

_SLOPE = 40.0  # of a dead zone's edge, per its width


def reported_torque(
    machine: Machine,
    flaws: Sequence[Flaw],
    time: np.ndarray,
    spin: np.ndarray,
    delivered: np.ndarray,
    conditions: Conditions | None = None,
) -> np.ndarray:
    """Return what the drives report for a delivered torque, both (N, m) at the motor output.

    A current limit has no inverse and is left out: only a plant in closed loop has one.

    Args:
        machine: of the flaws.
        flaws: those of the drives count.
        time: (N,) since the start of the log [s], evenly spaced.
        spin: (N, m) speed of the motors after their reductions [rad/s].
        delivered: torque that reaches the rotors.
        conditions: of the run; without them the supply has the voltage that a drive believes in.
    """
    torque = delivered - per_joint(machine, flaws, "torque_offset", "offset", 0.0)
    for flaw in flaws:
        if flaw.effect == "torque_dead_zone":
            j, width = machine.driven.index(flaw.where), flaw.values["size"]
            torque[:, j] += width * np.tanh(_SLOPE * torque[:, j] / max(width, 1e-9))
        elif flaw.effect == "soft_saturation":
            j, size = machine.driven.index(flaw.where), flaw.values["size"]
            torque[:, j] = torque[:, j] * (1.0 + size * np.abs(torque[:, j]))
    torque = torque / factors(machine, flaws, time)
    for flaw in flaws:
        if flaw.effect == "voltage_scaling" and conditions is not None:
            p = flaw.values
            follows = 1.0 + p["share"] * (conditions.voltage / p["nominal"] - 1.0)
            torque[:, machine.driven.index(flaw.where)] /= follows
    for flaw in flaws:
        if flaw.effect == "supply_sag":
            torque = _sagging(torque, spin, flaw.values["coefficient"])
    delay = per_joint(machine, flaws, "actuation_delay", "delay", 0.0)
    for j in np.flatnonzero(delay):
        torque[:, j] = np.interp(time + delay[j], time, torque[:, j])
    return torque


def factors(machine: Machine, flaws: Sequence[Flaw], time: np.ndarray) -> np.ndarray:
    """Return delivered over asked torque, (N, m): wrong constants and warm motors."""
    factor = per_joint(machine, flaws, "torque_constant", "factor", 1.0)
    result = np.tile(factor, (len(time), 1))
    for flaw in flaws:
        if flaw.effect == "thermal_drift":
            tau = flaw.values["time_constant"]
            warm = tau * (1.0 - np.exp(-np.asarray(time) / tau))
            result[:, machine.driven.index(flaw.where)] *= 1.0 - flaw.values["rate"] * warm
    return result


def _sagging(delivered: np.ndarray, spin: np.ndarray, coefficient: float) -> np.ndarray:
    """Solve reported (1 - c P(reported)) = delivered; the power P scales with the torque."""
    power = np.maximum(np.sum(delivered * spin, axis=1), 0.0)
    root = np.sqrt(np.maximum(1.0 - 4.0 * coefficient * power, 0.0))
    return delivered * (2.0 / (1.0 + root))[:, None]
