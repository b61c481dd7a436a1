"""Torques of ticks of many kinds, frozen: the next version of the controller gives the same.

Written by `python -m tests.control.test_frozen_ticks`, from the code of 25 November 2026.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sims.legged import feet
from tests.control.scenes import CERTAIN, moving, points, trunk
from wbc import control
from wbc.effects import EFFECTS, load_robot

FILE = Path(__file__).parent / "data" / "frozen_ticks.npz"
TICKS = 12
CLOSE = 1e-6
"""Of the largest torque limit: the tolerance of the solvers is 1e-7 of a variable."""


def every(robot, effect, value):
    """Return the robot with an effect at all driven joints; the value is of its first number."""
    kind = EFFECTS[effect]
    values = {kind.parameters[0].name: value}
    return robot.with_effects(*[kind.at(joint, values) for joint in robot.transmission.joints])


def base(robot):
    # without the limit that this task has had since then
    com = control.CenterOfMassTask(weight=10.0, acceleration_limit=np.inf)
    return [com, control.PostureTask.of(robot, weight=0.1)]


def soles(robot):
    """Return the soles of a biped, pressed on the ground."""
    return [replace(sole, normal_minimum=5.0) for sole in feet(robot)]


def balance(robot):
    return [
        control.PointFootBalanceTask(contact="foot", frame="base", weight=10.0),
        control.CenterOfMassTask(axes="z", weight=10.0, acceleration_limit=np.inf),
    ]


def upright(robot):
    return [*base(robot), trunk(robot), control.AngularMomentumTask(weight=1e-2)]


TORQUE = control.RotorTorqueLimit()
OBSERVER = control.ControllerSettings(disturbance=control.DisturbanceObserver(rate=20.0, bound=3.0))
LEAST = control.ControllerSettings(rest_policy=control.RestPolicy.LEAST_TORQUE)
DRY, WET = ("coulomb_friction", 0.1), ("viscous_friction", 0.05)
OTHERS = ["FR_foot", "HL_foot", "HR_foot"]


def limited(robot, **more):
    return [TORQUE, control.JointLimit.of(robot, acceleration=100.0, **more)]


def scene(
    *more,
    name="solo12",
    tasks=base,
    on=points,
    limits=lambda r: [TORQUE],
    rubs=(),
    noise=1e-2,
    settings=None,
    **arguments,
):
    """Return a robot's name, what makes the controller of it, noise, and arguments of step."""

    def make(robot):
        for effect, value in rubs:
            robot = every(robot, effect, value)
        asked = [*tasks(robot), *[task(robot) for task in more]]
        return control.Controller(robot, asked, on(robot), limits(robot), settings)

    return name, make, noise, arguments


SCENES = {
    "noisy": scene(noise=0.3),
    "joint limits": scene(limits=limited),
    "braking": scene(noise=0.2, limits=lambda r: limited(r, braking=0.8)),
    "knee": scene(limits=lambda r: [control.RotorTorqueLimit(fraction=0.8, knee=0.2)], noise=0.3),
    "dry and wet": scene(rubs=[DRY, WET]),
    "torque constants": scene(rubs=[("torque_constant", 1.02)]),
    "limits, dry, observer": scene(rubs=[DRY], limits=limited, settings=OBSERVER),
    "efforts": scene(
        lambda r: control.OutputTorqueEffort(weight=1e-3),
        lambda r: control.MeshLossEffort(weight=1e-2),
    ),
    "levels, limits, efforts": scene(
        lambda r: control.FramePositionTask(name="swing", frame=r.contacts[0].frame, level=1),
        lambda r: control.PostureTask.of(r, level=2, name="p2"),
        lambda r: control.OutputTorqueEffort(weight=1e-3),
        limits=limited,
        noise=0.1,
    ),
    "three feet": scene(
        lambda r: control.FramePositionTask(name="swing", frame=r.contacts[0].frame, weight=5.0),
        contacts=dict.fromkeys(OTHERS, np.inf),
    ),
    "ceilings": scene(contacts={"FL_foot": 3.0, "FR_foot": 9.0, "HL_foot": 9.0, "HR_foot": np.inf}),
    "flight": scene(contacts={}),
    "weights": scene(weights={"posture": 2.0}, activation={"posture": 0.5}),
    "least torque": scene(settings=LEAST),
    "certain": scene(settings=control.ControllerSettings(speed_blend=CERTAIN), noise=0.1),
    "leg, dry, limits": scene(name="planar_leg", tasks=balance, limits=lambda r: None, rubs=[DRY]),
    "talos, limits": scene(name="talos", tasks=upright, on=soles, limits=limited),
    "talos on points": scene(name="talos", tasks=upright, noise=3e-3),
    "talos, dry": scene(
        name="talos",
        tasks=upright,
        on=soles,
        limits=limited,
        rubs=[("coulomb_friction", 0.5)],
        settings=OBSERVER,
    ),
}


def ran(scene):
    """Return rotor torques over their limits, accelerations and how many ticks were solved."""
    name, make, noise, arguments = SCENES[scene]
    robot, torques, accelerations = load_robot(name), [], []
    controller = make(robot)
    for tick, state in enumerate(moving(robot, 7, TICKS, 0.2 * noise, noise)):
        command = controller.step(state, **arguments)
        assert command.status.usable, f"{scene}, tick {tick}: {command.status}, {command.message}"
        torques.append(command.rotor_torque)
        accelerations.append(command.acceleration)
    return np.array(torques), np.array(accelerations)


@pytest.mark.parametrize("scene", SCENES)
def test_ticks_give_what_they_gave(scene):
    torque, acceleration = ran(scene)
    with np.load(FILE) as kept:
        expected, moved = kept[f"{scene}: torque"], kept[f"{scene}: acceleration"]
    np.testing.assert_allclose(torque, expected, rtol=0.0, atol=CLOSE * np.abs(expected).max())
    np.testing.assert_allclose(acceleration, moved, rtol=0.0, atol=1e-5 * np.abs(moved).max())


if __name__ == "__main__":
    columns = {}
    for scene in SCENES:
        torque, acceleration = ran(scene)
        columns |= {f"{scene}: torque": torque, f"{scene}: acceleration": acceleration}
    np.savez_compressed(FILE, **columns)
