"""Torques of ticks of many kinds, frozen: the next version of the controller gives the same.

Written by `python -m tests.control.test_frozen_ticks`, from the code of 25 November 2026.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from tests.control.scenes import CERTAIN, points
from wbc import control
from wbc.effects import EFFECTS, load_robot
from wbc.robot import Motion

FILE = Path(__file__).parent / "data" / "frozen_ticks.npz"
TICKS = 12
CLOSE = 1e-6
"""Of the largest torque limit: the tolerance of the solvers is 1e-7 of a variable."""


def every(robot, effect, value):
    """Return the robot with an effect at all driven joints; the value is of its first number."""
    kind = EFFECTS[effect]
    values = {kind.parameters[0].name: value}
    return robot.with_effects(*[kind.at(joint, values) for joint in robot.transmission.joints])


def base(robot, *more):
    # without the limit that this task has had since then
    com = control.CenterOfMassTask(weight=10.0, acceleration_limit=np.inf)
    return [com, control.PostureTask.of(robot, weight=0.1), *more]


def soles(robot):
    """Return the contacts of a biped: the corners of either frame as one surface."""
    frames = sorted({contact.frame for contact in robot.contacts})
    return [
        control.SurfaceContact(
            name=f,
            corners=tuple([c.name for c in robot.contacts if c.frame == f]),
            normal_minimum=5.0,
        )
        for f in frames
    ]


def leg(robot):
    return [
        control.PointFootBalanceTask(contact="foot", frame="base", weight=10.0),
        control.CenterOfMassTask(axes="z", weight=10.0, acceleration_limit=np.inf),
    ]


def scenes():
    """Return name -> (robot's name, what makes the controller of it, noise, arguments of step)."""
    solo = "solo12"
    torque, knee = control.RotorTorqueLimit(), control.RotorTorqueLimit(fraction=0.8, knee=0.2)
    observer = control.ControllerSettings(
        disturbance=control.DisturbanceObserver(rate=20.0, bound=3.0)
    )

    def limits(robot, **more):
        return [torque, control.JointLimit.of(robot, acceleration=100.0, **more)]

    def quadruped(*more, name=solo, noise=1e-2, limit=None, settings=None, rubs=(), step=None):
        def make(robot):
            for effect, value in rubs:
                robot = every(robot, effect, value)
            tasks = base(robot, *[task(robot) for task in more])
            limited = [torque] if limit is None else limit(robot)
            return control.Controller(robot, tasks, points(robot), limited, settings)

        return name, make, noise, step or {}

    dry, wet = ("coulomb_friction", 0.1), ("viscous_friction", 0.05)
    frame = lambda robot, k: robot.contacts[k].frame  # noqa: E731
    found = {
        "standing": quadruped(),
        "noisy": quadruped(noise=0.3),
        "joint limits": quadruped(limit=limits),
        "braking": quadruped(noise=0.2, limit=lambda r: limits(r, braking=control.MotorBraking())),
        "knee": quadruped(limit=lambda r: [knee], noise=0.3),
        "no limits": quadruped(limit=lambda r: []),
        "dry": quadruped(rubs=[dry]),
        "dry and wet": quadruped(rubs=[dry, wet]),
        "torque constants": quadruped(rubs=[("torque_constant", 1.02)]),
        "observer": quadruped(settings=observer),
        "limits, dry, observer": quadruped(rubs=[dry], limit=limits, settings=observer),
        "momentum": quadruped(
            lambda r: control.LinearMomentumTask(),
            lambda r: control.AngularMomentumTask(weight=0.3),
        ),
        "whole momentum": quadruped(lambda r: control.CentroidalMomentumTask(weight=0.5)),
        "capture point": quadruped(lambda r: control.CapturePointTask(height=0.25)),
        "distance": quadruped(
            lambda r: control.FrameDistanceTask(frame=frame(r, 0), other=frame(r, 1), weight=0.5)
        ),
        "rotor effort": quadruped(lambda r: control.RotorTorqueEffort(weight=1e-2)),
        "efforts": quadruped(
            lambda r: control.OutputTorqueEffort(weight=1e-3),
            lambda r: control.MeshLossEffort(weight=1e-2),
        ),
        "level": quadruped(lambda r: control.PostureTask.of(r, weight=0.1, level=1, name="p1")),
        "levels, limits, efforts": quadruped(
            lambda r: control.FramePositionTask(name="swing", frame=frame(r, 0), level=1),
            lambda r: control.PostureTask.of(r, level=2, name="p2"),
            lambda r: control.OutputTorqueEffort(weight=1e-3),
            limit=limits,
            noise=0.1,
        ),
        "three feet": quadruped(
            lambda r: control.FramePositionTask(name="swing", frame=frame(r, 0), weight=5.0),
            step={"contacts": dict.fromkeys(["FR_foot", "HL_foot", "HR_foot"], np.inf)},
        ),
        "ceilings": quadruped(
            step={"contacts": {"FL_foot": 3.0, "FR_foot": 9.0, "HL_foot": 9.0, "HR_foot": np.inf}}
        ),
        "flight": quadruped(step={"contacts": {}}),
        "weights": quadruped(step={"weights": {"posture": 2.0}, "activation": {"posture": 0.5}}),
        "least torque": quadruped(
            settings=control.ControllerSettings(rest_policy=control.RestPolicy.LEAST_TORQUE)
        ),
        "certain": quadruped(settings=control.ControllerSettings(speed_blend=CERTAIN), noise=0.1),
        "leg": ("planar_leg", lambda r: control.Controller(r, leg(r), points(r)), 1e-2, {}),
        "leg, dry, limits": (
            "planar_leg",
            lambda r: control.Controller(every(r, "coulomb_friction", 0.1), leg(r), points(r)),
            1e-2,
            {},
        ),
    }
    talos = [
        lambda r: control.FrameOrientationTask(name="trunk", frame="torso_2_link"),
        lambda r: control.AngularMomentumTask(weight=1e-2),
    ]

    def biped(robot, limit=None, settings=None, points_too=False):
        tasks = base(robot, *[task(robot) for task in talos])
        contacts = points(robot) if points_too else soles(robot)
        return control.Controller(robot, tasks, contacts, limit or [torque], settings)

    found["talos"] = "talos", biped, 1e-2, {}
    found["talos, limits"] = "talos", lambda r: biped(r, limits(r)), 1e-2, {}
    found["talos on points"] = "talos", lambda r: biped(r, points_too=True), 3e-3, {}
    found["talos, dry"] = (
        "talos",
        lambda r: biped(every(r, "coulomb_friction", 0.5), limits(r), observer),
        1e-2,
        {},
    )
    return found


SCENES = scenes()


def ran(scene):
    """Return rotor torques over their limits, accelerations and how many ticks were solved."""
    name, make, noise, arguments = SCENES[scene]
    robot = load_robot(name)
    controller, q = make(robot), robot.pose()
    generator, nv = np.random.default_rng(7), robot.model.nv
    torques, accelerations = [], []
    for tick in range(TICKS):
        near = pin.integrate(robot.model, q, 0.2 * noise * generator.normal(size=nv))
        state = Motion(near, noise * generator.normal(size=nv))
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
