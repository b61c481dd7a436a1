"""The torque that a machine with its flaws needs for a motion: inverse dynamics of the plant."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from benchmarks.corpus.conditions import Conditions
from benchmarks.corpus.drive import reported_torque
from benchmarks.corpus.flaws import (
    INERTIAL,
    AtJoints,
    Flaw,
    changed_machine,
    gains_at,
    per_joint,
    rotor_friction,
    thermal_torque,
)
from benchmarks.corpus.machine import Machine
from benchmarks.corpus.rigid import Rigid
from benchmarks.corpus.unlisted import UnlistedTorques

SLOW = 0.003  # [rad/s] over which dry friction changes its direction


@dataclass(frozen=True, eq=False)
class Motion:
    """A true motion on an even grid.

    Attributes:
        time: (N,) [s].
        q: (N, nq) in MuJoCo's order.
        v: (N, nv).
        a: (N, nv).
        forces: contact -> (N, 3) on the robot [N].
        conditions: temperatures and voltage, None where nothing depends on them.
    """

    time: np.ndarray
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    forces: Mapping[str, np.ndarray]
    conditions: Conditions | None = None

    def thinned(self, every: int) -> Motion:
        """Return every so many-th sample."""
        forces = {name: force[::every] for name, force in self.forces.items()}
        rows = slice(None, None, every)
        conditions = None if self.conditions is None else self.conditions.thinned(every)
        return Motion(self.time[rows], self.q[rows], self.v[rows], self.a[rows], forces, conditions)


def link_torque(machine: Machine, flaws: Sequence[Flaw], motion: Motion) -> np.ndarray:
    """Return M a + h - J' f of the links as they really are, (N, nv)."""
    rigid = Rigid(changed_machine(machine, flaws))
    torque = rigid.torque(motion.q, motion.v, motion.a)
    if any(np.any(force) for force in motion.forces.values()):
        stacked = np.concatenate([motion.forces[name] for name, _, _ in machine.contacts], axis=1)
        for k, q in enumerate(motion.q):
            torque[k] -= rigid.contact_jacobians(q).T @ stacked[k]
    return torque


def changes_links(flaws: Sequence[Flaw]) -> bool:
    """Whether the links' torque differs from that of the machine as drawn."""
    return any(flaw.effect in (*INERTIAL, "gravity_direction") for flaw in flaws)


def needed_torque(
    machine: Machine, flaws: Sequence[Flaw], motion: Motion, links: np.ndarray
) -> np.ndarray:
    """Return (N, m + b): reported torque at the motor outputs, then minus the base's wrench.

    Args:
        machine: as drawn.
        flaws: what is wrong with it.
        motion: of the links.
        links: (N, nv) what the links need.
    """
    machine, b = changed_machine(machine, flaws), machine.base_size
    theta, omega, alpha = motor_motion(machine, flaws, motion, links)
    beside = AtJoints(partial(per_joint, machine, flaws))
    joint = links[:, b:] - beside.smooth(theta, omega)
    joint = joint - thermal_torque(machine, flaws, omega, motion.conditions)
    joint = joint - UnlistedTorques(machine, flaws).along(motion.time, theta, omega, alpha)
    joint = joint + beside.level(omega) * np.tanh(omega / SLOW)
    inverse = np.linalg.inv(machine.topology)
    output, spin, rise = joint @ machine.topology, omega @ inverse.T, alpha @ inverse.T
    gains = gains_at(machine, flaws, spin)
    mesh = meshed(output, spin, *gains)
    for flaw in flaws:
        if flaw.effect == "load_presliding":
            j = machine.driven.index(flaw.where)
            bent = bristles((theta @ inverse.T)[:, j], flaw.values["length"])
            mesh[:, j] = loaded(output[:, j], bent, gains[0][:, j], gains[1][:, j])
    dragged, dry = rotor_friction(machine, flaws, spin)
    delivered = mesh + machine.reflected * rise + dragged + dry * np.tanh(spin / SLOW)
    reported = reported_torque(machine, flaws, motion.time, spin, delivered, motion.conditions)
    return np.concatenate([reported, -links[:, :b]], axis=1)


def motor_motion(
    machine: Machine, flaws: Sequence[Flaw], motion: Motion, links: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return position, velocity and acceleration (N, m) of the joints at their motors' side.

    A soft gear winds up by delta where k delta + c delta_dot is the load it carries.
    """
    m, b = len(machine.driven), machine.base_size
    parts = [motion.q[:, -m:].copy(), motion.v[:, b:].copy(), motion.a[:, b:].copy()]
    step = float(motion.time[1] - motion.time[0])
    for flaw in flaws:
        if flaw.effect != "joint_compliance":
            continue
        j, k, c = machine.driven.index(flaw.where), flaw.values["stiffness"], flaw.values["damping"]
        still = links[:, b + j] / k
        keep = float(np.exp(-step * k / c)) if c > 0.0 else 0.0
        wind = still.copy()
        for row in range(1, len(wind)):
            middle = 0.5 * (still[row] + still[row - 1])
            wind[row] = middle + keep * (wind[row - 1] - middle)
        for part in parts:
            part[:, j] += wind
            wind = np.gradient(wind, step)
    return parts[0], parts[1], parts[2]


def bristles(position: np.ndarray, length: float) -> np.ndarray:
    """Return the bending (N,) of bristles along positions (N,), from zero; implicit steps."""
    bent = np.zeros(len(position))
    for k, way in enumerate(np.diff(position) / length, start=1):
        bent[k] = (bent[k - 1] + way) / (1.0 + abs(way))
    return bent


def loaded(
    output: np.ndarray, bent: np.ndarray, forward: np.ndarray, backward: np.ndarray
) -> np.ndarray:
    """Return the mesh input for an output, all (N,), of a gear whose losses build up."""
    along = bent * np.sign(output)
    grow, shrink = forward - 1.0, 1.0 - backward
    return output * (1.0 + 0.5 * (grow + shrink) * along + 0.5 * (grow - shrink) * along**2)


def meshed(
    output: np.ndarray, spin: np.ndarray, forward: np.ndarray, backward: np.ndarray
) -> np.ndarray:
    """Return the mesh input torque for an output torque; gains are (1/eta_f, eta_b)."""
    way = np.tanh(spin / SLOW) * np.sign(output)
    return output * (0.5 * (forward + backward) + 0.5 * (forward - backward) * way)
