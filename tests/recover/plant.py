"""An independent plant: a two-link arm in closed form with many possible flaws.

Its physics share no code with the library. Many runs are integrated side by side, one lane each;
every flaw is an array over lanes that is zero (or one) where the lane does not have it. Dry
friction and gear losses are solved implicitly at the velocity level, so joints really stick.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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
    "drag": 0.0,  # N m s^2/rad^2
    "cubic": 0.0,  # N m s^3/rad^3
    "eta_f": 1.0,
    "eta_b": 1.0,
    "slow_share": 0.0,  # of the mesh torque lost near rest, on top of eta_f and eta_b
    "slow_speed": 0.5,  # rad/s
    "extra_rotor": 0.0,  # kg m^2
    "spring": 0.0,  # N m/rad
    "rest": 0.0,  # rad
    "ripple": 0.0,  # N m
    "ripple_order": 20.0,  # 1/rad
    "ripple_phase": 0.0,
    "torque_factor": 1.0,  # delivered / reported
    "torque_offset": 0.0,  # N m, delivered minus reported
    "current_limit": np.inf,  # N m at the motor output
    "encoder_offset": 0.0,  # rad, reported minus true
    "stiffness": np.inf,  # N m/rad
    "damping": 8.0,  # N m s/rad beside the stiffness
    "lash": 0.0,  # rad
    "hysteresis": 0.0,  # N m
    "hysteresis_rate": 8.0,  # 1/rad
    "bent_length": 0.0,  # rad over which the losses of eta_f, eta_b build up; zero is at once
    "position_friction": 0.0,  # N m at 1 rad from zero
    "dead_zone": 0.0,  # N m of commanded torque lost around zero
    "growing_friction": 0.0,  # N m per s
    "one_sided": 0.0,  # N m of friction for positive speed only
    "fading": 0.0,  # 1/s, loss of torque constant with time
}
# Flaws with one value per lane.
PER_LANE = {
    "foot_mass": 0.0,
    "shin_mass": 0.0,
    "thigh_mass": 0.0,
    "shin_shift": 0.0,  # m along the link
    "tilt": 0.0,  # rad of gravity about y
    "delay": 0.0,  # s between reported and delivered torque
    "coupling": 0.0,  # N m s/rad between hip speed and knee torque
}


@dataclass(frozen=True)
class Lane:
    """One run: its flaws and its excitation.

    Attributes:
        flaws: flaw name -> value, or (hip, knee).
        excitation: seed of the reference motion.
        amplitude: scale of the reference motion.
        noise: seed of the sensors.
        noise_scale: 1 is the noise of the practice logs.
    """

    flaws: dict[str, float | tuple[float, float]] = field(default_factory=dict)
    excitation: int = 0
    amplitude: float = 1.0
    noise: int = 0
    noise_scale: float = 1.0


def simulate(
    lanes: Sequence[Lane], duration: float = 10.0, step: float = 2e-4, rate: float = 500.0
) -> list[dict[str, np.ndarray]]:
    """Return one table of log columns per lane."""
    flaw = _Flaws(lanes)
    count = len(lanes)
    every = round(1.0 / rate / step)
    steps = round(duration / step)
    reference = [_reference(lane) for lane in lanes]
    q = np.stack([motion(0.0)[0] for motion in reference])
    elastic = np.isfinite(flaw.stiffness)
    v = np.zeros((count, 2))
    theta, omega = q.copy(), v.copy()
    memory = np.zeros((count, 2))
    mesh, bent = np.zeros((2, count, 2))
    history = np.zeros((max(2, int(0.06 / step)), count, 2))
    lag = np.rint(flaw.delay / step).astype(int)
    times = np.arange(steps) * step
    wanted = np.stack([np.stack(motion(times)) for motion in reference])  # (B, 2 kinds, 2, T)
    rows: list[tuple[np.ndarray, ...]] = []
    gain, damping = np.array([120.0, 60.0]), np.array([7.0, 3.0])
    for k in range(steps):
        t = times[k]
        command = gain * (wanted[:, 0, :, k] - theta) + damping * (wanted[:, 1, :, k] - omega)
        if k == 0:
            history[:] = command
        history[k % len(history)] = command
        delayed = history[(k - lag) % len(history), np.arange(count)]
        motor = flaw.drive(delayed, t)
        if k % every == 0:
            rows.append((theta + flaw.encoder_offset, omega.copy(), command / RATIO))
        smooth, level_up, level_down = flaw.torques(theta, omega, t)
        slide = np.sign(omega)
        bent = flaw.bristles(bent, omega, step)
        memory = memory + step * flaw.hysteresis_rate * (omega - np.abs(omega) * memory)
        memory = np.clip(memory, -1.0, 1.0)
        smooth = smooth - flaw.hysteresis * memory
        sharp = flaw.bent_length == 0.0
        slow = flaw.slow_share * np.exp(-((omega / flaw.slow_speed) ** 2))
        forward = np.where(sharp, (1.0 - flaw.eta_f * (1.0 - slow)) * np.abs(mesh), 0.0)
        backward = np.where(sharp, ((1.0 + slow) / flaw.eta_b - 1.0) * np.abs(mesh), 0.0)
        smooth = smooth - np.where(sharp, 0.0, flaw.bent_loss(bent, mesh))
        level_up = level_up + np.where(mesh > 0.0, forward, backward)
        level_down = level_down + np.where(mesh > 0.0, backward, forward)
        mass, bias = flaw.links(q, v)
        rotor = REFLECTED + flaw.extra_rotor
        stretch = theta - q
        play = stretch - np.clip(stretch, -0.5 * flaw.lash, 0.5 * flaw.lash)
        touch = np.where(
            elastic & (play != 0.0),
            np.where(elastic, flaw.stiffness, 0.0) * play + flaw.damping * (omega - v),
            0.0,
        )
        joined = mass.copy()
        joined[:, 0, 0] += np.where(elastic[:, 0], 0.0, rotor[:, 0])
        joined[:, 1, 1] += np.where(elastic[:, 1], 0.0, rotor[:, 1])
        drive = np.where(elastic, touch, motor + smooth) - bias
        inverse = _inverse(joined)
        free = v + step * np.einsum("bij,bj->bi", inverse, drive)
        up = np.where(elastic, 0.0, level_up) * step
        down = np.where(elastic, 0.0, level_down) * step
        after = _dry(free, inverse, up, down)
        # A rotor behind an elastic gear has its own speed and its own friction.
        spin = omega + step * (motor + smooth - touch) / rotor
        spin = spin - np.clip(spin, -level_down * step / rotor, level_up * step / rotor)
        acceleration = np.where(elastic, spin - omega, after - v) / step
        mesh = motor - rotor * acceleration
        del slide
        v = after
        omega = np.where(elastic, spin, after)
        q = q + step * v
        theta = np.where(elastic, theta + step * omega, q)
    return [_measure(lane, b, rows, rate) for b, lane in enumerate(lanes)]


def as_log(table: Mapping[str, np.ndarray]) -> Log:
    """Return a table of `simulate` as a log."""
    return Log(table["time"], {name: column for name, column in table.items() if name != "time"})


def recorded(*lanes: Lane) -> list[Log]:
    """Return logs of 5 s, one per lane."""
    return [as_log(table) for table in simulate(lanes, duration=5.0, step=5e-4)]


@cache
def dragging_knee() -> Log:
    """Return a log of a leg whose knee has viscous friction, 0.5 N m s/rad; made once."""
    return recorded(Lane({"viscous": (0.0, 0.5)}, 3))[0]


def _dry(free: np.ndarray, inverse: np.ndarray, up: np.ndarray, down: np.ndarray) -> np.ndarray:
    """Return the velocity after friction impulses in [-down, up] that oppose it."""
    impulse = np.zeros_like(free)
    v = free.copy()
    for _ in range(6):
        for j in (0, 1):
            change = v[:, j] / inverse[:, j, j]
            new = np.clip(impulse[:, j] + change, -down[:, j], up[:, j])
            v = v - inverse[:, :, j] * (new - impulse[:, j])[:, None]
            impulse[:, j] = new
    return v


def _inverse(m: np.ndarray) -> np.ndarray:
    determinant = m[:, 0, 0] * m[:, 1, 1] - m[:, 0, 1] * m[:, 1, 0]
    result = np.empty_like(m)
    result[:, 0, 0], result[:, 1, 1] = m[:, 1, 1], m[:, 0, 0]
    result[:, 0, 1], result[:, 1, 0] = -m[:, 0, 1], -m[:, 1, 0]
    return result / determinant[:, None, None]


class _Flaws:
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
        passed = passed - np.clip(passed, -self.dead_zone, self.dead_zone)
        return self.torque_factor * (1.0 - self.fading * t) * passed + self.torque_offset

    def torques(
        self, q: np.ndarray, v: np.ndarray, t: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        smooth = (
            -self.viscous * v
            - self.drag * np.abs(v) * v
            - self.cubic * v**3
            - self.spring * (q - self.rest)
            + self.ripple * np.sin(self.ripple_order * q + self.ripple_phase)
        )
        smooth[:, 1] -= self.coupling * v[:, 0]
        level = (
            self.coulomb
            + self.stribeck * np.exp(-((v / self.stribeck_speed) ** 2))
            + self.position_friction * np.abs(q)
            + self.growing_friction * t
        )
        return smooth, level + self.one_sided, level

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
        """Return mass matrix (B, 2, 2) and bias (B, 2) of thigh, shin and added point masses."""
        q1, q2 = q.T
        v1, v2 = v.T
        half = 0.5 * LENGTH
        # Thigh: mass and first moment along the link; shin likewise, about the knee.
        m1 = MASS + self.thigh_mass
        first1 = m1 * half
        second1 = ROD + m1 * half**2
        center = half + self.shin_shift
        m2 = MASS + self.shin_mass + self.foot_mass
        first2 = MASS * center + self.shin_mass * half + self.foot_mass * LENGTH
        second2 = ROD + MASS * center**2 + self.shin_mass * half**2 + self.foot_mass * LENGTH**2
        c, s = np.cos(q2), np.sin(q2)
        m11 = second1 + m2 * LENGTH**2 + second2 + 2.0 * LENGTH * first2 * c
        m12 = second2 + LENGTH * first2 * c
        mass = np.stack([np.stack([m11, m12], -1), np.stack([m12, second2 + 0.0 * c], -1)], -2)
        h = -LENGTH * first2 * s
        gravity1 = (first1 + m2 * LENGTH) * GRAVITY * np.sin(q1 + self.tilt)
        gravity2 = first2 * GRAVITY * np.sin(q1 + q2 + self.tilt)
        bias = np.stack(
            [h * (2.0 * v1 * v2 + v2**2) + gravity1 + gravity2, -h * v1**2 + gravity2], -1
        )
        return mass, bias


def _reference(lane: Lane):
    random = np.random.default_rng(1000 + lane.excitation)
    frequency = random.uniform(0.1, 1.6, size=(2, 6))
    phase = random.uniform(0.0, 2.0 * np.pi, size=(2, 6))
    size = lane.amplitude * random.uniform(0.5, 1.0, size=(2, 6)) * 0.3 / (0.4 + frequency)
    center = np.array([0.45, -0.75])

    def motion(t):
        t = np.asarray(t, dtype=float)
        ramp = 1.0 - np.exp(-((t / 0.4) ** 2))
        slope = 2.0 * t / 0.16 * np.exp(-((t / 0.4) ** 2))
        angle = 2.0 * np.pi * frequency[..., None] * t.reshape(1, 1, -1) + phase[..., None]
        wave = (size[..., None] * np.sin(angle)).sum(1)
        rise = (size[..., None] * 2.0 * np.pi * frequency[..., None] * np.cos(angle)).sum(1)
        position = center[:, None] + ramp * wave
        velocity = ramp * rise + slope * wave
        if t.ndim == 0:
            return position[:, 0], velocity[:, 0]
        return position, velocity

    return motion


def _measure(
    lane: Lane, b: int, rows: Sequence[tuple[np.ndarray, ...]], rate: float
) -> dict[str, np.ndarray]:
    random = np.random.default_rng(lane.noise)
    position = np.array([row[0][b] for row in rows])
    velocity = np.array([row[1][b] for row in rows])
    torque = np.array([row[2][b] for row in rows])
    scale = lane.noise_scale
    position = position + scale * 2e-5 * random.standard_normal(position.shape)
    count = 2.0 * np.pi / 2**18
    position = np.round(position / count) * count
    velocity = velocity + scale * 3e-3 * random.standard_normal(velocity.shape)
    torque = torque + scale * 2e-3 * random.standard_normal(torque.shape)
    table = {"time": np.arange(len(rows)) / rate}
    for j, joint in enumerate(JOINTS):
        table[f"{joint}.position"] = position[:, j]
        table[f"{joint}.velocity"] = velocity[:, j]
        table[f"{joint}.rotor_torque"] = torque[:, j]
    return table
