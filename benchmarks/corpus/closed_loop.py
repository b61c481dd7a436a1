"""Pendulums and two-link arms under a joint controller, many runs side by side.

Dry friction and gear losses are solved implicitly on the level of velocities, so joints really
stick; a soft or loose gear gives its rotor a motion of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.corpus.excitation import Excitation, reference
from benchmarks.corpus.flaws import Flaw
from benchmarks.corpus.lanes import Lanes
from benchmarks.corpus.machine import Machine
from benchmarks.corpus.planar import PlanarLinks

STEP = 2.5e-4  # [s]
_BAND = 3.0  # [Hz] of the controller
_SWEEPS = 5


@dataclass(frozen=True, eq=False)
class Run:
    """One run: a machine, what is wrong with it, what it is asked to do."""

    machine: Machine
    flaws: tuple[Flaw, ...]
    excitation: Excitation


@dataclass(frozen=True, eq=False)
class Trace:
    """What perfect sensors would have seen: q, v and reported torque, (N, m) each."""

    time: np.ndarray
    q: np.ndarray
    v: np.ndarray
    torque: np.ndarray


def run_lanes(runs: Sequence[Run], rate: float) -> list[Trace]:
    """Return what sensors at `rate` [Hz] see of every run; runs do not touch one another."""
    lanes = Lanes([r.machine for r in runs], [r.flaws for r in runs])
    steps = round(max(r.excitation.duration for r in runs) / STEP)
    every = round(1.0 / rate / STEP)
    times = np.arange(steps) * STEP
    seen = _integrate(lanes, _wanted(runs, times), times, every)
    traces = []
    for b, run in enumerate(runs):
        n, rows = len(run.machine.driven), round(run.excitation.duration * rate)
        traces.append(Trace(np.arange(rows) / rate, *(part[:rows, b, :n] for part in seen)))
    return traces


def _wanted(runs: Sequence[Run], times: np.ndarray) -> np.ndarray:
    """Return reference position and velocity, (2, T, B, 2); runs that end early hold on."""
    wanted = np.zeros((2, len(times), len(runs), 2))
    for b, run in enumerate(runs):
        path = reference(run.machine, run.excitation)
        n, inside = len(run.machine.driven), times <= run.excitation.duration
        wanted[0, :, b, :n] = path(np.minimum(times, run.excitation.duration))
        wanted[1, inside, b, :n] = path(times[inside], 1)
    return wanted


def _integrate(
    lanes: Lanes, wanted: np.ndarray, times: np.ndarray, every: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    links, h = PlanarLinks(lanes.machines), STEP
    q, v = wanted[0, 0].copy(), wanted[1, 0].copy()
    elastic = np.isfinite(lanes.stiffness)
    stiffness = np.where(elastic, lanes.stiffness, 0.0)
    rotor, rigid_rotor = lanes.rotor, np.where(elastic, 0.0, lanes.rotor)
    mass, bias = links.terms(q, v)
    theta, omega = q.copy(), v.copy()
    theta += np.where(elastic, bias / np.where(elastic, stiffness, 1.0), 0.0)
    theta += np.where(elastic, 0.5 * lanes.lash * np.sign(bias), 0.0)
    stroke = np.einsum("bii->bi", mass) + rotor
    gain, damping = stroke * (2 * np.pi * _BAND) ** 2, 1.4 * stroke * 2 * np.pi * _BAND
    mesh, rise = np.zeros_like(q), np.zeros_like(q)
    command = gain * (wanted[0, 0] - theta) + damping * (wanted[1, 0] - omega) + bias
    lag = np.rint(lanes.delay / h).astype(int)
    history = np.repeat(command[None], int(lag.max()) + 1, axis=0)
    pick = np.ix_(range(len(q)), range(2))
    rows: list[tuple[np.ndarray, ...]] = []
    for k, t in enumerate(times):
        mass, bias = links.terms(q, v)
        command = bias + gain * (wanted[0, k] - theta) + damping * (wanted[1, k] - omega)
        history[k % len(history)] = command
        asked = history[(k - lag) % len(history), pick[0], pick[1]] if lag.any() else command
        motor = lanes.drive(asked, omega, float(t))
        smooth = lanes.smooth(theta, omega)
        lanes.unlisted(h, float(t), theta, omega, rise, smooth)
        up, down = _levels(lanes, omega, mesh)
        stretch = theta - q
        play = stretch - np.clip(stretch, -0.5 * lanes.lash, 0.5 * lanes.lash)
        touch = np.where(play != 0.0, stiffness * play + lanes.damping * (omega - v), 0.0)
        touch = np.where(elastic, touch, 0.0)
        joined = mass
        joined[:, 0, 0] += rigid_rotor[:, 0]
        joined[:, 1, 1] += rigid_rotor[:, 1]
        inverse = _inverse(joined)
        push = np.where(elastic, touch, motor + smooth) - bias
        free = v + h * np.einsum("bij,bj->bi", inverse, push)
        stiff = np.where(elastic, 0.0, h)
        after = _dry(free, inverse, up * stiff, down * stiff)
        spin = omega + h * (motor + smooth - touch) / rotor
        spin = spin - np.clip(spin, -down * h / rotor, up * h / rotor)
        rise = np.where(elastic, spin - omega, after - v) / h
        mesh = motor - rotor * rise
        before, v, omega = omega, after, np.where(elastic, spin, after)
        if k % every == 0:  # speeds live between the positions
            rows.append((theta, 0.5 * (before + omega), command))
        q = q + h * v
        theta = np.where(elastic, theta + h * omega, q)
    return tuple(np.array([row[part] for row in rows]) for part in range(3))  # type: ignore[return-value]


def _levels(lanes: Lanes, v: np.ndarray, mesh: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the most that dry friction and gears oppose to moving up and down, (B, 2) each."""
    level, load = lanes.level(v), np.abs(mesh)
    forward, backward = lanes.forward * load, lanes.backward * load
    lifts = mesh > 0.0
    return (
        level + np.where(lifts, forward, backward),
        level + np.where(lifts, backward, forward),
    )


def _dry(free: np.ndarray, inverse: np.ndarray, up: np.ndarray, down: np.ndarray) -> np.ndarray:
    """Return the velocity after friction impulses in [-down, up] that oppose it."""
    if not (up.any() or down.any()):
        return free
    impulse, v = np.zeros_like(free), free.copy()
    for _ in range(_SWEEPS):
        for j in (0, 1):
            new = np.clip(impulse[:, j] + v[:, j] / inverse[:, j, j], -down[:, j], up[:, j])
            v = v - inverse[:, :, j] * (new - impulse[:, j])[:, None]
            impulse[:, j] = new
    return v


def _inverse(m: np.ndarray) -> np.ndarray:
    determinant = m[:, 0, 0] * m[:, 1, 1] - m[:, 0, 1] * m[:, 1, 0]
    result = np.empty_like(m)
    result[:, 0, 0], result[:, 1, 1] = m[:, 1, 1], m[:, 0, 0]
    result[:, 0, 1], result[:, 1, 0] = -m[:, 0, 1], -m[:, 1, 0]
    return result / determinant[:, None, None]
