"""What cannot work is a status with a name and a safe torque; any kind of number is taken."""

from __future__ import annotations

import numpy as np
import pytest

from tests.control.scenes import leg_controller
from wbc.control import (
    CenterOfMassTask,
    Controller,
    ControllerSettings,
    FramePoseTask,
    FramePositionTask,
    JointLimit,
    PointContact,
    PostureTask,
    RotorTorqueLimit,
    SpeedBlend,
    Status,
)
from wbc.effects import load_robot
from wbc.errors import ControlError, RobotError
from wbc.robot import Motion

LEG = load_robot("planar_leg_strong")
STAND = LEG.configuration(hip=-0.37, knee=0.7, base_z=0.75)
REST = np.zeros(5)


def safe(command):
    assert not command.status.usable
    assert command.message
    assert np.isfinite(command.rotor_torque).all()
    assert np.all(np.abs(command.rotor_torque) <= LEG.transmission.torque_limit)
    return True


def test_speed_that_overflows_the_dynamics():
    with np.errstate(all="ignore"):
        command = leg_controller(LEG).step(Motion(STAND, np.full(5, 1e200)))
    assert safe(command)


def test_late_tick_keeps_its_command():
    controller = leg_controller(LEG, deadline=1e-9)
    command = controller.step(Motion(STAND, REST))
    assert command.status is Status.LATE
    assert command.status.usable
    on_time = leg_controller(LEG).step(Motion(STAND, REST))
    np.testing.assert_allclose(command.rotor_torque, on_time.rotor_torque)


def test_setup_mistakes_are_errors():
    posture = PostureTask.of(LEG)
    with pytest.raises(ControlError, match="nothing to do"):
        Controller(LEG, [])
    with pytest.raises(ControlError, match="two tasks"):
        Controller(LEG, [posture, posture])
    with pytest.raises(RobotError, match="foot"):
        Controller(LEG, [posture], [PointContact(name="toe")])
    with pytest.raises(ControlError, match="shin"):
        Controller(LEG, [FramePoseTask(name="pose", frame="shinn")])
    with pytest.raises(ControlError, match="at most one"):
        Controller(LEG, [posture], limits=[RotorTorqueLimit(), RotorTorqueLimit(0.5)])
    with pytest.raises(RobotError, match="knee"):
        PostureTask.of(LEG, ("kneee",))
    with pytest.raises(ControlError, match="several degrees"):
        PostureTask.of(load_robot("solo12"), ("root_joint",))
    with pytest.raises(ControlError, match="another robot"):
        Controller(load_robot("solo12"), [posture])
    with pytest.raises(ControlError, match="axes"):
        CenterOfMassTask(axes="xw")
    with pytest.raises(ControlError, match="axes"):
        FramePositionTask(name="foot", frame="foot", axes="")
    with pytest.raises(ControlError, match="weight"):
        CenterOfMassTask(weight=-1.0)
    with pytest.raises(ControlError, match="stiffness"):
        CenterOfMassTask(stiffness=np.inf)
    with pytest.raises(ControlError, match="daqp"):
        Controller(LEG, [posture], settings=ControllerSettings(solver="quadprogg"))
    with pytest.raises(ControlError, match="full_speed"):
        SpeedBlend(full_speed=0.0)
    with pytest.raises(ControlError, match="time_step"):
        ControllerSettings(time_step=0.0)
    with pytest.raises(ControlError, match="1 ms is"):
        ControllerSettings(time_step=1.0)
    with pytest.raises(ControlError, match="time_step"):
        ControllerSettings(time_step="1 ms")
    with pytest.raises(ControlError, match="normal_minimum"):
        PointContact(name="foot", normal_minimum=2.0, normal_maximum=1.0)
    with pytest.raises(ControlError, match="fraction"):
        RotorTorqueLimit(0.0)
    with pytest.raises(ControlError, match="positive"):
        JointLimit.of(LEG, acceleration=0.0)


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
