"""What a flaw does to the residual, in units of the noise floor, by the plant's own equations.

Where no sensor measured the contact forces, logs show only what no force at the contacts can be:
the signature is then projected out of what such forces do, in floors.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.corpus.excitation import Excitation
from benchmarks.corpus.flaws import Flaw
from benchmarks.corpus.machine import Machine
from benchmarks.corpus.needed import (
    Motion,
    changes_links,
    link_torque,
    motor_motion,
    needed_torque,
)
from benchmarks.corpus.prescribed import prescribed_motion
from benchmarks.corpus.rigid import Rigid
from benchmarks.corpus.sensors import Sensors, reported_motion, torque_size

BAND = 8.0  # [Hz] in which signatures are judged
_RATE = 125.0  # [Hz] of the grid
_KEPT = 5  # one row in so many: about two rows per period of the band
_MOVES = ("position_offset", "joint_compliance", "encoder_eccentricity")


class Signatures:
    """Signatures of flaws along the reference motions of a set of runs."""

    def __init__(
        self,
        machine: Machine,
        excitations: Sequence[Excitation],
        sensors: Sensors,
        withheld: bool = False,
    ) -> None:
        """Prepare the reference motions.

        Args:
            machine: as drawn.
            excitations: the runs.
            sensors: how they were recorded.
            withheld: whether the contact forces were not.
        """
        self.machine = machine
        different = {(e.kind, e.seed): e for e in excitations}.values()
        self.motions = [prescribed_motion(machine, (), e, _RATE) for e in different]
        self._links = [link_torque(machine, (), motion) for motion in self.motions]
        self.torques = [
            needed_torque(machine, (), m, links)
            for m, links in zip(self.motions, self._links, strict=True)
        ]
        driven = np.concatenate(self.torques)[:, : len(machine.driven)]
        self.torque_noise = sensors.torque * torque_size(driven)
        self.floor = _floor(machine, sensors, self.motions, self.torque_noise, withheld)
        self._pushes = [_pushes(machine, m, self.floor) if withheld else None for m in self.motions]

    def of(self, flaws: Sequence[Flaw]) -> np.ndarray:
        """Return (rows, m + b): the residual in floors of a machine without `flaws`."""
        parts = []
        kept = zip(self.motions, self._links, self.torques, self._pushes, strict=True)
        for motion, links, torque, pushes in kept:
            residual = self._residual(flaws, motion, links, torque) / self.floor
            if pushes is not None:
                residual = residual - np.einsum("nij,nj->ni", pushes, residual)
            parts.append(_low_pass(residual)[::_KEPT])
        return np.concatenate(parts)

    def _residual(
        self, flaws: Sequence[Flaw], motion: Motion, links: np.ndarray, torque: np.ndarray
    ) -> np.ndarray:
        machine = self.machine
        true = link_torque(machine, flaws, motion) if changes_links(flaws) else links
        reported = needed_torque(machine, flaws, motion, true)
        limits = [flaw for flaw in flaws if flaw.effect == "current_limit"]
        for flaw in limits:
            j, limit = machine.driven.index(flaw.where), flaw.values["limit"]
            reported[:, j] += torque[:, j] - np.clip(torque[:, j], -limit, limit)
        if not any(flaw.effect in _MOVES for flaw in flaws):
            return reported - torque
        m, b = len(machine.driven), machine.base_size
        q, v, _ = motor_motion(machine, flaws, motion, true)
        q, v = reported_motion(machine, flaws, q, v)
        # Only what differs is differentiated: the links' own acceleration is known exactly.
        rise = np.gradient(v - motion.v[:, b:], 1.0 / _RATE, axis=0)
        seen = Motion(
            motion.time,
            np.concatenate([motion.q[:, :-m], q], axis=1),
            np.concatenate([motion.v[:, :b], v], axis=1),
            np.concatenate([motion.a[:, :b], motion.a[:, b:] + rise], axis=1),
            motion.forces,
            motion.conditions,
        )
        return reported - needed_torque(machine, (), seen, link_torque(machine, (), seen))


def _low_pass(values: np.ndarray) -> np.ndarray:
    """Return `values` (N, k) through a zero-phase Gaussian filter with its -3 dB at the band."""
    padded = np.concatenate([values, values[::-1]])
    frequency = np.fft.rfftfreq(len(padded), 1.0 / _RATE)
    gain = np.exp(-0.5 * np.log(2.0) * (frequency / BAND) ** 2)
    return np.fft.irfft(np.fft.rfft(padded, axis=0) * gain[:, None], len(padded), axis=0)[
        : len(values)
    ]


def _floor(
    machine: Machine,
    sensors: Sensors,
    motions: Sequence[Motion],
    torque_noise: np.ndarray,
    withheld: bool,
) -> np.ndarray:
    """Return the rms (m + b,) that white sensor noise leaves in the band."""
    b = machine.base_size
    rate = sensors.rate
    quantum = 2.0 * np.pi / 2**sensors.bits
    position = sensors.position**2 + quantum**2 / 12.0
    share = 2.0 * BAND / rate
    wave = (2.0 * np.pi * BAND) ** 2
    rise = share * wave**2 * position / 5.0
    if sensors.velocity is not None:
        rise = min(rise, share * wave * sensors.velocity**2 / 3.0)
    motion = motions[0]
    middle = len(motion.time) // 2
    rigid = Rigid(machine)
    mass, _ = rigid.mass_and_bias(motion.q[middle], motion.v[middle])
    mass[b:, b:] += np.diag(machine.reflected)
    variance = rise * np.sum(mass**2, axis=1)
    if motion.forces and not withheld:
        jacobian = rigid.contact_jacobians(motion.q[middle])
        variance = variance + share * sensors.force**2 * np.sum(jacobian**2, axis=0)
    variance[b:] += share * torque_noise**2
    return np.sqrt(np.concatenate([variance[b:], variance[:b]]))


def _pushes(machine: Machine, motion: Motion, floor: np.ndarray) -> np.ndarray:
    """Return (N, m + b, m + b) the projectors on what forces at the contacts do, in floors."""
    rigid, b = Rigid(machine), machine.base_size
    # A force on the robot takes from the torque of joints and from what the base lacks alike.
    jacobians = np.array([rigid.contact_jacobians(q) for q in motion.q]).transpose(0, 2, 1)
    joints = np.einsum("nvk,vm->nmk", jacobians[:, b:], machine.topology)
    push = np.concatenate([joints, jacobians[:, :b]], axis=1) / floor[:, None]
    return push @ np.linalg.pinv(push, rcond=1e-6)
