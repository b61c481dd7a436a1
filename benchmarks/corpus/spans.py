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
    if where in machine.driven:
        for shape in _at_joint(machine.driven.index(where), typical).get(effect, ()):
            yield tuple(Flaw(effect, where, values) for values in shape)
    elif effect == DRAWING:
        yield _drawing(machine.links[machine.body(where)])
    else:
        yield from _of_bodies(effect, where)


def _at_joint(j: int, typical: Typical) -> dict[str, list[list[dict[str, float]]]]:
    """Return the values that span each shape of every effect of joint j."""
    torque, speed = float(typical.torque[j]), float(typical.speed[j])
    push, less, center = _SMALL * torque, 1.0 - _SMALL, float(typical.machine.center[j])

    def losing(forward: float, backward: float) -> dict[str, float]:
        return {"forward_efficiency": forward, "backward_efficiency": backward}

    ways = [losing(less, 1.0), losing(1.0, less)]
    peak, reflected = float(typical.peak[j]), float(typical.machine.reflected[j])
    return {
        "viscous_friction": [[{"coefficient": push}]],
        "coulomb_friction": [[{"level": push}]],
        "rotor_viscous_friction": [[{"coefficient": push}]],
        "rotor_coulomb_friction": [[{"level": push}]],
        "quadratic_drag": [[{"coefficient": push}]],
        "load_friction": [[{"coefficient": push}]],
        "torque_offset": [[{"offset": push}]],
        "position_offset": [[{"offset": push}]],
        "actuation_delay": [[{"delay": _SMALL}]],
        "torque_constant": [[{"factor": 1.0 + _SMALL}]],
        "transmission_efficiency": [[losing(less, less)], *([way] for way in ways), ways],
        "load_presliding": [[{**w, "length": x} for w in ways] for x in _BENT_UNDER_LOAD],
        "directional_viscous_friction": [
            [
                {"positive_direction": push, "negative_direction": 0.0},
                {"positive_direction": 0.0, "negative_direction": push},
            ]
        ],
        "thermal_viscous_friction": [[{"coefficient": push, "rate": x}] for x in _THINNING],
        "voltage_scaling": [[{"share": _SMALL, "nominal": f * NOMINAL} for f in (0.8, 1.1)]],
        "stribeck_friction": [[{"level": push, "speed": x * speed}] for x in _SLOWNESS],
        "load_stribeck_friction": [
            [{"coefficient": _SMALL, "speed": x * speed}] for x in _SLOWNESS
        ],
        "presliding": [[{"level": push, "length": x}] for x in _BENT],
        "joint_spring": [
            [{"stiffness": push, "rest": rest} for rest in (0.0, 1.0)],
            *([{"stiffness": push, "rest": center + rest}] for rest in (-0.5, 0.0, 0.5)),
        ],
        "torque_ripple": [
            [{"amplitude": push, "order": x, "phase": phase} for phase in (0.0, 0.5 * np.pi)]
            for x in _ORDERS
        ],
        "thermal_drift": [
            [{"rate": 1e-4, "time_constant": max(share * typical.duration, 1.0)}]
            for share in _WARMING
        ],
        "current_limit": [[{"limit": peak * (1.0 - share)}] for share in _CLIPPED],
        "joint_compliance": [[{"stiffness": 1e3 * torque, "damping": 1.0}]],
        "rotor_inertia": [[{"reflected_inertia": (1.0 + _SMALL) * reflected}]],
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
