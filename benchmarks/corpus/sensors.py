"""From true motions to log tables: offsets, eccentric encoders, noise, quantisation, rates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.corpus.conditions import Conditions
from benchmarks.corpus.flaws import Flaw, per_joint
from benchmarks.corpus.machine import Machine
from benchmarks.corpus.needed import Motion

BASE_NAMES = ("x", "y", "z")


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


def joint_table(
    machine: Machine,
    flaws: Sequence[Flaw],
    sensors: Sensors,
    torque_noise: np.ndarray,
    noise: int,
    time: np.ndarray,
    q: np.ndarray,
    v: np.ndarray,
    torque: np.ndarray,
) -> dict[str, np.ndarray]:
    """Return the columns of the driven joints; arrays are (N, m), torque at the motor output.

    `torque_noise` (m,) is the same in all runs of a robot, whatever it does in them.
    """
    random = np.random.default_rng([5, noise])
    q, v = reported_motion(machine, flaws, q, v)
    quantum = 2.0 * np.pi / 2**sensors.bits
    q = q + sensors.position * random.standard_normal(q.shape)
    q = np.round(q / quantum) * quantum
    torque = torque + torque_noise * random.standard_normal(torque.shape)
    table = {"time": time}
    for j, joint in enumerate(machine.driven):
        table[f"{joint}.position"] = q[:, j]
        table[f"{joint}.rotor_torque"] = torque[:, j] / machine.ratio[j]
    if sensors.velocity is not None:
        v = v + sensors.velocity * random.standard_normal(v.shape)
        table |= {f"{joint}.velocity": v[:, j] for j, joint in enumerate(machine.driven)}
    return table


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


def condition_table(machine: Machine, noise: int, conditions: Conditions) -> dict[str, np.ndarray]:
    """Return the columns of temperature, to 0.1 K, and of voltage, to 10 mV, of all drives."""
    random = np.random.default_rng([7, noise])
    volts = conditions.voltage + 0.02 * random.standard_normal(conditions.voltage.shape)
    table = {f"{joint}.voltage": np.round(volts, 2) for joint in machine.driven}
    for j, joint in enumerate(machine.driven):
        table[f"{joint}.temperature"] = np.round(conditions.temperature[:, j], 1)
    return table


def base_table(
    machine: Machine, sensors: Sensors, noise: int, motion: Motion
) -> dict[str, np.ndarray]:
    """Return the columns of the undriven base and of the contact forces."""
    random = np.random.default_rng([6, noise])
    moving = sensors.velocity if sensors.velocity is not None else 3e-3

    def noisy(values: np.ndarray, size: float) -> np.ndarray:
        return values + size * random.standard_normal(values.shape)

    table: dict[str, np.ndarray] = {}
    for name, force in motion.forces.items():
        measured = noisy(force, sensors.force)
        axes = range(3) if machine.floating else (0, 2)
        table |= {f"{name}.force.{BASE_NAMES[k]}": measured[:, k] for k in axes}
    if machine.floating:
        return table | _free_base(motion, noisy, sensors.position, moving)
    for k in range(machine.base_size):
        joint = machine.links[k].joint
        table[f"{joint}.position"] = noisy(motion.q[:, k], sensors.position)
        table[f"{joint}.velocity"] = noisy(motion.v[:, k], moving)
    return table


def _free_base(motion, noisy, position: float, moving: float) -> dict[str, np.ndarray]:
    q, v = motion.q, motion.v
    quaternion = noisy(q[:, 3:7], 0.5 * position)
    quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
    w, vector = q[:, 3:4], q[:, 4:7]
    # World to body: the inverse rotation of the linear velocity.
    turned = v[:, :3] - 2.0 * w * np.cross(vector, v[:, :3])
    turned = turned + 2.0 * np.cross(vector, np.cross(vector, v[:, :3]))
    columns = {
        "base.position": (noisy(q[:, :3], position), BASE_NAMES),
        "base.orientation": (quaternion[:, [1, 2, 3, 0]], ("x", "y", "z", "w")),
        "base.linear_velocity": (noisy(turned, moving), BASE_NAMES),
        "base.angular_velocity": (noisy(v[:, 3:6], moving), BASE_NAMES),
    }
    return {
        f"{name}.{axis}": values[:, k]
        for name, (values, axes) in columns.items()
        for k, axis in enumerate(axes)
    }
