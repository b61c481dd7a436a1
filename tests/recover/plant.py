"""An independent plant: a two-link arm in closed form with many possible flaws.

Its physics share no code with the library. Many runs are integrated side by side, one lane each;
every flaw is an array over lanes that is zero (or one) where the lane does not have it. Dry
friction and gear losses are solved implicitly at the velocity level, so joints really stick.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from wbc.measurement import Log

GRAVITY = 9.81
MASS, LENGTH = 2.0, 0.4
ROD = MASS * LENGTH**2 / 12.0
REFLECTED = 0.02666666666666667
RATIO = 20.0
JOINTS = ("hip", "knee")

# Flaws with one value per joint, and the value at which they are absent.
PER_JOINT = {
    "viscous": 0.0,  # N m s/rad
    "coulomb": 0.0,  # N m
    "stribeck": 0.0,  # N m on top of coulomb at rest
    "stribeck_speed": 0.1,  # rad/s
    "eta_f": 1.0,
    "eta_b": 1.0,
    "slow_share": 0.0,  # of the mesh torque lost near rest, on top of eta_f and eta_b
    "slow_speed": 0.5,  # rad/s
    "spring": 0.0,  # N m/rad
    "rest": 0.0,  # rad
    "torque_factor": 1.0,  # delivered / reported
    "current_limit": np.inf,  # N m at the motor output
    "hysteresis": 0.0,  # N m
    "hysteresis_rate": 8.0,  # 1/rad
    "bent_length": 0.0,  # rad over which the losses of eta_f, eta_b build up; zero is at once
    "position_friction": 0.0,  # N m at 1 rad from zero
    "fading": 0.0,  # 1/s, loss of torque constant with time
}
# Flaws with one value per lane.
PER_LANE = {
    "foot_mass": 0.0,
    "shin_shift": 0.0,  # m along the link
    "delay": 0.0,  # s between reported and delivered torque
    "coupling": 0.0,  # N m s/rad between hip speed and knee torque
}


@dataclass(frozen=True)
class Lane:
    """One run: its flaws, and the seeds of its reference motion and of its sensors."""

    flaws: dict[str, float | tuple[float, float]] = field(default_factory=dict)
    excitation: int = 0
    noise: int = 0


def simulate(
    lanes: Sequence[Lane], duration: float = 10.0, step: float = 2e-4, rate: float = 500.0
) -> list[dict[str, np.ndarray]]:
    """Return one table of log columns per lane."""
    flaw = Flaws(lanes)
    count = len(lanes)
    every = round(1.0 / rate / step)
    steps = round(duration / step)
    motions = [reference(lane) for lane in lanes]
    q = np.stack([motion(np.zeros(1))[0][:, 0] for motion in motions])
    v, memory, mesh, bent = np.zeros((4, count, 2))
    history = np.zeros((max(2, int(0.06 / step)), count, 2))
    lag = np.rint(flaw.delay / step).astype(int)
    times = np.arange(steps) * step
    wanted = np.stack([np.stack(motion(times)) for motion in motions])  # (B, 2 kinds, 2, T)
    rows: list[tuple[np.ndarray, ...]] = []
    gain, damping = np.array([120.0, 60.0]), np.array([7.0, 3.0])
    sharp = flaw.bent_length == 0.0
    for k in range(steps):
        command = gain * (wanted[:, 0, :, k] - q) + damping * (wanted[:, 1, :, k] - v)
        if k == 0:
            history[:] = command
        history[k % len(history)] = command
        motor = flaw.drive(history[(k - lag) % len(history), np.arange(count)], times[k])
        if k % every == 0:
            rows.append((q, v, command / RATIO))
        smooth, level = flaw.torques(q, v)
        bent = flaw.bristles(bent, v, step)
        memory = memory + step * flaw.hysteresis_rate * (v - np.abs(v) * memory)
        memory = np.clip(memory, -1.0, 1.0)
        smooth = smooth - flaw.hysteresis * memory
        slow = flaw.slow_share * np.exp(-((v / flaw.slow_speed) ** 2))
        forward = np.where(sharp, (1.0 - flaw.eta_f * (1.0 - slow)) * np.abs(mesh), 0.0)
        backward = np.where(sharp, ((1.0 + slow) / flaw.eta_b - 1.0) * np.abs(mesh), 0.0)
        smooth = smooth - np.where(sharp, 0.0, flaw.bent_loss(bent, mesh))
        up = level + np.where(mesh > 0.0, forward, backward)
        down = level + np.where(mesh > 0.0, backward, forward)
        mass, bias = flaw.links(q, v)
        inverse = np.linalg.inv(mass + REFLECTED * np.eye(2))
        free = v + step * np.einsum("bij,bj->bi", inverse, motor + smooth - bias)
        after = _dry(free, inverse, up * step, down * step)
        mesh = motor - REFLECTED * (after - v) / step
        v = after
        q = q + step * v
    return [_measure(lane, b, rows, rate) for b, lane in enumerate(lanes)]


def as_log(table: Mapping[str, np.ndarray]) -> Log:
    """Return a table of `simulate` as a log."""
    return Log(table["time"], {name: column for name, column in table.items() if name != "time"})


RUBS: dict[str, float | tuple[float, float]] = {"coulomb": (0.6, 0.0)}
LANES = {
    "dragging knee": Lane({"viscous": (0.0, 0.5)}, 3),
    "nothing": Lane({}, 1, noise=0),
    "nothing again": Lane({}, 1, noise=1),
    "nothing, moved otherwise": Lane({}, 2, noise=2),
    "rubbing hip": Lane(RUBS, 3, noise=1),
    "rubbing hip, moved otherwise": Lane(RUBS, 4, noise=2),
    "hip that rubs more": Lane({"coulomb": (0.75, 0.0)}, 4, noise=7),
}


@cache
def recorded() -> dict[str, Log]:
    """Return logs of 5 s that several tests share: all lanes take hardly longer than one."""
    tables = simulate(list(LANES.values()), duration=5.0, step=5e-4)
    return {name: as_log(table) for name, table in zip(LANES, tables, strict=True)}


def _dry(free: np.ndarray, inverse: np.ndarray, up: np.ndarray, down: np.ndarray) -> np.ndarray:
    """Return the velocity after friction impulses in [-down, up] that oppose it."""
    impulse = np.zeros_like(free)
    v = free.copy()
    for _ in range(6):
        before = impulse.copy()
        for j in (0, 1):
            wish = impulse[:, j] + v[:, j] / inverse[:, j, j]
            new = np.minimum(np.maximum(wish, -down[:, j]), up[:, j])
            v = v - inverse[:, :, j] * (new - impulse[:, j])[:, None]
            impulse[:, j] = new
        if np.array_equal(impulse, before):  # all slide or hold
            break
    return v


class Flaws:
    """All flaws as arrays over lanes."""

    def __init__(self, lanes: Sequence[Lane]) -> None:
        for lane in lanes:
            unknown = set(lane.flaws) - set(PER_JOINT) - set(PER_LANE)
            if unknown:
                raise ValueError(f"no such flaw: {unknown}")
        for name, absent in PER_JOINT.items():
            values = [np.broadcast_to(lane.flaws.get(name, absent), (2,)) for lane in lanes]
            setattr(self, name, np.array(values, dtype=float))
        for name, absent in PER_LANE.items():
            setattr(self, name, np.array([float(lane.flaws.get(name, absent)) for lane in lanes]))

    def drive(self, command: np.ndarray, t: float) -> np.ndarray:
        passed = np.clip(command, -self.current_limit, self.current_limit)
        return self.torque_factor * (1.0 - self.fading * t) * passed

    def torques(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        smooth = -self.viscous * v - self.spring * (q - self.rest)
        smooth[:, 1] -= self.coupling * v[:, 0]
        slow = self.stribeck * np.exp(-((v / self.stribeck_speed) ** 2))
        return smooth, self.coulomb + slow + self.position_friction * np.abs(q)

    def bristles(self, bent: np.ndarray, v: np.ndarray, step: float) -> np.ndarray:
        """Return the state (B, 2) of bristles a step later, by an implicit step."""
        rate = step / np.where(self.bent_length > 0.0, self.bent_length, np.inf)
        return (bent + rate * v) / (1.0 + rate * np.abs(v))

    def bent_loss(self, bent: np.ndarray, mesh: np.ndarray) -> np.ndarray:
        """Return mesh input minus output for an input (B, 2)."""
        up = np.sign(mesh) * bent
        grow, shrink = 1.0 / self.eta_f - 1.0, 1.0 - self.eta_b
        gain = 1.0 + 0.5 * (grow + shrink) * up + 0.5 * (grow - shrink) * up**2
        return mesh - mesh / gain

    def links(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return mass matrix (B, 2, 2) and bias (B, 2) of two rods and a point mass at the foot."""
        (q1, q2), (v1, v2) = q.T, v.T
        half = 0.5 * LENGTH
        center = half + self.shin_shift
        first2 = MASS * center + self.foot_mass * LENGTH
        second1 = ROD + MASS * half**2
        second2 = ROD + MASS * center**2 + self.foot_mass * LENGTH**2
        m2 = MASS + self.foot_mass
        c, s = np.cos(q2), np.sin(q2)
        m11 = second1 + m2 * LENGTH**2 + second2 + 2.0 * LENGTH * first2 * c
        m12 = second2 + LENGTH * first2 * c
        mass, bias = np.empty((len(q), 2, 2)), np.empty_like(q)
        mass[:, 0, 0], mass[:, 1, 1] = m11, second2
        mass[:, 0, 1] = mass[:, 1, 0] = m12
        h = -LENGTH * first2 * s
        gravity1 = (MASS * half + m2 * LENGTH) * GRAVITY * np.sin(q1)
        gravity2 = first2 * GRAVITY * np.sin(q1 + q2)
        bias[:, 0] = h * (2.0 * v1 * v2 + v2**2) + gravity1 + gravity2
        bias[:, 1] = -h * v1**2 + gravity2
        return mass, bias


