"""The three LossyGear demos of the Modelica Standard Library as robots with one joint."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from tests.outside import outside
from tests.sim.bodies import one_joint
from wbc.effects import CoulombFriction
from wbc.robot import Robot


@dataclass(frozen=True)
class Demo:
    """Inputs and initial speed of one demo; see the README beside the data."""

    robot: Robot
    rotor_torque: Callable[[float], np.ndarray]
    external: Callable[[float], np.ndarray]
    speed: float


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


def demo(number: int) -> Demo:
    """Return demo 1, 2 or 3."""
    if number == 1:
        return Demo(_robot(1.0, 1.5, 2.0, 0.5), _swinging, _ramp, 0.0)
    if number == 2:
        robot = _robot(1.0, 1.5, 2.0, 0.5, coulomb=0.5, viscous=0.5)
        return Demo(robot, _swinging, _ramp, 0.0)
    # tau_bf1 = 0.625, tau_bf2 = 2.5, both on flange a: 0.5 N m on each side.
    robot = _robot(0.001, 0.001, 1.0, 0.25, coulomb=0.5, output=0.5)
    return Demo(robot, lambda t: np.zeros(1), lambda t: np.array([0.0 if t < 0.5 else 1.0]), 10.0)


def reference(number: int) -> np.ndarray:
    """Return rows (time, phi, w, mode) of Dymola's result."""
    with outside(f"lossygear/lossygear_demo{number}.csv").open() as file:
        rows = list(csv.reader(file))
    header = [name.strip().strip('"') for name in rows[0]]
    picked = [
        next(i for i, h in enumerate(header) if h.lower().startswith(name.lower()))
        for name in ("time", "Inertia2.phi", "Inertia2.w", "gear.mode")
    ]
    return np.array([[float(row[i]) for i in picked] for row in rows[1:]])
