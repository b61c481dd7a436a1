"""Run cases on their plants: from true motions to tables of log columns, with noise."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.corpus.case import Case
from benchmarks.corpus.closed_loop import Trace, run_lanes
from benchmarks.corpus.conditions import Conditions
from benchmarks.corpus.excitation import Excitation
from benchmarks.corpus.families import CLOSED_LOOP
from benchmarks.corpus.machine import Machine
from benchmarks.corpus.needed import Motion, link_torque, motor_motion, needed_torque
from benchmarks.corpus.prescribed import RATE, prescribed_motion
from benchmarks.corpus.sensors import Sensors, reported_motion

Table = dict[str, np.ndarray]
BASE_NAMES = ("x", "y", "z")


def record_cases(jobs: Sequence[tuple[Case, Sequence[Excitation]]]) -> list[list[Table]]:
    """Return the tables of every case's runs; those in closed loop are simulated side by side.

    Args:
        jobs: cases with the runs to record, which need not be the case's own.
    """
    tables: list[list[Table]] = [[] for _ in jobs]
    by_rate: dict[float, list[tuple[int, Case, Excitation]]] = {}
    for k, (case, excitations) in enumerate(jobs):
        if case.machine.family in CLOSED_LOOP:
            runs = [(k, case, excitation) for excitation in excitations]
            by_rate.setdefault(case.sensors.rate, []).extend(runs)
        else:
            tables[k] = [_prescribed(case, e) for e in excitations]
    for rate, runs in by_rate.items():
        traces = run_lanes([(case, excitation) for _, case, excitation in runs], rate)
        for (k, case, excitation), trace in zip(runs, traces, strict=True):
            tables[k].append(joint_table(case, excitation.noise, trace))
    return tables


def _prescribed(case: Case, excitation: Excitation) -> Table:
    machine, flaws, sensors = case.machine, case.flaws, case.sensors
    motion = prescribed_motion(machine, flaws, excitation)
    links = link_torque(machine, flaws, motion)
    torque = needed_torque(machine, flaws, motion, links)[:, : len(machine.driven)]
    q, v, _ = motor_motion(machine, flaws, motion, links)
    every = round(RATE / sensors.rate)
    kept = motion.thinned(every)
    trace = Trace(kept.time, q[::every], v[::every], torque[::every])
    table = joint_table(case, excitation.noise, trace)
    if sensors.conditions and kept.conditions is not None:
        table |= condition_table(machine, excitation.noise, kept.conditions)
    if machine.base_size:
        table |= base_table(machine, sensors, excitation.noise, kept)
    return table


def joint_table(case: Case, noise: int, trace: Trace) -> Table:
    """Return the columns of the driven joints."""
    random = np.random.default_rng([5, noise])
    machine, sensors, torque = case.machine, case.sensors, trace.torque
    q, v = reported_motion(machine, case.flaws, trace.q, trace.v)
    quantum = 2.0 * np.pi / 2**sensors.bits
    q = q + sensors.position * random.standard_normal(q.shape)
    q = np.round(q / quantum) * quantum
    torque = torque + case.torque_noise * random.standard_normal(torque.shape)
    table = {"time": trace.time}
    for j, joint in enumerate(machine.driven):
        table[f"{joint}.position"] = q[:, j]
        table[f"{joint}.rotor_torque"] = torque[:, j] / machine.ratio[j]
    if sensors.velocity is not None:
        v = v + sensors.velocity * random.standard_normal(v.shape)
        table |= {f"{joint}.velocity": v[:, j] for j, joint in enumerate(machine.driven)}
    return table


def condition_table(machine: Machine, noise: int, conditions: Conditions) -> Table:
    """Return the columns of temperature, to 0.1 K, and of voltage, to 10 mV, of all drives."""
    random = np.random.default_rng([7, noise])
    volts = conditions.voltage + 0.02 * random.standard_normal(conditions.voltage.shape)
    table = {f"{joint}.voltage": np.round(volts, 2) for joint in machine.driven}
    for j, joint in enumerate(machine.driven):
        table[f"{joint}.temperature"] = np.round(conditions.temperature[:, j], 1)
    return table


def base_table(machine: Machine, sensors: Sensors, noise: int, motion: Motion) -> Table:
    """Return the columns of the undriven base and of the contact forces."""
    random = np.random.default_rng([6, noise])
    moving = sensors.velocity if sensors.velocity is not None else 3e-3

    def noisy(values: np.ndarray, size: float) -> np.ndarray:
        return values + size * random.standard_normal(values.shape)

    table: Table = {}
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


def _free_base(motion, noisy, position: float, moving: float) -> Table:
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