def reference(lane: Lane) -> Callable[..., tuple[np.ndarray, np.ndarray]]:
    """Return the positions and velocities (2, T) that the drives of a lane follow at times (T,)."""
    random = np.random.default_rng(1000 + lane.excitation)
    frequency = random.uniform(0.1, 1.6, size=(2, 6))
    phase = random.uniform(0.0, 2.0 * np.pi, size=(2, 6))
    size = random.uniform(0.5, 1.0, size=(2, 6)) * 0.3 / (0.4 + frequency)
    center = np.array([0.45, -0.75])

    def motion(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        ramp = 1.0 - np.exp(-((t / 0.4) ** 2))
        slope = 2.0 * t / 0.16 * np.exp(-((t / 0.4) ** 2))
        angle = 2.0 * np.pi * frequency[..., None] * t.reshape(1, 1, -1) + phase[..., None]
        wave = (size[..., None] * np.sin(angle)).sum(1)
        rise = (size[..., None] * 2.0 * np.pi * frequency[..., None] * np.cos(angle)).sum(1)
        return center[:, None] + ramp * wave, ramp * rise + slope * wave

    return motion


def _measure(
    lane: Lane, b: int, rows: Sequence[tuple[np.ndarray, ...]], rate: float
) -> dict[str, np.ndarray]:
    random, count = np.random.default_rng(lane.noise), 2.0 * np.pi / 2**18
    table = {"time": np.arange(len(rows)) / rate}
    sensors = {"position": 2e-5, "velocity": 3e-3, "rotor_torque": 2e-3}
    for k, (name, noise) in enumerate(sensors.items()):
        values = np.array([row[k][b] for row in rows])
        values = values + noise * random.standard_normal(values.shape)
        if name == "position":
            values = np.round(values / count) * count
        table |= {f"{joint}.{name}": values[:, j] for j, joint in enumerate(JOINTS)}
    return table
