"""Flaws of a chosen size: one number u scales each of them, nearly in proportion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.corpus.conditions import NOMINAL
from benchmarks.corpus.flaws import Flaw
from benchmarks.corpus.machine import Machine
from benchmarks.corpus.rigid import Rigid
from benchmarks.corpus.signature import Signatures


@dataclass(frozen=True, eq=False)
class Typical:
    """What is usual at the driven joints of a machine on its runs, (m,) each.

    Attributes:
        machine: as drawn.
        torque: rms [N m].
        peak: largest torque [N m].
        speed: rms [rad/s].
        inertia: links and rotor [kg m^2].
        power: largest sum of positive power [W].
        duration: of the longest run [s].
    """

    machine: Machine
    torque: np.ndarray
    peak: np.ndarray
    speed: np.ndarray
    inertia: np.ndarray
    power: float
    duration: float

    @classmethod
    def of(cls, machine: Machine, signatures: Signatures) -> Typical:
        m, b = len(machine.driven), machine.base_size
        torque = np.concatenate(signatures.torques)[:, :m]
        speed = np.concatenate([motion.v[:, b:] for motion in signatures.motions])
        spin = speed @ np.linalg.inv(machine.topology).T
        first = signatures.motions[0]
        middle = len(first.time) // 2
        mass, _ = Rigid(machine).mass_and_bias(first.q[middle], first.v[middle])
        size = np.sqrt(np.mean(torque**2, axis=0))
        return cls(
            machine,
            np.maximum(size, 0.05 * size.max()),
            np.max(np.abs(torque), axis=0),
            np.maximum(np.sqrt(np.mean(speed**2, axis=0)), 0.05),
            np.diag(mass)[b:] + machine.reflected,
            float(np.max(np.maximum(np.sum(torque * spin, axis=1), 0.0))),
            max(float(motion.time[-1]) for motion in signatures.motions),
        )


@dataclass(frozen=True)
class Recipe:
    """How to make a flaw of size u at one place.

    Attributes:
        make: u -> parameters.
        most: largest u that is still physical.
    """

    make: Callable[[float], dict[str, float]]
    most: float


def recipe(random: np.random.Generator, effect: str, where: str, typical: Typical) -> Recipe:
    """Return the recipe of an effect at a place, its shape drawn at random."""
    machine = typical.machine
    if where not in machine.driven:
        return _of_bodies(random, effect, where, typical)
    j = machine.driven.index(where)
    simple = _simple(effect, float(typical.torque[j]), float(typical.speed[j]))
    if simple is not None:
        return Recipe(lambda u: {simple[0]: u}, simple[1])
    for source in (_of_joints, _of_drives, _unlisted):
        found = source(random, effect, j, typical)
        if found is not None:
            return found
    raise ValueError(f"no recipe for {effect}")


def _simple(effect: str, torque: float, speed: float) -> tuple[str, float] | None:
    """Return the one parameter that is u itself, and its largest value."""
    return {
        "viscous_friction": ("coefficient", 0.8 * torque / speed),
        "coulomb_friction": ("level", 0.8 * torque),
        "rotor_viscous_friction": ("coefficient", 0.8 * torque / speed),
        "rotor_coulomb_friction": ("level", 0.8 * torque),
        "quadratic_drag": ("coefficient", 0.8 * torque / speed**2),
        "load_friction": ("coefficient", 0.3),
        "torque_offset": ("offset", 0.8 * torque),
        "actuation_delay": ("delay", 0.02),
        "position_offset": ("offset", 0.2),
        "asymmetric_nonlinear_friction": ("size", 0.8 * torque / np.sqrt(speed)),
        "cross_viscous": ("size", 0.8 * torque / speed),
        "growing_friction": ("size", 0.15 * torque),
        "cubic_damping": ("size", 0.5 * torque / speed**3),
        "torque_dead_zone": ("size", 0.4 * torque),
        "soft_saturation": ("size", 0.3 / torque),
    }.get(effect)


def _of_joints(random: np.random.Generator, effect: str, j: int, typical: Typical) -> Recipe | None:
    torque, speed = float(typical.torque[j]), float(typical.speed[j])
    if effect == "stribeck_friction":
        slow = float(random.uniform(0.1, 0.5)) * speed
        return Recipe(lambda u: {"level": u, "speed": slow}, torque)
    if effect == "load_stribeck_friction":
        slow = float(random.uniform(0.1, 0.5)) * speed
        return Recipe(lambda u: {"coefficient": u, "speed": slow}, 0.4)
    if effect == "joint_spring":
        rest = float(typical.machine.center[j] + random.uniform(-0.5, 0.5))
        return Recipe(lambda u: {"stiffness": u, "rest": rest}, 2.0 * torque)
    if effect == "torque_ripple":
        fastest = 2.0 * np.pi * 5.0 / speed
        orders = [k for k in (3.0, 5.0, 6.0, 8.0, 12.0, 20.0, 30.0) if k < fastest]
        order, phase = float(random.choice(orders or [3.0])), float(random.uniform(-3.0, 3.0))
        return Recipe(lambda u: {"amplitude": u, "order": order, "phase": phase}, 0.5 * torque)
    if effect == "transmission_efficiency":
        share = float(random.choice([1.0, 0.0, random.uniform(-0.5, 0.8)]))

        def pair(u: float) -> dict[str, float]:
            wedge, equal = 2.0 - 1.0 / (1.0 - u), 1.0 - u
            return {
                "forward_efficiency": 1.0 - u,
                "backward_efficiency": min(share * wedge + (1.0 - share) * equal, 1.0),
            }

        return Recipe(pair, 0.45)
    if effect == "load_presliding":
        length = float(random.uniform(0.03, 0.15))
        share = float(random.uniform(-0.5, 1.0))
        return Recipe(
            lambda u: {
                "forward_efficiency": 1.0 - u,
                "backward_efficiency": 1.0 - u * (1.0 + share * u),
                "length": length,
            },
            0.4,
        )
    if effect == "directional_viscous_friction":
        other = float(random.uniform(0.0, 0.7))
        pair = (1.0, other) if random.uniform() < 0.5 else (other, 1.0)
        return Recipe(
            lambda u: {"positive_direction": u * pair[0], "negative_direction": u * pair[1]},
            0.8 * torque / speed,
        )
    if effect == "thermal_viscous_friction":
        # Lubricants lose half of their viscosity every 12 to 45 K.
        rate = float(random.uniform(0.015, 0.06))
        return Recipe(lambda u: {"coefficient": u, "rate": rate}, 0.5 * torque / speed)
    if effect == "rotor_inertia":
        nominal = float(typical.machine.reflected[j])
        way = float(random.choice([1.0, 1.0, -1.0]))
        return Recipe(
            lambda u: {"reflected_inertia": nominal * (1.0 + way * u)}, 0.6 if way < 0 else 4.0
        )
    if effect in ("joint_compliance", "backlash"):
        return _soft(random, effect, torque, float(typical.inertia[j]))
    return None


def _soft(random: np.random.Generator, effect: str, torque: float, inertia: float) -> Recipe:
    ratio = float(random.uniform(0.05, 0.4))

    def contact(stiffness: float) -> dict[str, float]:
        return {"stiffness": stiffness, "damping": 2.0 * ratio * np.sqrt(stiffness * inertia)}

    if effect == "backlash":
        stiffness = inertia * (2.0 * np.pi * random.uniform(25.0, 50.0)) ** 2
        return Recipe(lambda u: {"width": u, **contact(stiffness)}, 0.05)
    softest = max(torque / 0.08, inertia * (2.0 * np.pi * 6.0) ** 2)
    return Recipe(lambda u: contact(1.0 / u), 1.0 / softest)


def _of_drives(random: np.random.Generator, effect: str, j: int, typical: Typical) -> Recipe | None:
    if effect == "torque_constant":
        way = float(random.choice([1.0, -1.0]))
        return Recipe(lambda u: {"factor": 1.0 + way * u}, 0.3)
    if effect == "voltage_scaling":
        return Recipe(lambda u: {"share": u, "nominal": NOMINAL}, 1.0)
    if effect == "thermal_drift":
        tau = float(np.exp(random.uniform(np.log(3.0), np.log(40.0))))
        warm = tau * (1.0 - np.exp(-typical.duration / tau))
        return Recipe(lambda u: {"rate": u / warm, "time_constant": tau}, 0.4)
    if effect == "current_limit":
        peak = float(typical.peak[j])
        return Recipe(lambda u: {"limit": peak * (1.0 - u)}, 0.4)
    return None


def _unlisted(random: np.random.Generator, effect: str, j: int, typical: Typical) -> Recipe | None:
    torque = float(typical.torque[j])
    center = float(typical.machine.center[j])
    rest, phase = float(random.uniform(-0.3, 0.3)), float(random.uniform(-3.0, 3.0))
    both = center + float(typical.machine.center[j - 1]) + rest
    shape, most = {
        "presliding": ({"length": 1.0 / float(random.uniform(5.0, 20.0))}, 0.8 * torque),
        "bouc_wen": ({"rate": float(random.uniform(2.0, 6.0))}, 0.8 * torque),
        "one_sided_cable": ({"rest": center + rest}, 3.0 * torque),
        "position_dependent_friction": ({"order": 3.0, "phase": phase}, 0.8 * torque),
        "tendon": ({"rest": both}, 1.5 * torque),
        "intermittent_slip": ({"rate": float(random.uniform(3.0, 7.0))}, torque),
        "hidden_pendulum": (
            {
                "rate": 2.0 * np.pi * float(random.uniform(0.8, 2.5)),
                "damping": float(random.uniform(0.03, 0.2)),
            },
            0.5 * float(typical.inertia[j]),
        ),
        "encoder_eccentricity": ({"phase": phase}, 0.1),
    }.get(effect, ({}, 0.0))
    size = "level" if effect == "presliding" else "size"
    return Recipe(lambda u: {size: u, **shape}, most) if most else None


def _of_bodies(random: np.random.Generator, effect: str, where: str, typical: Typical) -> Recipe:
    machine = typical.machine
    flat = all(link.axis[1] == 1.0 or link.kind == "slide" for link in machine.links)
    if effect == "payload_mass":
        points = {name: number for name, number, _ in machine.contacts}
        number = points[where] if where in points else machine.body(where)
        return Recipe(lambda u: {"mass": u}, 0.6 * machine.links[number].mass)
    if effect == "center_of_mass":
        way = random.standard_normal(3)
        way = np.eye(3)[random.integers(3)] if random.uniform() < 0.6 else way
        way = np.array([way[0] + way[1], 0.0, way[2]]) if flat else way
        way = way / np.linalg.norm(way)
        return Recipe(lambda u: {axis: u * float(way[k]) for k, axis in enumerate("xyz")}, 0.06)
    if effect == "gravity_direction":
        angle = np.pi / 2 if flat else random.choice([0.0, np.pi / 2, random.uniform(0.0, 6.28)])
        roll, pitch = float(np.cos(angle)), float(np.sin(angle))
        roll, pitch = (round(x, 12) for x in (roll, pitch))
        return Recipe(lambda u: {"roll": u * roll, "pitch": u * pitch}, 0.2)
    # From a share of 1/4 on the supply cannot give the power that the motion needs.
    largest = 0.24 / max(typical.power, 1e-3)
    return Recipe(lambda u: {"coefficient": min(u, largest)}, 0.4 / max(typical.power, 1e-3))


def flaws_of_size(
    effect: str, places: Sequence[str], recipes: Sequence[Recipe], u: float
) -> tuple[Flaw, ...]:
    """Return the effect at its places, each in proportion to what that place bears."""
    least = min(r.most for r in recipes)
    pairs = zip(places, recipes, strict=True)
    return tuple(Flaw(effect, place, r.make(u * r.most / least)) for place, r in pairs)
