"""States and settings come in many kinds of numbers; compiled loops take one."""

from __future__ import annotations

import numpy as np
import pytest

from tests.control.scenes import leg_controller
from wbc.control import (
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
