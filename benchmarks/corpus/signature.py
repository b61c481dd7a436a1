"""What a flaw does to the residual, in units of the noise floor, by the plant's own equations."""

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
        self, machine: Machine, excitations: Sequence[Excitation], sensors: Sensors
    ) -> None:
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
        self.floor = _floor(machine, sensors, self.motions, self.torque_noise)

    def of(self, flaws: Sequence[Flaw]) -> np.ndarray:
        """Return (rows, m + b): the residual in floors of a machine without `flaws`."""
        parts = []
        for motion, links, torque in zip(self.motions, self._links, self.torques, strict=True):
            residual = self._residual(flaws, motion, links, torque)
            parts.append(_low_pass(residual)[::_KEPT] / self.floor)
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
    if motion.forces:
        jacobian = rigid.contact_jacobians(motion.q[middle])
        variance = variance + share * sensors.force**2 * np.sum(jacobian**2, axis=0)
    variance[b:] += share * torque_noise**2
    return np.sqrt(np.concatenate([variance[b:], variance[:b]]))
