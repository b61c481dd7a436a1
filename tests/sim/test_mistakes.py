"""What no plant, ground, body, sensor or loop can be is refused by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import coal
import numpy as np
import pinocchio as pin
import pytest

from tests.sim.bodies import free, one_joint
from tests.sim.random_robots import geared
from tests.sim.test_effect_memory import Maxwell
from wbc import load_robot
from wbc.effects import CoulombFriction, JointEffect, ThermalDrift
from wbc.errors import EffectError, RobotError, SimulationError, WbcError
from wbc.robot import ContactPoint, FreeBody, Robot
from wbc.robot.dc_drive import DcDrive
from wbc.sim import (
    Box,
    ClosedLoop,
    HeightField,
    HuntCrossley,
    Plane,
    Plant,
    Sensor,
    SensorModel,
    SensorNoise,
    Sphere,
    StepResult,
    Together,
    TorqueLag,
    simulate,
    with_wrong_efficiencies,
)
from wbc.sim.servo_rollout import servo_rollout
from wbc.sim.servo_run import ServoRun
from wbc.transmission import Transmission

FAR, NONE, TWO = Plane(height=-9.0), np.zeros(0), np.zeros(2)
LEG, ARM, SOLO = (load_robot(name) for name in ("planar_leg", "planar_leg_fixed", "solo12"))
DRIVE, SHAFT = DcDrive(7.4), load_robot("xl330_pendulum")
CUBE = coal.Box(0.1, 0.1, 0.1)


@dataclass(frozen=True)
class Forgetful(Maxwell):
    """An effect that has a memory and does not say how it goes on."""

    def next_memory(self, robot, motion, torque):
        return JointEffect.next_memory(self, robot, motion, torque)


def stepped(
    robot: Robot = LEG, torque: object = TWO, dt: float = 1e-3, at: object = None, v: object = None
) -> StepResult:
    plant = Plant(robot)
    return plant.step(plant.state(robot.pose() if at is None else at, v), torque, dt)


def forgotten() -> StepResult:
    plant = Plant(ARM.with_effect(Forgetful("hip", 1.0, 1.0)), FAR)
    return plant.step(plant.state([0.3, -0.6]), TWO, 1e-3)


def other_memory() -> StepResult:
    drifting = Plant(ARM.with_effect(ThermalDrift("knee", 0.3, 1.2)), FAR)
    state = drifting.step(drifting.state([0.3, -0.6]), TWO, 1e-3).state
    return Plant(ARM, FAR).step(state, TWO, 1e-3)


def sunk_by(depth: float) -> np.ndarray:
    q = SOLO.pose()
    q[2] -= depth
    return q


def log_of_a_step() -> object:
    plant = Plant(LEG)
    return simulate(plant, lambda s: TWO, plant.state(LEG.pose()), 1e-2).log


def without_mass() -> Plant:
    arm = one_joint(pin.JointModelRY(), pin.Inertia.Zero(), gear_ratio=50.0, rotor_inertia=1e-5)
    return Plant(arm, FAR)


def locking(rotor: float) -> Robot:
    body = pin.Inertia(2.0, np.array([0.0, 0.0, -0.3]), 0.02 * np.eye(3))
    gears = {"forward_efficiency": 0.4, "backward_efficiency": -0.5, "rotor_inertia": rotor}
    return one_joint(pin.JointModelRY(), body, gear_ratio=50.0, **gears)


def heavy_rotors() -> Plant:
    many = np.where(np.arange(12) == 4, 1e5, 1.0) * SOLO.transmission.rotor_inertia
    return Plant(replace(geared(SOLO, rotor_inertia=many), rotors_turn_with_links=True))


def mixed_order() -> Robot:
    """Pinocchio fills the inertia matrix subtree by subtree; it would be wrong without a word."""
    model, turning = pin.Model(), pin.JointModelRY()
    left = model.addJoint(0, turning, pin.SE3.Identity(), "left")
    model.addJoint(0, turning, pin.SE3.Identity(), "right")
    model.addJoint(left, turning, pin.SE3.Identity(), "left_again")
    return Robot("mixed", model, Transmission(("left",), np.array([10.0]), np.array([1e-5])))


def servo(*robots: Robot) -> object:
    run = ServoRun("run", 2.0, np.zeros(3), np.ones(3), np.zeros(3))
    return servo_rollout([(robot, DRIVE) for robot in robots], [run], 0.01)


MISTAKES: list[tuple[type[WbcError], str, Callable[[], object]]] = [
    # steps and states
    (SimulationError, "2 rotors: hip, knee", lambda: stepped(torque=np.zeros(3))),
    (SimulationError, "dt must be positive", lambda: stepped(dt=0.0)),
    (SimulationError, "no number", lambda: stepped(torque=np.array([np.nan, 0.0]))),
    (SimulationError, "position q", lambda: Plant(LEG).state(np.zeros(3))),
    (SimulationError, "two ticks", lambda: simulate(Plant(LEG), None, stepped().state, 1e-4)),
    (SimulationError, "effects with a memory: none", other_memory),
    (EffectError, "no next_memory", forgotten),
    (
        SimulationError,
        r"contact 'foot' is \d+ mm inside the ground",
        lambda: stepped(ARM, at=[1.2, 0.3]),
    ),
    (
        SimulationError,
        "10 mm inside the ground",
        lambda: stepped(SOLO, np.zeros(12), at=sunk_by(0.01)),
    ),
    (
        SimulationError,
        "cannot be lifted out of the ground: contact 'foot'",
        lambda: Plant(ARM, Plane(height=3.0)).state([0.1, 0.2], lifted=True),
    ),
    # 1e31 J were 'some body without mass'; a body without mass still is
    (
        SimulationError,
        r"blown up: .* J",
        lambda: stepped(SOLO, np.zeros(12), at=sunk_by(-1.0), v=1e160 * np.ones(18)),
    ),
    # plants and robots
    (SimulationError, "without mass", without_mass),
    (SimulationError, "restitution", lambda: Plant(LEG, restitution=1.5)),
    (SimulationError, "return_speed must be positive", lambda: Plant(LEG, return_speed=0.0)),
    (SimulationError, '"feet" or "all"', lambda: Plant(LEG, bodies="legs")),
    (RobotError, "no collision geometry", lambda: Plant(LEG, bodies="all")),
    (SimulationError, "'joint' is self-locking", lambda: Plant(locking(0.0))),
    # its kinetic energy could be negative: no solver helps
    (SimulationError, rf"rotor of '{SOLO.transmission.joints[4]}'.*be negative", heavy_rotors),
    (RobotError, "depth-first", mixed_order),
    (RobotError, "mass and volume must be positive", lambda: free(FreeBody("box", CUBE, 0.0))),
    (
        SimulationError,
        "body with collision geometry",
        lambda: Plant(free(FreeBody("box", CUBE, 1.0), pairs=(("box", "bag"),))),
    ),
    (
        RobotError,
        "radius must be >= 0",
        lambda: ContactPoint("foot", "body", np.zeros(3), 0.5, -0.1),
    ),
    # grounds
    (
        SimulationError,
        "size of the box must be positive",
        lambda: Box(np.zeros(3), np.array([1.0, 0.0, 1.0])),
    ),
    (
        SimulationError,
        "no rotation matrix",
        lambda: Box(np.zeros(3), np.ones(3), 2.0 * np.eye(3)),
    ),
    (SimulationError, "radius of the sphere", lambda: Sphere(np.zeros(3), 0.0)),
    (
        SimulationError,
        "at least four entries",
        lambda: HeightField(np.arange(3.0), np.arange(4.0), np.zeros((3, 4))),
    ),
    (
        SimulationError,
        "heights of the height field",
        lambda: HeightField(np.arange(4.0), np.arange(5.0), np.zeros((4, 4))),
    ),
    (SimulationError, "at least one part", lambda: Together(())),
    (SimulationError, "compliant contacts need", lambda: HuntCrossley(0.0, 0.1)),
    (SimulationError, "compliant contacts need", lambda: HuntCrossley(np.inf, 0.1)),
    (SimulationError, "compliant contacts need", lambda: HuntCrossley(1e6, -0.1)),
    # sensors and loops
    (
        SimulationError,
        r"elbow\.position",
        lambda: SensorModel(columns={"elbow.position": Sensor()}).measure(LEG, log_of_a_step(), 0),
    ),
    (SimulationError, "noise", lambda: Sensor(noise=-1.0)),
    (SimulationError, "velocity noise", lambda: SensorNoise(ARM, velocity=-1.0)),
    (SimulationError, "position noise", lambda: SensorNoise(ARM, position=np.nan)),
    (SimulationError, "delay of the command", lambda: TorqueLag(delay=-1e-3)),
    (SimulationError, "delay of the command", lambda: TorqueLag(delay=np.inf)),
    (SimulationError, "bandwidth", lambda: TorqueLag(bandwidth=0.0)),
    (SimulationError, "bandwidth", lambda: TorqueLag(bandwidth=np.nan)),
    (SimulationError, "next command", lambda: TorqueLag()(TWO, 0.0)),
    (SimulationError, "period", lambda: ClosedLoop(Plant(ARM, FAR), None, period=0.0)),
    (SimulationError, "off by -1", lambda: with_wrong_efficiencies(ARM, -1.0)),
    (SimulationError, "off by nan", lambda: with_wrong_efficiencies(ARM, np.nan)),
    (RobotError, "2 joints", lambda: servo(load_robot("double_pendulum"))),
    (RobotError, "torque_constant", lambda: servo(load_robot("sts3250_pendulum"))),
    (
        RobotError,
        "same effects",
        lambda: servo(SHAFT, SHAFT.with_effect(CoulombFriction("shaft", 0.1))),
    ),
]


@pytest.mark.parametrize(("error", "message", "make"), MISTAKES)
def test_a_mistake_is_named(
    error: type[WbcError], message: str, make: Callable[[], object]
) -> None:
    with pytest.raises(error, match=message):
        make()
