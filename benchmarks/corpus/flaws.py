"""What can be wrong with a machine, by the library's names, in equations of the plant's own."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from benchmarks.corpus.conditions import Conditions
from benchmarks.corpus.machine import Link, Machine

WHOLE_ROBOT = ("gravity_direction", "supply_sag")
DRAWING = "link_inertia"
AT_MOTORS = ("rotor_coulomb_friction", "rotor_viscous_friction")
INERTIAL = ("payload_mass", "center_of_mass", DRAWING)
POINTS = 2  # masses that the drawing of a link lacks
LUBRICANT = 40.0  # [deg C], at which the viscosity of lubricants is stated


@dataclass(frozen=True)
class Flaw:
    """One effect at one place; outside the list the names are those of `unlisted`.

    Attributes:
        effect: name.
        where: joint, body, contact point or `robot`.
        values: parameters by the library's names and units.
    """

    effect: str
    where: str
    values: Mapping[str, float] = field(default_factory=dict)

    @property
    def key(self) -> tuple[str, str]:
        """Name and place."""
        return self.effect, self.where


def changed_machine(machine: Machine, flaws: Iterable[Flaw]) -> Machine:
    """Return the machine with its inertias, rotors and gravity as they really are."""
    for flaw in flaws:
        value = flaw.values
        if flaw.effect == "payload_mass":
            machine = _with_payload(machine, flaw.where, value["mass"])
        elif flaw.effect == "center_of_mass":
            number = machine.body(flaw.where)
            link = machine.links[number]
            shift = np.array([value[axis] for axis in "xyz"])
            machine = machine.with_link(number, replace(link, com=link.com + shift))
        elif flaw.effect == DRAWING:
            number = machine.body(flaw.where)
            machine = machine.with_link(number, _redrawn(machine.links[number], value))
        elif flaw.effect == "rotor_inertia":
            reflected = machine.reflected.copy()
            reflected[machine.driven.index(flaw.where)] = value["reflected_inertia"]
            machine = replace(machine, reflected=reflected)
        elif flaw.effect == "gravity_direction":
            field_ = _turn(1, value["pitch"]) @ _turn(0, value["roll"]) @ machine.gravity
            machine = replace(machine, gravity=field_)
    return machine


def _with_payload(machine: Machine, where: str, mass: float) -> Machine:
    points = {name: (number, point) for name, number, point in machine.contacts}
    if where in points:
        number, point = points[where]
    else:
        number = machine.body(where)
        point = machine.links[number].com
    return machine.with_link(number, machine.links[number].with_point(mass, point))


def _redrawn(link: Link, value: Mapping[str, float]) -> Link:
    """Return a link of another density, with masses that its drawing lacks."""
    scale = value["scale"]
    link = replace(link, mass=scale * link.mass, inertia=scale * link.inertia)
    for k in range(POINTS):
        point = np.array([value[f"{axis}_{k}"] for axis in "xyz"])
        link = link.with_point(value[f"mass_{k}"], point)
    return link


def point_mass(mass: float, point: np.ndarray) -> dict[str, float]:
    """Return the values of a drawing that lacks one mass."""
    values = {"scale": 1.0, "mass_0": mass} | {f"mass_{k}": 0.0 for k in range(1, POINTS)}
    for k in range(POINTS):
        values |= {f"{axis}_{k}": float(x) for axis, x in zip("xyz", point, strict=True)}
    return values


def _turn(axis: int, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    j, k = (axis + 1) % 3, (axis + 2) % 3
    result = np.eye(3)
    result[j, j], result[j, k], result[k, j], result[k, k] = c, -s, s, c
    return result


def per_joint(
    machine: Machine, flaws: Sequence[Flaw], effect: str, parameter: str, absent: float
) -> np.ndarray:
    """Return one parameter of one effect at every driven joint, (m,)."""
    result = np.full(len(machine.driven), absent)
    for flaw in flaws:
        if flaw.effect == effect:
            result[machine.driven.index(flaw.where)] = flaw.values[parameter]
    return result


def loss_gains(machine: Machine, flaws: Sequence[Flaw]) -> tuple[np.ndarray, np.ndarray]:
    """Return (1/eta_f, eta_b) per gear: mesh input torque over output torque, both ways."""
    forward = backward = 1.0
    for name in ("transmission_efficiency", "load_presliding"):
        forward = forward / per_joint(machine, flaws, name, "forward_efficiency", 1.0)
        backward = backward * per_joint(machine, flaws, name, "backward_efficiency", 1.0)
    load = per_joint(machine, flaws, "load_friction", "coefficient", 0.0)
    return forward / (1.0 - load), backward / (1.0 + load)


def gains_at(
    machine: Machine, flaws: Sequence[Flaw], spin: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the gains of `loss_gains` (N, m) at speeds of the gears (N, m)."""
    forward, backward = (
        np.array(np.broadcast_to(g, spin.shape)) for g in loss_gains(machine, flaws)
    )
    for flaw in flaws:
        if flaw.effect == "load_stribeck_friction":
            j, p = machine.driven.index(flaw.where), flaw.values
            share = p["coefficient"] * np.exp(-((spin[:, j] / p["speed"]) ** 2))
            forward[:, j] /= 1.0 - share
            backward[:, j] /= 1.0 + share
    return forward, backward


