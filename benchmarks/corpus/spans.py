"""Small flaws that span what an effect can do at a place: columns for comparing causes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from benchmarks.corpus.conditions import NOMINAL
from benchmarks.corpus.flaws import AT_MOTORS, DRAWING, WHOLE_ROBOT, Flaw, point_mass
from benchmarks.corpus.machine import Link
from benchmarks.corpus.recipes import Typical

Span = tuple[Flaw, ...]  # one column each

_SLOWNESS = (0.1, 0.2, 0.4, 0.8)
_BENT = (0.05, 0.08, 0.125, 0.2)  # [rad], the range that is drawn
_BENT_UNDER_LOAD = (0.03, 0.05, 0.08, 0.15)
_ORDERS = (0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 20.0, 30.0)
_WARMING = (0.1, 0.4, 2.0, 10.0)
_CLIPPED = (0.05, 0.15, 0.25, 0.4)
_THINNING = (0.015, 0.025, 0.04, 0.06)  # [1/K], the range that is drawn
_SMALL = 1e-3


def spans_of(effect: str, where: str, typical: Typical) -> Iterator[Span]:
    """Yield every shape of an effect at a place as the flaws whose signatures span it."""
    machine = typical.machine
    if where not in machine.driven:
        if effect == DRAWING:
            yield _drawing(machine.links[machine.body(where)])
        yield from _of_bodies(effect, where)
        return
    j = machine.driven.index(where)
    torque, speed = float(typical.torque[j]), float(typical.speed[j])

    def flaw(**values: float) -> Flaw:
        return Flaw(effect, where, values)

    if effect == "transmission_efficiency":
        less = 1.0 - _SMALL
        pairs = ((less, less), (less, 1.0), (1.0, less))
        both = tuple(flaw(forward_efficiency=f, backward_efficiency=b) for f, b in pairs)
        yield from ((one,) for one in both)
        yield both[1:]
    elif effect == "load_presliding":
        less = 1.0 - _SMALL
        for length in _BENT_UNDER_LOAD:
            yield tuple(
                flaw(forward_efficiency=f, backward_efficiency=b, length=length)
                for f, b in ((less, 1.0), (1.0, less))
            )
    elif effect == "directional_viscous_friction":
        yield tuple(
            flaw(
                positive_direction=_SMALL * torque * f,
                negative_direction=_SMALL * torque * (1.0 - f),
            )
            for f in (1.0, 0.0)
        )
    elif effect == "thermal_viscous_friction":
        yield from ((flaw(coefficient=_SMALL * torque, rate=rate),) for rate in _THINNING)
    elif effect == "voltage_scaling":
        yield tuple(flaw(share=_SMALL, nominal=f * NOMINAL) for f in (0.8, 1.1))
    elif effect == "stribeck_friction":
        yield from ((flaw(level=_SMALL * torque, speed=s * speed),) for s in _SLOWNESS)
    elif effect == "load_stribeck_friction":
        yield from ((flaw(coefficient=_SMALL, speed=s * speed),) for s in _SLOWNESS)
    elif effect == "presliding":
        yield from ((flaw(level=_SMALL * torque, length=length),) for length in _BENT)
    elif effect == "joint_spring":
        yield tuple(flaw(stiffness=_SMALL * torque, rest=rest) for rest in (0.0, 1.0))
        center = float(machine.center[j])
        yield from ((flaw(stiffness=_SMALL * torque, rest=center + r),) for r in (-0.5, 0.0, 0.5))
    elif effect == "torque_ripple":
        for order in _ORDERS:
            yield tuple(
                flaw(amplitude=_SMALL * torque, order=order, phase=phase)
                for phase in (0.0, 0.5 * np.pi)
            )
    elif effect == "thermal_drift":
        for share in _WARMING:
            yield (flaw(rate=1e-4, time_constant=max(share * typical.duration, 1.0)),)
    elif effect == "current_limit":
        yield from ((flaw(limit=float(typical.peak[j]) * (1.0 - u)),) for u in _CLIPPED)
    elif effect == "joint_compliance":
        yield (flaw(stiffness=1e3 * torque, damping=1.0),)
    elif effect == "rotor_inertia":
        yield (flaw(reflected_inertia=(1.0 + _SMALL) * float(machine.reflected[j])),)
    elif effect in _PLAIN:
        name, absent = _PLAIN[effect]
        scale = torque if effect.endswith(("friction", "offset", "drag")) else 1.0
        yield (Flaw(effect, where, {name: absent + _SMALL * (scale if absent == 0.0 else 1.0)}),)


_PLAIN = {
    "viscous_friction": ("coefficient", 0.0),
    "coulomb_friction": ("level", 0.0),
    "rotor_viscous_friction": ("coefficient", 0.0),
    "rotor_coulomb_friction": ("level", 0.0),
    "quadratic_drag": ("coefficient", 0.0),
    "load_friction": ("coefficient", 0.0),
    "torque_offset": ("offset", 0.0),
    "position_offset": ("offset", 0.0),
    "actuation_delay": ("delay", 0.0),
    "torque_constant": ("factor", 1.0),
}


def _of_bodies(effect: str, where: str) -> Iterator[Span]:
    if effect == "payload_mass":
        yield (Flaw(effect, where, {"mass": _SMALL}),)
    elif effect == "supply_sag":
        yield (Flaw(effect, where, {"coefficient": 1e-6}),)
    elif effect == "center_of_mass":
        shifts = tuple(
            Flaw(effect, where, dict(zip("xyz", row, strict=True)))
            for row in (_SMALL * np.eye(3)).tolist()
        )
        yield from ((one,) for one in shifts)
        yield shifts
    elif effect == "gravity_direction":
        turns = tuple(
            Flaw(effect, where, {"roll": r, "pitch": p}) for r, p in ((_SMALL, 0.0), (0.0, _SMALL))
        )
        yield from ((one,) for one in turns)
        yield turns


def _drawing(link: Link) -> Span:
    """Return ten masses at points of a link: together they span every change of its inertia."""
    size = 2.0 * float(np.sqrt(np.trace(link.inertia) / link.mass))
    ways = np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3), 1.0 - np.eye(3)])
    return tuple(
        Flaw(DRAWING, link.name, point_mass(_SMALL * link.mass, link.com + size * way))
        for way in ways
    )


def places_of(effect: str, typical: Typical) -> tuple[str, ...]:
    """Return where an effect can be."""
    machine = typical.machine
    if effect in WHOLE_ROBOT:
        return ("robot",)
    if effect == "payload_mass":
        return (*machine.bodies, *(name for name, _, _ in machine.contacts))
    if effect in ("center_of_mass", DRAWING):
        return machine.bodies
    if effect in AT_MOTORS:
        return machine.coupled
    return machine.driven
