"""One step of many controlled two-link arms.

Dry friction and gear losses are solved implicitly on the level of velocities, so joints really
stick; a soft or loose gear gives its rotor a motion of its own.
"""

from __future__ import annotations

import numpy as np

from benchmarks.corpus.lanes import Lanes
from benchmarks.corpus.planar import PlanarLinks

STEP = 2.5e-4  # [s]
_BAND = 3.0  # [Hz] of the controller
_SWEEPS = 5

Seen = tuple[np.ndarray, np.ndarray, np.ndarray]


class SteppedArms:
    """The state of all lanes: links q, v; rotors behind their reductions theta, omega, (B, 2)."""

    def __init__(self, lanes: Lanes, wanted: np.ndarray) -> None:
        """Start on the reference.

        Args:
            lanes: machines and what is wrong with them.
            wanted: (2, T, B, 2) reference positions and velocities.
        """
        self.lanes, self.wanted = lanes, wanted
        self.links = PlanarLinks(lanes.machines)
        self.elastic = np.isfinite(lanes.stiffness)
        self.stiffness = np.where(self.elastic, lanes.stiffness, 0.0)
        self.q, self.v = wanted[0, 0].copy(), wanted[1, 0].copy()
        mass, bias = self.links.terms(self.q, self.v)
        sag = bias / np.where(self.elastic, self.stiffness, 1.0) + 0.5 * lanes.lash * np.sign(bias)
        self.theta, self.omega = self.q + np.where(self.elastic, sag, 0.0), self.v.copy()
        stroke = np.einsum("bii->bi", mass) + lanes.rotor
        self.gain = stroke * (2.0 * np.pi * _BAND) ** 2
        self.damping = 1.4 * stroke * 2.0 * np.pi * _BAND
        self.mesh, self.rise = np.zeros_like(self.q), np.zeros_like(self.q)
        self.swing = np.zeros_like(self.q)  # acceleration of the links
        self.lag = np.rint(lanes.delay / STEP).astype(int)
        first = self._command(0, bias)
        self.history = np.repeat(first[None], int(self.lag.max()) + 1, axis=0)

    def step(self, k: int, t: float) -> Seen:
        """Go on by one step; return position, speed and asked torque at its beginning."""
        lanes = self.lanes
        # Speeds live half a step before the positions.
        mass, bias = self.links.terms(self.q, self.v + 0.5 * STEP * self.swing)
        command = self._command(k, bias)
        motor = lanes.drive(self._delayed(k, command), self.omega, t)
        push = motor + lanes.smooth(self.theta, self.omega)
        lanes.unlisted(STEP, t, self.theta, self.omega, self.rise, push)
        up, down = _levels(lanes, self.omega, self.mesh)
        touch = self._touch()
        links = self._links_after(mass, np.where(self.elastic, touch, push) - bias, up, down)
        rotor = STEP / lanes.rotor
        spin = self.omega + rotor * (push - touch)
        spin = spin - np.clip(spin, -down * rotor, up * rotor)
        omega = np.where(self.elastic, spin, links)
        before, theta = self.omega, self.theta
        self.rise = (omega - before) / STEP
        self.mesh = motor - lanes.rotor * self.rise
        self.swing = (links - self.v) / STEP
        self.v, self.omega = links, omega
        self.q = self.q + STEP * links
        self.theta = np.where(self.elastic, theta + STEP * omega, self.q)
        return theta, 0.5 * (before + omega), command  # speeds live between the positions

    def _command(self, k: int, bias: np.ndarray) -> np.ndarray:
        position, velocity = self.wanted[:, k]
        return bias + self.gain * (position - self.theta) + self.damping * (velocity - self.omega)

    def _delayed(self, k: int, command: np.ndarray) -> np.ndarray:
        length = len(self.history)
        self.history[k % length] = command
        if length == 1:
            return command
        lane, joint = np.indices(command.shape)
        return np.asarray(self.history[(k - self.lag) % length, lane, joint])

    def _touch(self) -> np.ndarray:
        """Return the torque of soft and loose gears on their links, (B, 2)."""
        stretch, half = self.theta - self.q, 0.5 * self.lanes.lash
        play = stretch - np.clip(stretch, -half, half)
        push = self.stiffness * play + self.lanes.damping * (self.omega - self.v)
        return np.where(self.elastic & (play != 0.0), push, 0.0)

    def _links_after(
        self, mass: np.ndarray, push: np.ndarray, up: np.ndarray, down: np.ndarray
    ) -> np.ndarray:
        """Return the links' velocity after the step; rigid gears bring rotors and friction."""
        rotor = np.where(self.elastic, 0.0, self.lanes.rotor)
        mass[:, 0, 0] += rotor[:, 0]
        mass[:, 1, 1] += rotor[:, 1]
        inverse = _inverse(mass)
        free = self.v + STEP * np.einsum("bij,bj->bi", inverse, push)
        rigid = np.where(self.elastic, 0.0, STEP)
        return _dry(free, inverse, up * rigid, down * rigid)


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
