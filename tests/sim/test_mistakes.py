"""What no plant, ground, body, sensor or loop can be is refused by name."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import coal
import numpy as np
import pinocchio as pin
import pytest

from tests.sim.bodies import free, one_joint
from tests.sim.random_robots import geared
from tests.sim.test_effect_memory import Maxwell
from wbc import load_robot, sim
from wbc.effects import CoulombFriction, JointEffect, ThermalDrift
from wbc.errors import EffectError, RobotError, SimulationError, WbcError
from wbc.robot import ContactPoint, FreeBody, Robot
from wbc.sim.servo_rollout import DcDrive, ServoRun, servo_rollout
from wbc.transmission import Transmission

FAR, NONE, TWO = sim.Plane(height=-9.0), np.zeros(0), np.zeros(2)
LEG, ARM, SOLO = (load_robot(name) for name in ("planar_leg", "planar_leg_fixed", "solo12"))
DRIVE, SHAFT = DcDrive(7.4), load_robot("xl330_pendulum")
RAISED = sim.Plant(ARM, sim.Plane(height=3.0))


@dataclass(frozen=True)
class Forgetful(Maxwell):
    """An effect that has a memory and does not say how it goes on."""

    def next_memory(self, robot, motion, torque):
        return JointEffect.next_memory(self, robot, motion, torque)


def stepped(
    robot: Robot = LEG, torque: object = TWO, dt: float = 1e-3, at: object = None, v: object = None
) -> sim.StepResult:
    plant = sim.Plant(robot)
    return plant.step(plant.state(robot.pose() if at is None else at, v), torque, dt)


def forgotten() -> sim.StepResult:
    plant = sim.Plant(ARM.with_effect(Forgetful("hip", 1.0, 1.0)), FAR)
    return plant.step(plant.state([0.3, -0.6]), TWO, 1e-3)


def other_memory() -> sim.StepResult:
    drifting = sim.Plant(ARM.with_effect(ThermalDrift("knee", 0.3, 1.2)), FAR)
    state = drifting.step(drifting.state([0.3, -0.6]), TWO, 1e-3).state
    return sim.Plant(ARM, FAR).step(state, TWO, 1e-3)


def sunk_by(depth: float) -> np.ndarray:
    q = SOLO.pose()
    q[2] -= depth
    return q


def boxed(mass: float, **pairs) -> Robot:
    return free(FreeBody("box", coal.Box(0.1, 0.1, 0.1), mass), **pairs)


def turning(body: pin.Inertia, **gears: float) -> sim.Plant:
    return sim.Plant(one_joint(pin.JointModelRY(), body, gear_ratio=50.0, **gears), FAR)


LOCKING = {"forward_efficiency": 0.4, "backward_efficiency": -0.5, "rotor_inertia": 0.0}


def heavy_rotors() -> sim.Plant:
    many = np.where(np.arange(12) == 4, 1e5, 1.0) * SOLO.transmission.rotor_inertia
    return sim.Plant(replace(geared(SOLO, rotor_inertia=many), rotors_turn_with_links=True))


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


SIMULATION: list[tuple[str, Callable[[], object]]] = [
    ("2 rotors: hip, knee", lambda: stepped(torque=np.zeros(3))),
    ("dt must be positive", lambda: stepped(dt=0.0)),
    ("no number", lambda: stepped(torque=np.array([np.nan, 0.0]))),
    ("position q", lambda: sim.Plant(LEG).state(np.zeros(3))),
    ("two ticks", lambda: sim.simulate(sim.Plant(LEG), None, stepped().state, 1e-4)),
    ("effects with a memory: none", other_memory),
    (r"contact 'foot' is \d+ mm inside the ground", lambda: stepped(ARM, at=[1.2, 0.3])),
    ("10 mm inside the ground", lambda: stepped(SOLO, np.zeros(12), at=sunk_by(0.01))),
    ("cannot be lifted out of the ground: contact 'foot'", lambda: RAISED.state(TWO, lifted=True)),
    # 1e31 J were 'some body without mass'; a body without mass still is
    (
        "blown up: .* J",
        lambda: stepped(SOLO, np.zeros(12), 1e-3, sunk_by(-1.0), np.full(18, 1e160)),
    ),
    ("without mass", lambda: turning(pin.Inertia.Zero(), rotor_inertia=1e-5)),
    ("restitution", lambda: sim.Plant(LEG, restitution=1.5)),
    ("return_speed must be > 0", lambda: sim.Plant(LEG, return_speed=0.0)),
    ('"feet" or "all"', lambda: sim.Plant(LEG, bodies="legs")),
    ("'joint' is self-locking", lambda: turning(pin.Inertia.Random(), **LOCKING)),
    # its kinetic energy could be negative: no solver helps
    (rf"rotor of '{SOLO.transmission.joints[4]}'.*be negative", heavy_rotors),
    ("body with collision geometry", lambda: sim.Plant(boxed(1.0, pairs=(("box", "bag"),)))),
    ("size of the box must be positive", lambda: sim.Box(np.zeros(3), np.array([1.0, 0.0, 1.0]))),
    ("no rotation matrix", lambda: sim.Box(np.zeros(3), np.ones(3), 2.0 * np.eye(3))),
    ("sphere: radius", lambda: sim.Sphere(np.zeros(3), 0.0)),
    ("at least four entries", lambda: sim.HeightField(range(3), range(4), np.zeros((3, 4)))),
    ("heights of the height", lambda: sim.HeightField(range(4), range(5), np.zeros((4, 4)))),
    ("at least one part", lambda: sim.Together(())),
    ("compliant contacts: stiffness must be > 0", lambda: sim.HuntCrossley(0.0, 0.1)),
    ("compliant contacts: stiffness must be > 0", lambda: sim.HuntCrossley(np.inf, 0.1)),
    ("dissipation must be >= 0", lambda: sim.HuntCrossley(1e6, -0.1)),
    ("noise", lambda: sim.Sensor(noise=-1.0)),
    ("sensor noise: velocity", lambda: sim.SensorNoise(ARM, velocity=-1.0)),
    ("sensor noise: position", lambda: sim.SensorNoise(ARM, position=np.nan)),
    ("torque lag: delay", lambda: sim.TorqueLag(delay=-1e-3)),
    ("torque lag: delay", lambda: sim.TorqueLag(delay=np.inf)),
    ("bandwidth", lambda: sim.TorqueLag(bandwidth=0.0)),
    ("bandwidth", lambda: sim.TorqueLag(bandwidth=np.nan)),
    ("next command", lambda: sim.TorqueLag()(TWO, 0.0)),
    ("period", lambda: sim.ClosedLoop(sim.Plant(ARM, FAR), None, period=0.0)),
    ("off by -1", lambda: sim.with_wrong_efficiencies(ARM, -1.0)),
    ("off by nan", lambda: sim.with_wrong_efficiencies(ARM, np.nan)),
]
ROBOTS: list[tuple[str, Callable[[], object]]] = [
    ("no collision geometry", lambda: sim.Plant(LEG, bodies="all")),
    ("depth-first", mixed_order),
    ("mass and volume must be positive", lambda: boxed(0.0)),
    ("radius must be >= 0", lambda: ContactPoint("foot", "body", np.zeros(3), 0.5, -0.1)),
    ("2 joints", lambda: servo(load_robot("double_pendulum"))),
    ("torque_constant", lambda: servo(load_robot("sts3250_pendulum"))),
    ("same effects", lambda: servo(SHAFT, SHAFT.with_effect(CoulombFriction("shaft", 0.1)))),
]
MISTAKES = [
    *[(SimulationError, *case) for case in SIMULATION],
    *[(RobotError, *case) for case in ROBOTS],
    (EffectError, "no next_memory", forgotten),
]


@pytest.mark.parametrize(("error", "message", "make"), MISTAKES)
def test_a_mistake_is_named(error: type[WbcError], message: str, make: Callable) -> None:
    with pytest.raises(error, match=message):
        make()
