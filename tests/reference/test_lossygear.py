"""The time step against the three LossyGear demos of the Modelica Standard Library."""

import numpy as np
import pinocchio as pin
import pytest
from pyarrow.csv import read_csv

from tests.outside import outside
from tests.sim.bodies import one_joint
from wbc.effects import CoulombFriction
from wbc.robot import Robot
from wbc.sim import Plant


def _robot(rotor: float, link: float, ratio: float, efficiency: float, **friction: float) -> Robot:
    robot = one_joint(
        pin.JointModelRY(),
        pin.Inertia(1.0, np.zeros(3), np.diag([1.0, link, 1.0])),
        gear_ratio=ratio,
        rotor_inertia=rotor,
        forward_efficiency=efficiency,
        backward_efficiency=efficiency,
        rotor_coulomb_friction=friction.get("coulomb", 0.0),
        rotor_viscous_friction=friction.get("viscous", 0.0),
    ).with_gravity(np.zeros(3))
    if "output" in friction:
        robot = robot.with_effect(CoulombFriction("joint", friction["output"]))
    return robot


def _swinging(time: float) -> np.ndarray:
    return np.array([10.0 * np.sin(2.0 * np.pi * time)])


def _ramp(time: float) -> np.ndarray:
    return np.array([-10.0 + 2.5 * time])


def _nothing(_: float) -> np.ndarray:
    return np.zeros(1)


def _late(time: float) -> np.ndarray:
    return np.array([0.0 if time < 0.5 else 1.0])


# Robot, rotor torque, torque on the link, first speed and duration; see the README of the data.
DEMOS = {
    1: (_robot(1.0, 1.5, 2.0, 0.5), _swinging, _ramp, 0.0, 0.5),
    2: (_robot(1.0, 1.5, 2.0, 0.5, coulomb=0.5, viscous=0.5), _swinging, _ramp, 0.0, 0.5),
    # tau_bf1 = 0.625, tau_bf2 = 2.5, both on flange a: 0.5 N m on each side.
    3: (_robot(0.001, 0.001, 1.0, 0.25, coulomb=0.5, output=0.5), _nothing, _late, 10.0, 1.0),
}


def reference(number: int) -> np.ndarray:
    """Return rows (time, phi, w) of Dymola's result."""
    table = read_csv(outside(f"lossygear/lossygear_demo{number}.csv"))
    return np.column_stack([table[name] for name in ("time", "Inertia2.phi", "Inertia2.w")])


def _stepped(number: int, step: float) -> tuple[np.ndarray, ...]:
    robot, torque, external, speed, duration = DEMOS[number]
    plant, rows = Plant(robot), [(0.0, 0.0, speed)]
    state = plant.state([0.0], [speed])
    for i in range(round(duration / step)):
        middle = (i + 0.5) * step
        state = plant.step(state, torque(middle), step, external(middle)).state
        rows.append(((i + 1) * step, float(state.position[0]), float(state.velocity[0])))
    return tuple(np.array(rows).T)


@pytest.mark.parametrize("number", DEMOS)
def test_time_stepping_reaches_dymola(number: int) -> None:
    truth = reference(number)
    time, phi, speed = _stepped(number, 1e-4)
    rows = np.round(truth[:, 0] / 1e-4, 6) % 1.0 == 0.0  # event rows lie between the steps
    assert rows.sum() > 900
    at = np.round(truth[rows, 0] / 1e-4).astype(int)
    assert np.abs(time[at] - truth[rows, 0]).max() < 1e-9
    assert np.abs(speed[at] - truth[rows, 2]).max() <= 2e-5
    assert np.abs(phi[at] - truth[rows, 1]).max() <= 1e-7


@pytest.mark.parametrize("number", [1, 2])
def test_time_stepping_converges(number: int) -> None:
    truth = reference(number)
    grid = np.round(truth[:, 0] / 5e-4, 6) % 1.0 == 0.0
    errors = []
    for step in (5e-4, 1.25e-4):
        _, _, speed = _stepped(number, step)
        at = np.round(truth[grid, 0] / step).astype(int)
        errors.append(np.abs(speed[at] - truth[grid, 2]).max())
    assert errors[1] < 0.3 * errors[0]  # a quarter at first order
