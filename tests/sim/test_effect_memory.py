"""Effects with a state of their own: the plant carries it, as independent solutions do."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

from wbc import Robot, load_robot
from wbc.effects import ActuationDelay, JointEffect, ThermalDrift
from wbc.sim import Plane, Plant, SimState, simulate

LEG = load_robot("planar_leg_fixed").lossless()
START = np.array([0.3, -0.6])
RATIO = 20.0


def truth(robot: Robot, rate: Callable, extra: list, marks: list) -> np.ndarray:
    """Integrate q, v and further states; rate(t, v, z) returns joint torques and dz/dt."""
    model = robot.model.copy()
    armature = np.zeros(model.nv)
    armature[robot.actuated] = robot.transmission.reflected_inertia
    model.armature = armature
    data = model.createData()

    def derivative(t: float, y: np.ndarray) -> np.ndarray:
        torque, change = rate(t, y[2:4], y[4:])
        return np.concatenate((y[2:4], pin.aba(model, data, y[:2], y[2:4], torque), change))

    y = np.concatenate((START, np.zeros(2), extra))
    for begin, end in pairwise(marks):
        y = solve_ivp(derivative, (begin, end), y, rtol=1e-10, atol=1e-12).y[:, -1]
    return y


def arrives(robot: Robot, push: Callable, known: np.ndarray, time: float, close: float) -> SimState:
    """Hold where the plant ends against a solution: within `close`, and the nearer the finer."""
    plant, errors = Plant(robot, terrain=Plane(height=-9.0)), []
    for h in (1e-3, 5e-4):
        end = simulate(plant, lambda s: push(s.time), plant.state(START), time, dt=h).state
        reached = np.concatenate((end.position, end.velocity, *map(np.ravel, end.memory)))
        errors.append(np.abs(reached[: known.size] - known).max())
    assert errors[1] < min(close, 0.6 * errors[0])
    return end


@pytest.mark.parametrize("delay", [0.0, 0.0004, 0.0037, 0.012])
def test_a_delayed_command_acts_when_it_arrives(delay: float) -> None:
    steps = np.array([[0.3, -0.4], [0.6, 0.2], [-0.2, 0.3], [0.4, -0.4]])

    def command(t: float) -> np.ndarray:
        return steps[min(int(t / 0.025 + 1e-9), 3)]

    def rate(t: float, v: np.ndarray, z: np.ndarray) -> tuple:
        late = command(t - delay)[1] if t >= delay else 0.0
        return RATIO * np.array([command(t)[0], late]), []

    jumps = {*(0.025 * i for i in range(5)), *(0.025 * i + delay for i in range(4))}
    y = truth(LEG, rate, [], sorted(t for t in jumps if t <= 0.1))
    robot = LEG.with_effect(ActuationDelay("knee", delay))
    end = arrives(robot, command, y, 0.1, 3e-4)
    assert len(end.memory[0]) <= delay / 5e-4 + 2


@dataclass(frozen=True)
class Maxwell(JointEffect):
    """Spring and damper in series, unknown to every part of the library: dz/dt = v - k z / c."""

    stiffness: float
    damping: float
    name: ClassVar[str] = "maxwell"
    parameters: ClassVar = ()
    explanation: ClassVar[str] = "-"
    experiment: ClassVar[str] = "-"

    def first_memory(self, robot):
        return np.zeros(1)

    def stretch(self, robot, motion, share):
        decay = np.exp(-share * motion.memory.step * self.stiffness / self.damping)
        steady = self.joint_velocity(robot, motion) * self.damping / self.stiffness
        return steady + (motion.memory.value - steady) * decay

    def next_memory(self, robot, motion, torque):
        return self.stretch(robot, motion, 1.0)

    def joint_torque(self, robot, motion):
        return self.on_joint(robot, motion, -self.stiffness * self.stretch(robot, motion, 0.5)[0])


def test_any_hook_of_an_effect_nobody_knows_sees_its_own_state() -> None:
    robot = LEG.with_effects(Maxwell("hip", 60.0, 3.0), ThermalDrift("knee", 0.3, 1.2))

    def rate(t: float, v: np.ndarray, z: np.ndarray) -> tuple:
        torque = np.array([-60.0 * z[0], -4.0 * (1.0 - 0.3 * z[1])])
        return torque, [v[0] - 20.0 * z[0], 1.0 - z[1] / 1.2]

    y = truth(robot, rate, [0.0, 0.0], [0.0, 0.4])
    arrives(robot, lambda t: np.array([0.0, -0.2]), y, 0.4, 5e-3)


def test_a_run_taken_up_again_goes_on_to_the_same_bits() -> None:
    robot = LEG.with_effects(ActuationDelay("hip", 0.0035), ThermalDrift("knee", 0.3, 1.2))
    plant = Plant(robot, terrain=Plane(height=-9.0))

    def command(state: SimState) -> np.ndarray:
        return np.array([np.sin(40.0 * state.time), 0.2])

    whole = simulate(plant, command, plant.state(START), 0.1).state
    half = simulate(plant, command, plant.state(START), 0.05).state
    rest = simulate(Plant(robot, terrain=Plane(height=-9.0)), command, half, 0.05).state
    assert np.array_equal(whole.velocity, rest.velocity)
    assert all(np.array_equal(a, b) for a, b in zip(whole.memory, rest.memory, strict=True))
    cold = simulate(plant, command, half.replace(memory=()), 0.05).state
    assert not np.array_equal(whole.velocity, cold.velocity)