_AT_JOINTS = {
    "viscous": ("viscous_friction", "coefficient", 0.0),
    "forward_viscous": ("directional_viscous_friction", "positive_direction", 0.0),
    "backward_viscous": ("directional_viscous_friction", "negative_direction", 0.0),
    "drag": ("quadratic_drag", "coefficient", 0.0),
    "coulomb": ("coulomb_friction", "level", 0.0),
    "stribeck": ("stribeck_friction", "level", 0.0),
    "stribeck_speed": ("stribeck_friction", "speed", 1.0),
    "spring": ("joint_spring", "stiffness", 0.0),
    "rest": ("joint_spring", "rest", 0.0),
    "ripple": ("torque_ripple", "amplitude", 0.0),
    "order": ("torque_ripple", "order", 0.0),
    "phase": ("torque_ripple", "phase", 0.0),
}


class AtJoints:
    """Smooth torques and dry friction beside joints: (..., m) arrays named as in `_AT_JOINTS`."""

    def __init__(self, parameters: Callable[[str, str, float], np.ndarray]) -> None:
        """Keep the parameters.

        Args:
            parameters: effect, parameter and what it is where the effect is absent -> its values.
        """
        self._values = {name: parameters(*entry) for name, entry in _AT_JOINTS.items()}

    def __getattr__(self, name: str) -> np.ndarray:
        try:
            return self.__dict__["_values"][name]
        except KeyError:
            raise AttributeError(name) from None

    def smooth(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return the torque (..., m) of smooth effects."""
        return (
            -self.viscous * v
            - np.where(v > 0.0, self.forward_viscous, self.backward_viscous) * v
            - self.drag * np.abs(v) * v
            - self.spring * (q - self.rest)
            + self.ripple * np.sin(self.order * q + self.phase)
        )

    def level(self, v: np.ndarray) -> np.ndarray:
        """Return the level (..., m) of dry friction that does not depend on load."""
        return self.coulomb + self.stribeck * np.exp(-((v / self.stribeck_speed) ** 2))


def thermal_torque(
    machine: Machine, flaws: Sequence[Flaw], v: np.ndarray, conditions: Conditions | None
) -> np.ndarray:
    """Return the torque (N, m) of viscous friction that depends on the temperature."""
    torque = np.zeros_like(v)
    for flaw in flaws:
        if flaw.effect == "thermal_viscous_friction" and conditions is not None:
            j, p = machine.driven.index(flaw.where), flaw.values
            warm = conditions.temperature[:, j] - LUBRICANT
            torque[:, j] -= p["coefficient"] * np.exp(-p["rate"] * warm) * v[:, j]
    return torque


def rotor_friction(
    machine: Machine, flaws: Sequence[Flaw], spin: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return (viscous torque (N, m), dry levels (m,)) at the motors; spin is (N, m)."""
    viscous = per_joint(machine, flaws, "rotor_viscous_friction", "coefficient", 0.0) * spin
    return viscous, per_joint(machine, flaws, "rotor_coulomb_friction", "level", 0.0)
