"""What a position servo may lack: models from few numbers to many, in sizes of its own motor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wbc.effects.friction.coulomb_friction import CoulombFriction
from wbc.effects.friction.load_friction import LoadFriction
from wbc.effects.friction.stribeck_friction import StribeckFriction
from wbc.effects.friction.viscous_friction import ViscousFriction
from wbc.effects.links.gravity_direction import GravityDirection
from wbc.errors import IdentificationError
from wbc.identification.servo.servo_fit import Span
from wbc.robot import Effect, Robot, state_gear
from wbc.robot.dc_drive import DcDrive

_FRICTION = ("torque_constant", "resistance", "rotor_inertia", "tilt", "coulomb", "viscous")
_STRIBECK = (*_FRICTION, "load", "stribeck", "stribeck_speed")
MODELS: dict[str, tuple[str, ...]] = {
    "Coulomb and viscous friction": _FRICTION,
    "and load friction": (*_FRICTION, "load"),
    "and Stribeck friction": _STRIBECK,
    "and supply sag": (*_STRIBECK, "source_resistance"),
}
"""Name of a model -> its numbers; each holds those of the one before."""

UNITS = {
    "torque_constant": "N m/A",
    "resistance": "ohm",
    "rotor_inertia": "kg m^2",
    "tilt": "rad",
    "coulomb": "N m",
    "viscous": "N m s/rad",
    "load": "1",
    "stribeck": "N m",
    "stribeck_speed": "rad/s",
    "source_resistance": "ohm",
}
# Bounds of the motor's numbers, as a factor; fits of the recorded XL330 move them by 1.7 at most.
_SHEET = 3.0


@dataclass(frozen=True, eq=False)
class ServoModels:
    """The models of one servo.

    Attributes:
        robot: as it was given, with one driven joint and the numbers of its motor.
        spans: bounds and start of each number.
        axis: (3,) of the joint at its zero, world.
    """

    robot: Robot
    spans: Mapping[str, Span]
    axis: np.ndarray

    @classmethod
    def of(cls, robot: Robot) -> ServoModels:
        """Return the models of a robot.

        Bounds and starts are shares of the motor's stall torque and idle speed; those of the
        recorded XL330 servo.

        Raises:
            IdentificationError: more than one joint, or a motor without its numbers.
        """
        gears = robot.transmission
        if robot.model.nv != 1 or gears.size != 1:
            raise IdentificationError(
                f"'{robot.name}' has {robot.model.nv} joints; a rollout of a servo is for one "
                "driven joint. Lock the others in robot.toml."
            )
        lacking = [
            name
            for name in ("torque_constant", "resistance", "supply_voltage")
            if not np.isfinite(getattr(gears, name)[0])
        ]
        if lacking:
            raise IdentificationError(
                f"'{robot.name}': a rollout needs the motor's {', '.join(lacking)}; "
                + state_gear(gears.joints[0], *lacking)
            )
        return cls(robot, _spans(robot), _axis(robot))

    def build(self, values: Mapping[str, float]) -> tuple[Robot, DcDrive]:
        """Return robot and drive with these numbers; what is not given is not there."""
        gears = self.robot.transmission
        joint, ratio = gears.joints[0], float(gears.gear_ratio[0])
        changed = gears.replace(
            torque_constant=[values["torque_constant"]],
            resistance=[values["resistance"]],
            rotor_inertia=[values["rotor_inertia"] / ratio**2],
        )
        robot = self.robot.with_transmission(changed).with_effects(*self.effects(values, joint))
        supply = float(gears.supply_voltage[0])
        return robot, DcDrive(supply, source_resistance=values.get("source_resistance", 0.0))

    def effects(self, values: Mapping[str, float], joint: str) -> list[Effect]:
        """Return the effects that numbers stand for."""
        roll, pitch = (float(values["tilt"] * share) for share in self.axis[:2])
        found: list[Effect] = [
            GravityDirection("robot", roll, pitch),
            CoulombFriction(joint, values["coulomb"]),
            ViscousFriction(joint, values["viscous"]),
        ]
        if "load" in values:
            found.append(LoadFriction(joint, values["load"]))
        if "stribeck" in values:
            found.append(StribeckFriction(joint, values["stribeck"], values["stribeck_speed"]))
        return found

    def of_model(self, name: str) -> dict[str, Span]:
        """Return the spans of one model's numbers."""
        return {number: self.spans[number] for number in MODELS[name]}


def _spans(robot: Robot) -> dict[str, Span]:
    gears = robot.transmission
    ratio = abs(float(gears.gear_ratio[0]))
    constant, resistance = float(gears.torque_constant[0]), float(gears.resistance[0])
    stall = ratio * constant * float(gears.supply_voltage[0]) / resistance
    idle = float(gears.supply_voltage[0]) / (constant * ratio)
    rotor = float(gears.reflected_inertia[0])
    link = float(pin.crba(robot.model, robot.model.createData(), robot.neutral())[0, 0])
    return {
        "torque_constant": Span(constant / _SHEET, constant, _SHEET * constant),
        "resistance": Span(resistance / _SHEET, resistance, _SHEET * resistance),
        "rotor_inertia": Span(0.0, rotor or 0.1 * link, 10.0 * max(rotor, link)),
        "tilt": Span(-0.15, 0.0, 0.15),
        "coulomb": Span(0.0, 0.015 * stall, 0.3 * stall),
        "viscous": Span(0.0, 0.1 * stall / idle, 3.0 * stall / idle),
        "load": Span(0.0, 0.2, 0.9),
        "stribeck": Span(0.0, 0.015 * stall, 0.3 * stall),
        "stribeck_speed": Span(0.001 * idle, 0.025 * idle, 0.25 * idle),
        "source_resistance": Span(0.0, 0.3 * resistance, 2.0 * resistance),
    }


def _axis(robot: Robot) -> np.ndarray:
    """Return the direction (3,) of the joint in the world, by which gravity may be tilted."""
    data = robot.model.createData()
    pin.computeJointJacobians(robot.model, data, robot.neutral())
    jacobian = pin.getJointJacobian(robot.model, data, 1, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
    return np.asarray(jacobian).reshape(6, -1)[3:, 0]


def firsts(names: Sequence[str], fitted: Mapping[str, float] | None) -> list[dict[str, float]]:
    """Return the starts of a fit: the usual ones, and those that a smaller model ended at."""
    if fitted is None:
        return [{}]
    return [{}, {name: fitted[name] for name in names if name in fitted}]
