"""What a position servo may lack, as candidates for `benchmarks.bam`: numbers, bounds, starts."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf

from wbc.effects import (
    CoulombFriction,
    GravityDirection,
    LoadFriction,
    LoadStribeckFriction,
    StribeckFriction,
    ViscousFriction,
)
from wbc.identification.servo.servo_fit import Span
from wbc.robot import Effect, Robot
from wbc.robot.dc_drive import DcDrive

SUPPLY = 7.4  # [V]
# Data sheet of the XL330-M288 at 5 V: stalls with 0.52 N m and 1.47 A, idles at 103 rpm. That puts
# the torque constant between 0.354 (all losses inside) and 0.464 N m/A and the resistance at
# 3.40 ohm. Round numbers elsewhere.
SPANS = {
    "torque_constant": Span(0.1, 0.41, 1.5),
    "resistance": Span(0.5, 3.4, 12.0),
    "armature": Span(1e-4, 0.002, 0.02),
    "tilt": Span(-0.15, 0.0, 0.15),
    "coulomb": Span(0.0, 0.01, 0.2),
    "viscous": Span(0.0, 0.005, 0.1),
    "load": Span(0.0, 0.2, 0.9),
    "stribeck": Span(0.0, 0.01, 0.2),
    "stribeck_speed": Span(0.02, 0.5, 5.0),
    "load_stribeck": Span(0.0, 0.05, 0.9),
    "source_resistance": Span(0.0, 1.0, 8.0),
    "current_limit": Span(0.2, 1.75, 5.0),
    "heating": Span(0.0, 0.02, 1.0),
    "cooling": Span(0.0, 0.1, 3.0),
}
# Sticking makes the error of a rollout jump: further starts save a fit from a poor valley.
STARTS: tuple[dict[str, float], ...] = (
    {},
    {
        "load": 0.4,
        "stribeck": 0.03,
        "source_resistance": 3.0,
        "current_limit": 1.2,
        "heating": 0.1,
        "cooling": 1.0,
    },
    {"load": 0.35, "load_stribeck": 0.6, "stribeck_speed": 3.0},
    {"load_stribeck": 0.2},
)
# What the runs leave open stays near the starts above: [rad] per doubling.
HOLDS = {
    "all held": dict.fromkeys(SPANS, 0.1),
    "sheet held": {"torque_constant": 0.1, "resistance": 0.1, "tilt": 0.1},
}
BASE = ("torque_constant", "resistance", "armature", "tilt", "coulomb", "viscous")
STRIBECK = (*BASE, "load", "stribeck", "stribeck_speed")
LOAD_STRIBECK = (*STRIBECK, "load_stribeck")
CANDIDATES = {
    "coulomb, viscous": BASE,
    "+ load friction": (*BASE, "load"),
    "+ stribeck": STRIBECK,
    "+ load stribeck": LOAD_STRIBECK,
    "+ supply sag": (*STRIBECK, "source_resistance"),
    "+ current limit": (*STRIBECK, "current_limit"),
    "+ sag, limit": (*STRIBECK, "source_resistance", "current_limit"),
    "+ warm winding": (*STRIBECK, "heating", "cooling"),
    "+ sag, warm": (*STRIBECK, "source_resistance", "heating", "cooling"),
    "+ load stribeck, sag": (*LOAD_STRIBECK, "source_resistance"),
    "+ load stribeck, warm": (*LOAD_STRIBECK, "heating", "cooling"),
}
# Shown beside the others but not offered to the choice.
RIVALS = {"+ load stribeck, limit": (*LOAD_STRIBECK, "current_limit")}
ELECTRICAL = ("source_resistance", "current_limit", "heating")


def servo(base: Robot, values: Mapping[str, float]) -> tuple[Robot, DcDrive]:
    """Return robot and drive with these numbers; what is not given is not there."""
    gears = base.transmission.replace(
        torque_constant=[values["torque_constant"]],
        resistance=[values["resistance"]],
        rotor_inertia=[values["armature"]],
    )
    effects: list[Effect] = [
        # The bench's tilt or the zero of the encoder: for one joint they are the same.
        GravityDirection("robot", 0.0, values["tilt"]),
        CoulombFriction("shaft", values["coulomb"]),
        ViscousFriction("shaft", values["viscous"]),
    ]
    if "load" in values:
        effects.append(LoadFriction("shaft", values["load"]))
    for kind in (StribeckFriction, LoadStribeckFriction):
        level = values.get(kind.name.removesuffix("_friction"))
        if level is not None:
            effects.append(kind("shaft", level, values["stribeck_speed"]))
    robot = base.with_transmission(gears).with_effects(*effects)
    drive = DcDrive(
        SUPPLY,
        source_resistance=values.get("source_resistance", 0.0),
        current_limit=values.get("current_limit", inf),
        heating=values.get("heating", 0.0),
        cooling=values.get("cooling", 0.0),
    )
    return robot, drive
