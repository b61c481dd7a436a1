"""Motions that a machine follows exactly: arms, legs on the ground, bodies in flight."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from benchmarks.corpus.conditions import conditions_of
from benchmarks.corpus.excitation import Excitation, reference
from benchmarks.corpus.flaws import Flaw, changed_machine
from benchmarks.corpus.machine import GRAVITY, Machine
from benchmarks.corpus.needed import Motion
from benchmarks.corpus.rigid import Rigid

RATE = 1000.0  # [Hz]
_STEP = 0.008  # [s] of the flight's integration


def prescribed_motion(
    machine: Machine, flaws: Sequence[Flaw], excitation: Excitation, rate: float = RATE
) -> Motion:
    """Return the motion of a machine whose drives hold their joints on the reference."""
    motion = _motion(machine, flaws, excitation, rate)
    return replace(motion, conditions=conditions_of(machine, excitation, motion.time))


def _motion(machine: Machine, flaws: Sequence[Flaw], excitation: Excitation, rate: float) -> Motion:
    time = np.arange(round(excitation.duration * rate)) / rate
    path = reference(machine, excitation)
    if machine.floating:
        return _flight(machine, flaws, path, time)
    if machine.base_size:
        return _standing(machine, flaws, path, time)
    return Motion(time, path(time), path(time, 1), path(time, 2), {})


def _standing(machine: Machine, flaws: Sequence[Flaw], path: BSpline, time: np.ndarray) -> Motion:
    """Move the body; the feet stay where they are, the legs follow in closed form.

    The reference's four waves become forward, up, pitch and the sharing of the load.
    """
    thigh = -machine.links[4].origin[2]
    wave = path(time)
    wish = np.stack(
        [0.25 * thigh * wave[:, 0], 1.45 * thigh * (1.0 + 0.2 * wave[:, 1]), 0.25 * wave[:, 2]], 1
    )
    hips = [float(machine.links[k].origin[0]) for k in (3, 5)]
    columns = [*wish.T]
    for place in hips:
        c, s = np.cos(wish[:, 2]), np.sin(wish[:, 2])
        x, z = place - (wish[:, 0] + place * c), -(wish[:, 1] - place * s)
        columns += _leg(x, z, thigh, wish[:, 2])
    spline = make_interp_spline(time, np.stack(columns, axis=1), k=5)
    q, v, a = spline(time), spline(time, 1), spline(time, 2)
    rigid = Rigid(changed_machine(machine, flaws))
    torque = rigid.torque(q, v, a)
    forces = np.empty((len(time), 6))
    for k in range(len(time)):
        jacobian = rigid.contact_jacobians(q[k])[:, :3]  # columns of the base
        share = 0.5 + 0.2 * np.tanh(wave[k, 3])
        wanted = torque[k, 1] * np.array([0.0, 0.0, share, 0.0, 0.0, 1.0 - share])
        forces[k] = (
            wanted + np.linalg.lstsq(jacobian.T, torque[k, :3] - jacobian.T @ wanted, rcond=None)[0]
        )
    names = [name for name, _, _ in machine.contacts]
    return Motion(time, q, v, a, {n: forces[:, 3 * i : 3 * i + 3] for i, n in enumerate(names)})


def _leg(x: np.ndarray, z: np.ndarray, length: float, pitch: np.ndarray) -> list[np.ndarray]:
    """Return hip and knee angles that put the foot at (x, z) from the hip; the knee bends back."""
    reach = np.clip(np.hypot(x, z) / (2.0 * length), 0.05, 0.995)
    half = np.arccos(reach)
    direction = np.arctan2(-x, -z)  # of the leg about +y, hanging straight at zero
    return [direction - half - pitch, 2.0 * half]


def _flight(machine: Machine, flaws: Sequence[Flaw], path: BSpline, time: np.ndarray) -> Motion:
    """Integrate the free base by Runge-Kutta while the joints follow their path."""
    rigid = Rigid(changed_machine(machine, flaws))
    field = rigid.machine.gravity
    duration = float(time[-1])
    grid = np.arange(0.0, duration + 2.0 * _STEP, _STEP)
    state = np.zeros(13)
    state[3] = 1.0
    state[7:10] = -0.5 * field * duration if abs(field[2]) > 0.5 * GRAVITY else 0.0

    def slope(t: float, s: np.ndarray) -> np.ndarray:
        joints, rates, rises = path(t), path(t, 1), path(t, 2)
        quaternion = s[3:7] / np.linalg.norm(s[3:7])
        q = np.concatenate([s[:3], quaternion, joints])
        mass, bias = rigid.mass_and_bias(q, np.concatenate([s[7:], rates]))
        rise = np.linalg.solve(mass[:6, :6], -bias[:6] - mass[:6, 6:] @ rises)
        return np.concatenate([s[7:10], _quaternion_rate(quaternion, s[10:13]), rise])

    states, rises = [], []
    for t in grid:
        k1 = slope(t, state)
        states.append(state)
        rises.append(k1[7:])
        k2 = slope(t + 0.5 * _STEP, state + 0.5 * _STEP * k1)
        k3 = slope(t + 0.5 * _STEP, state + 0.5 * _STEP * k2)
        k4 = slope(t + _STEP, state + _STEP * k3)
        state = state + _STEP / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        state[3:7] /= np.linalg.norm(state[3:7])
    base = make_interp_spline(grid, np.array(states), k=5)(time)
    rise = make_interp_spline(grid, np.array(rises), k=5)(time)
    base[:, 3:7] /= np.linalg.norm(base[:, 3:7], axis=1, keepdims=True)
    q = np.concatenate([base[:, :7], path(time)], axis=1)
    v = np.concatenate([base[:, 7:], path(time, 1)], axis=1)
    nothing = {name: np.zeros((len(time), 3)) for name, _, _ in machine.contacts}
    return Motion(time, q, v, np.concatenate([rise, path(time, 2)], axis=1), nothing)


def _quaternion_rate(quaternion: np.ndarray, spin: np.ndarray) -> np.ndarray:
    """Return the rate of (w, x, y, z) for an angular velocity in the body's frame."""
    w, vector = quaternion[0], quaternion[1:]
    rate = np.concatenate([[-vector @ spin], w * spin + np.cross(vector, spin)])
    return 0.5 * rate
