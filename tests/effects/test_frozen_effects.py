"""Ticks and steps of robots with many effects, against what they were (25 and 26 November 2026).

A change of how effects are evaluated must not change what they do. The reference lies in
`data/frozen_effects.npz`; run as a program this file writes it anew, which only a change of the
physics is a reason for.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, final

import numpy as np
import pinocchio as pin
import pytest

from wbc import load_robot
from wbc.arrays import FloatArray
from wbc.control import (
    CenterOfMassTask,
    Controller,
    PointContact,
    PostureTask,
    RotorTorqueLimit,
)
from wbc.effects import JointEffect, effect_class
from wbc.robot import Effect, Motion, Parameter, Robot
from wbc.sim import Plant

DATA = Path(__file__).parent / "data" / "frozen_effects.npz"
EVERY = 5  # of 200 ticks or steps is written down
# Of the largest number. Effects that differ by 1e-14 move the states by 2e-13, the torques of the
# leg's ticks, whose program is nearly degenerate, by 1e-9.
OF_TICKS, OF_STEPS = 1e-7, 1e-9


@final
@dataclass(frozen=True)
class CubicDrag(JointEffect):
    """An effect as a user writes it: -coefficient v^3, and a dry level that falls with position."""

    coefficient: float
    level: float

    name: ClassVar[str] = "cubic_drag"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("coefficient", "N m s^3/rad^3", 0.0, 0.0, 10.0, 0.1),
        Parameter("level", "N m", 0.0, 0.0, 10.0, 0.1),
    )
    explanation: ClassVar[str] = "A drag."
    experiment: ClassVar[str] = "Move fast."

    def joint_torque(self, robot: Robot, motion: Motion) -> FloatArray:
        speed = self.joint_velocity(robot, motion)
        return self.on_joint(robot, motion, -self.coefficient * speed**3)

    def joint_friction(self, robot: Robot, motion: Motion) -> FloatArray:
        place = self.joint_position(robot, motion)
        return self.on_joint(robot, motion, self.level / (1.0 + place**2))


LAWS: dict[str, tuple[float, ...]] = {
    "viscous_friction": (0.04,),
    "directional_viscous_friction": (0.05, 0.02),
    "coulomb_friction": (0.08,),
    "stribeck_friction": (0.06, 0.2),
    "quadratic_drag": (0.01,),
    "joint_spring": (0.5, 0.2),
    "torque_ripple": (0.05, 7.0, 0.3),
    "torque_constant": (1.07,),
    "torque_offset": (-0.03,),
    "current_limit": (1.9,),
}
OTHERS: dict[str, tuple[float, ...]] = {
    "presliding": (0.05, 0.02),
    "thermal_viscous_friction": (0.03, 0.02),
    "load_stribeck_friction": (0.1, 0.3),
    "thermal_drift": (0.01, 20.0),
    "actuation_delay": (0.0031,),
    "voltage_scaling": (0.5, 20.0),
    "supply_sag": (0.001,),
}
MIXES = {"laws": LAWS, "laws and others": {**LAWS, **OTHERS}}
CASES = [(name, mix) for name in ("planar_leg", "solo12") for mix in MIXES]


def lossy(name: str, mix: str) -> Robot:
    """Return a robot with each effect at most of its joints, in numbers that differ by place."""
    robot = load_robot(name)
    joints = robot.transmission.joints
    added: list[Effect] = []
    for k, (kind, numbers) in enumerate(MIXES[mix].items()):
        cls = effect_class(kind)
        names = [parameter.name for parameter in cls.parameters]
        places = joints if cls.places(robot) != ("robot",) else ("robot",)
        for i, where in enumerate(places):
            if (i + k) % 4 != 3:
                size = 1.0 + 0.05 * i
                values = [size * numbers[0], *numbers[1:]]
                added.append(cls.at(where, dict(zip(names, values, strict=True))))
    added += [CubicDrag(where, 0.01, 0.02 * (i + 1)) for i, where in enumerate(joints)]
    return robot.with_effects(*added)


def ticks(name: str, mix: str) -> FloatArray:
    """Return the drive torques of a controller near its usual pose, (40, m)."""
    robot = lossy(name, mix)
    contacts = [PointContact(name=contact.name) for contact in robot.contacts]
    tasks = [CenterOfMassTask(weight=10.0, acceleration_limit=np.inf)]
    tasks.append(PostureTask.of(robot, weight=0.1))
    controller = Controller(robot, tasks, contacts, limits=[RotorTorqueLimit()])
    random = np.random.default_rng(11)
    rows = []
    for k in range(200):
        moved, velocity = random.normal(size=(2, robot.model.nv))
        position = pin.integrate(robot.model, robot.pose(), 0.02 * moved)
        result = controller.step(Motion(position, 0.2 * velocity))
        if k % EVERY == 0:
            rows.append(np.asarray(result.rotor_torque))
    return np.array(rows)


def steps(name: str, mix: str) -> FloatArray:
    """Return q and v of a plant that falls and is driven by waves, (40, nq + nv)."""
    robot = lossy(name, mix)
    plant = Plant(robot)
    state = plant.state(robot.pose(), lifted=True)
    gears = robot.transmission
    size = 0.3 * np.minimum(gears.torque_limit, 2.0)
    rows = []
    for k in range(200):
        torque = size * np.sin(0.02 * k + np.arange(gears.size))
        state = plant.step(state, torque, 1e-3).state
        if k % EVERY == 0:
            rows.append(np.concatenate((state.position, state.velocity)))
    return np.array(rows)


@pytest.mark.parametrize(("name", "mix"), CASES)
def test_ticks_with_effects_are_as_they_were(name: str, mix: str) -> None:
    """The torques of 200 ticks, of robots with effects of 11 and of 18 kinds."""
    with np.load(DATA, allow_pickle=False) as kept:
        before = kept[f"ticks of {name} with {mix}"]
    now = ticks(name, mix)
    np.testing.assert_allclose(now, before, rtol=0.0, atol=OF_TICKS * np.abs(before).max())


@pytest.mark.parametrize(("name", "mix"), CASES)
def test_steps_with_effects_are_as_they_were(name: str, mix: str) -> None:
    """The states of 200 steps, of robots with effects of 11 and of 18 kinds."""
    with np.load(DATA, allow_pickle=False) as kept:
        before = kept[f"steps of {name} with {mix}"]
    now = steps(name, mix)
    np.testing.assert_allclose(now, before, rtol=0.0, atol=OF_STEPS * np.abs(before).max())


def _write() -> None:
    found = {f"ticks of {name} with {mix}": ticks(name, mix) for name, mix in CASES}
    found |= {f"steps of {name} with {mix}": steps(name, mix) for name, mix in CASES}
    np.savez_compressed(DATA, allow_pickle=False, **found)


if __name__ == "__main__":
    _write()
