"""Robots drawn at random: arms of 1 to 6 joints, a walking pair of legs, a body in flight."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from benchmarks.corpus.machine import GRAVITY, Contact, Link, Machine, rod

X, Y, Z = np.eye(3)
FAMILIES = (
    ("pendulum", 0.12),
    ("arm2", 0.42),
    ("arm3", 0.16),
    ("arm4", 0.07),
    ("arm6", 0.06),
    ("wrist6", 0.03),
    ("biped", 0.09),
    ("flyer", 0.05),
)
CLOSED_LOOP = ("pendulum", "arm2")  # the others follow a prescribed motion exactly

_AXES = {"arm3": (Z, Y, Y), "arm4": (Z, Y, Y, Y), "arm6": (Z, Y, Y, Z, Y, Z)}
_AXES["wrist6"] = _AXES["arm6"]


def draw_machine(random: np.random.Generator, family: str) -> Machine:
    """Return a robot of this family with sizes, masses and gears of its own."""
    if family in ("pendulum", "arm2"):
        return _hanging(random, family)
    if family == "biped":
        return _biped(random)
    if family == "flyer":
        return _flyer(random)
    return _arm(random, family)


def _gears(random: np.random.Generator, inertia: Sequence[float]) -> tuple[np.ndarray, np.ndarray]:
    """Return ratios and reflected inertias that are a share of what each joint carries."""
    ratio = random.choice([6.0, 9.0, 20.0, 50.0, 100.0], size=len(inertia))
    return ratio, np.asarray(inertia) * random.uniform(0.1, 0.8, len(inertia))


def _hanging(random: np.random.Generator, family: str) -> Machine:
    """One or two links that hang from the world and turn about +y."""
    count = 1 if family == "pendulum" else 2
    links, length = [], random.uniform(0.2, 0.5, count)
    mass = random.uniform(0.8, 3.0) * np.array([1.0, random.uniform(0.4, 1.0)])[:count]
    for k in range(count):
        com = np.array([random.uniform(-0.02, 0.02), 0.0, -length[k] * random.uniform(0.35, 0.65)])
        origin = np.zeros(3) if k == 0 else -length[0] * Z
        inertia = rod(mass[k], com, length[k], 0.06)
        links.append(
            Link(f"l{k + 1}", f"j{k + 1}", "hinge", k - 1, Y, origin, mass[k], com, inertia)
        )
    reach = float(np.sum(length))
    felt = [mass[-1] * reach**2 / 3.0, mass[-1] * length[-1] ** 2 / 3.0][-count:]
    ratio, reflected = _gears(random, felt)
    contacts = (("tip", count - 1, -length[-1] * Z),)
    center = np.array([random.uniform(-0.6, 0.6), random.uniform(-1.0, 1.0)])[:count]
    return _machine(family, links, ratio, reflected, contacts, center)


def _arm(random: np.random.Generator, family: str) -> Machine:
    """A serial arm on the ground: yaw, shoulder, elbow and a wrist."""
    axes = _AXES[family]
    scale = random.uniform(0.7, 1.3)
    length = scale * np.array([0.2, 0.3, 0.28, 0.1, 0.1, 0.08])[: len(axes)]
    mass = (
        scale**2
        * random.uniform(0.6, 1.4, len(axes))
        * np.array([4, 3.5, 2, 1.0, 0.8, 0.4])[: len(axes)]
    )
    links = []
    for k, axis in enumerate(axes):
        side = random.uniform(-0.03, 0.03, 3)
        com = 0.5 * length[k] * Z + side
        origin = np.zeros(3) if k == 0 else length[k - 1] * Z
        inertia = rod(mass[k], com, length[k], 0.08 * scale)
        links.append(
            Link(f"l{k + 1}", f"j{k + 1}", "hinge", k - 1, axis, origin, mass[k], com, inertia)
        )
    lever = np.cumsum(length[::-1])[::-1]
    carried = np.cumsum(mass[::-1])[::-1] * lever**2 / 3.0
    ratio, reflected = _gears(random, carried)
    contacts = (("tip", len(axes) - 1, length[-1] * Z + 0.03 * X),)
    center = np.array([0.0, 0.5, 0.9, 0.2, 0.6, 0.0])[: len(axes)]
    center = center + random.uniform(-0.4, 0.4, len(axes))
    topology = np.eye(len(axes))
    if family == "wrist6":
        topology[5, 4] = float(random.choice([-1.0, 1.0]))
    return _machine(family, links, ratio, reflected, contacts, center, topology)


def _biped(random: np.random.Generator) -> Machine:
    """A body in the x-z plane on two legs of two links each, with point feet."""
    light = np.eye(3) * 1e-9
    body = random.uniform(4.0, 12.0)
    links = [
        Link("slide_x", "base_x", "slide", -1, X, np.zeros(3), 1e-9, np.zeros(3), light),
        Link("slide_z", "base_z", "slide", 0, Z, np.zeros(3), 1e-9, np.zeros(3), light),
    ]
    com = np.array([random.uniform(-0.03, 0.03), 0.0, 0.05])
    inertia = body * 0.03 * np.eye(3)
    links.append(Link("base", "base_pitch", "hinge", 1, Y, np.zeros(3), body, com, inertia))
    parts = ("thigh", "hip", 1.5, Y), ("shin", "knee", 0.8, Y)
    hips = {"foot_f": 0.2 * X, "foot_h": -0.2 * X}
    contacts, felt = _limbs(random, links, hips, parts, (0.0, 0.45))
    ratio, reflected = _gears(random, felt)
    return _machine("biped", links, ratio, reflected, contacts, np.zeros(4), undriven=3)


def _flyer(random: np.random.Generator) -> Machine:
    """A free body with two arms of two joints each, thrown up."""
    body = random.uniform(3.0, 8.0)
    com, inertia = np.array([0.02, -0.01, 0.0]), body * np.diag([0.02, 0.03, 0.035])
    links = [Link("body", "base", "free", -1, Z, np.zeros(3), body, com, inertia)]
    parts = ("l1", "j1", 1.4, Y), ("l2", "j2", 0.9, X)
    shoulders = {"hand_l": 0.15 * Y, "hand_r": -0.15 * Y}
    contacts, felt = _limbs(random, links, shoulders, parts, (0.01, 0.5))
    ratio, reflected = _gears(random, felt)
    center = random.uniform(-0.5, 0.5, 4)
    return _machine("flyer", links, ratio, reflected, contacts, center, undriven=1)


def _limbs(
    random: np.random.Generator,
    links: list[Link],
    roots: Mapping[str, np.ndarray],
    parts: Sequence[tuple[str, str, float, np.ndarray]],
    com: tuple[float, float],
) -> tuple[tuple[Contact, ...], list[float]]:
    """Add limbs to the last body; return the contacts at their ends and what each joint feels.

    Args:
        random: of the lengths and masses.
        links: of the machine; those of the limbs are added.
        roots: contact of each limb, its name ending in the limb's letter -> where it begins.
        parts: (link, joint, mass, axis) from the body on.
        com: how far ahead of a link's middle line its centre of mass lies [m], and at which
            share of its length.
    """
    trunk, length = len(links) - 1, random.uniform(0.2, 0.35)
    middle = np.array([com[0], 0.0, -com[1] * length])
    contacts, felt = [], []
    for contact, root in roots.items():
        parent, origin, letter = trunk, root, contact[-1]
        for name, joint, size, axis in parts:
            mass = size * random.uniform(0.7, 1.3)
            inertia = rod(mass, middle, length, 0.05)
            shape = parent, axis, origin, mass, middle, inertia
            links.append(Link(f"{name}_{letter}", f"{joint}_{letter}", "hinge", *shape))
            felt.append(mass * length**2)
            parent, origin = len(links) - 1, -length * Z
        contacts.append((contact, parent, origin))
    return tuple(contacts), felt


def _machine(
    family: str,
    links: Sequence[Link],
    ratio: np.ndarray,
    reflected: np.ndarray,
    contacts: tuple[Contact, ...],
    center: np.ndarray,
    topology: np.ndarray | None = None,
    undriven: int = 0,
) -> Machine:
    driven = tuple(link.joint for link in links[undriven:])
    square = np.eye(len(driven)) if topology is None else topology
    field = np.array([0.0, 0.0, -GRAVITY])
    return Machine(family, tuple(links), driven, ratio, reflected, square, contacts, field, center)
