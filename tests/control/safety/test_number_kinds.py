"""States and settings come in many kinds of numbers; compiled loops take one."""

from __future__ import annotations

import numpy as np
import pytest

from sims.leg import balanced_pose
from tests.control.scenes import leg_controller
from wbc.control import (
    CenterOfMassTask,
    Controller,
    ControllerSettings,
    PointContact,
    PointFootBalanceTask,
    PostureTask,
    Reference,
    RotorTorqueLimit,
    SpeedBlend,
    Status,
)
from wbc.effects import load_robot
from wbc.robot import Motion

LEG = load_robot("planar_leg_strong")
STAND = LEG.configuration(hip=-0.37, knee=0.7, base_z=0.75)
MOVING = np.array([0.0, 0.0, 0.0, 1.0, -2.0])

KINDS = {
    "list": lambda values: values.tolist(),
    "every second": lambda values: np.repeat(values, 2)[::2],
    "column": lambda values: np.column_stack([values, values])[:, 1],
    "read-only": lambda values: np.frombuffer(values.tobytes()),
    "other byte order": lambda values: values.astype(">f8"),
    "long double": lambda values: values.astype(np.longdouble),
}


@pytest.mark.parametrize("kind", KINDS)
def test_any_kind_of_vector_is_the_same_state(kind):
    wanted = leg_controller(LEG).step(Motion(STAND, MOVING))
    given = leg_controller(LEG).step(Motion(KINDS[kind](STAND), KINDS[kind](MOVING)))
    assert given.status is Status.SOLVED
    np.testing.assert_array_equal(given.rotor_torque, wanted.rotor_torque)


def test_whole_numbers_are_speeds_too():
    wanted = leg_controller(LEG).step(Motion(STAND, MOVING))
    given = leg_controller(LEG).step(Motion(STAND, MOVING.astype(int)))
    np.testing.assert_array_equal(given.rotor_torque, wanted.rotor_torque)


def test_settings_may_be_whole_numbers():
    pose = balanced_pose(LEG)

    def torque(number):
        balance = PointFootBalanceTask(
            contact="foot", frame="base", weight=number(100), bandwidth=number(3)
        )
        height = CenterOfMassTask(axes="z", weight=number(100), stiffness=number(400))
        controller = Controller(
            LEG,
            [height, balance, PostureTask.of(LEG, weight=1e-3)],
            [PointContact(name="foot", damping=number(10))],
            limits=[RotorTorqueLimit(fraction=number(1))],
            settings=ControllerSettings(
                speed_blend=SpeedBlend(
                    full_speed=number(1), correction=number(30), trusted_error=number(1)
                )
            ),
        )
        command = controller.step(Motion(pose, 0.1 * MOVING), {"balance": Reference(number(0))})
        assert command.status is Status.SOLVED
        return command.rotor_torque

    np.testing.assert_array_equal(torque(int), torque(float))
