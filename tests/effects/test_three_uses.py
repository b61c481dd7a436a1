"""One robot, three uses: its logs, its plant and its controller need the same torque.

Logs ask the hooks of effects, in NumPy; plant and controller have the laws of most effects compiled
into their loops. Whether a law is the right one is asked of logs by the plants of other tests.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import final

import numpy as np
import pinocchio as pin
import pytest

from tests.control.scenes import CERTAIN
from tests.effects.test_effect_catalogue import Drag
from tests.sim.random_robots import geared
from wbc import control, load_robot
from wbc.arrays import FloatArray
from wbc.dynamics import contact_torque, link_torque, rotor_torque
from wbc.effects import CurrentLimit, CustomTorque, effect_class
from wbc.robot import Motion, Robot
from wbc.sim import Plane, Plant

FAR = Plane(height=-50.0)
SHORT = 1e-6  # [s], over which a step of the plant is an acceleration


@final
@dataclass(frozen=True)
class RubbingDrag(Drag):
    """An effect as a user writes it: a drag, and a dry level that falls with position."""

    level: float = 0.0

    def joint_friction(self, robot: Robot, motion: Motion) -> FloatArray:
        place = self.joint_position(robot, motion)
        return self.on_joint(robot, motion, self.level / (1.0 + place**2))


COMPILED: dict[str, tuple[float, ...]] = {
    "viscous_friction": (0.04,),
    "directional_viscous_friction": (0.05, 0.02),
    "coulomb_friction": (0.08,),
    "stribeck_friction": (0.06, 0.2),
    "quadratic_drag": (0.01,),
    "joint_spring": (0.5, 0.2),
    "torque_ripple": (0.05, 7.0, 0.3),
    "torque_constant": (1.07,),
    "torque_offset": (-0.03,),
    "load_stribeck_friction": (0.1, 0.3),
    "rotor_inertia": (0.03,),
    "transmission_efficiency": (0.6, 0.5),
}
# Drives whose torque depends on more take those above out of the compiled loops, too.
BY_HOOKS: dict[str, tuple[float, ...]] = {
    "thermal_viscous_friction": (0.03, 0.02),
    "voltage_scaling": (0.5, 20.0),
    "supply_sag": (0.001,),
    "load_friction": (0.1,),
}
MIXES = {"compiled": COMPILED, "by hooks": {**COMPILED, **BY_HOOKS}}


def lossy(name: str, mix: str) -> Robot:
    """Return a robot with each effect at most of its joints, in numbers that differ by place."""
    robot, added = geared(load_robot(name), supply_voltage=17.0), []
    gears = robot.transmission
    for k, (kind, numbers) in enumerate(MIXES[mix].items()):
        cls = effect_class(kind)
        names = [parameter.name for parameter in cls.parameters]
        places = gears.joints if cls.places(robot) != ("robot",) else ("robot",)
        for i, where in enumerate(places):
            if (i + k) % 4 != 3:
                values = ((1.0 + 0.05 * (i % 8)) * numbers[0], *numbers[1:])
                added.append(cls.at(where, dict(zip(names, values, strict=True))))
    for i, joint in enumerate(gears.joints if mix == "by hooks" else ()):
        formula = f"sin(q_{joint}) * |v_{joint}|", f"|q_{joint}| * sign(v_{joint})"
        added.append(RubbingDrag(joint, 0.01, level=0.02 * (i + 1)))
        added.append(CustomTorque.at(joint, dict.fromkeys(formula, -0.05)))
    return robot.with_effects(*added)


def states(robot: Robot) -> list[tuple[FloatArray, FloatArray, FloatArray]]:
    """Return some (q, v, a)."""
    drawn, start = np.random.default_rng(1).normal(size=(10, 3, robot.model.nv)), robot.neutral()
    return [(pin.integrate(robot.model, start, 0.3 * moved), v, a) for moved, v, a in drawn]


def needed(
    robot: Robot, q: FloatArray, v: FloatArray, a: FloatArray, forces: Mapping[str, FloatArray]
) -> FloatArray:
    """Return what a log of this motion needs, at rotors and at joints without one."""
    motion = Motion(q[None], v[None], a[None])
    pushed = contact_torque(robot, q[None], {name: f[None] for name, f in forces.items()})
    torque, rest = rotor_torque(robot, motion, link_torque(robot, motion), pushed)
    return np.concatenate([torque[0], rest[0]])


@pytest.mark.parametrize("mix", MIXES)
@pytest.mark.parametrize("name", ["planar_leg", "parallelogram_leg", "solo12"])
def test_the_plant_moves_as_a_log_needs_the_torque_that_it_was_given(name: str, mix: str) -> None:
    robot = lossy(name, mix)
    plant, gears = Plant(robot, FAR), robot.transmission
    for q, v, drawn in states(robot):
        torque = 0.05 * np.tanh(drawn[robot.actuated])
        after = plant.step(plant.state(q, v), torque, SHORT).state.velocity
        found = needed(robot, q, v, (after - v) / SHORT, {})
        np.testing.assert_allclose(found[: gears.size], torque, rtol=0.0, atol=1e-6)
        np.testing.assert_allclose(found[gears.size :], 0.0, atol=1e-3)


STANDING = {
    "planar_leg_fixed": (),
    "staubli_tx40": (),
    "planar_leg_strong": ("foot",),
    "parallelogram_leg": ("foot",),
    "differential_biped": ("left_toe", "right_toe"),
    "solo12": ("FL_foot", "FR_foot", "HL_foot", "HR_foot"),
    "talos": ("left_sole_front_left", "right_sole_front_left"),
}


@pytest.mark.parametrize("mix", [*MIXES, "coupled rotors"])
@pytest.mark.parametrize("name", STANDING)
def test_the_controller_commands_what_a_log_of_its_motion_needs(name: str, mix: str) -> None:
    robot = lossy(name, mix) if mix in MIXES else load_robot(name)
    robot, m = replace(robot, rotors_turn_with_links=mix not in MIXES), robot.transmission.size
    contacts = [control.PointContact(name=foot) for foot in STANDING[name]]
    task = control.PostureTask.of(robot)
    tasks = [task, control.CenterOfMassTask(weight=0.01)] if contacts else [task]
    settings = control.ControllerSettings(speed_blend=CERTAIN)
    controller = control.Controller(robot, tasks, contacts, [], settings)
    for q, v, a in states(robot):
        wanted = control.Reference(q[robot.actuated_position], v[robot.actuated], a[robot.actuated])
        command = controller.step(Motion(q, v), {task.name: wanted})
        assert command.status.usable, command.message
        assert command.consistent
        if not contacts:
            np.testing.assert_allclose(command.acceleration, a, atol=1e-5)
        scale = 1.0 + max((np.abs(force).max() for force in command.forces.values()), default=0.0)
        found = needed(robot, q, v, command.acceleration, command.forces)
        np.testing.assert_allclose(found[:m], command.rotor_torque, rtol=1e-12, atol=1e-6 * scale)
        np.testing.assert_allclose(found[m:], 0.0, atol=1e-5 * scale)


def test_a_drive_gives_no_more_than_its_limit(leg: Robot) -> None:
    plant, start = Plant(leg.with_effect(CurrentLimit("hip", 1.0)), FAR), np.zeros(2)
    asked = np.array([[3.0, 2.0], [1.0, 2.0]]) / leg.transmission.gear_ratio
    more, most = (plant.step(plant.state(start), torque, 1e-3).state for torque in asked)
    np.testing.assert_array_equal(more.velocity, most.velocity)
