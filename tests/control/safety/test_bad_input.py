"""What cannot work is a status with a name and a safe torque; any kind of number is taken."""

from __future__ import annotations

import coal
import numpy as np
import pytest

from tests.control.scenes import leg_controller
from wbc.control import (
    CapturePointTask,
    CenterOfMassTask,
    CollisionLimit,
    ContactRamp,
    Controller,
    ControllerSettings,
    DisturbanceObserver,
    FramePoseTask,
    FramePositionTask,
    JointLimit,
    MotorBraking,
    PointContact,
    PostureTask,
    RotorTorqueLimit,
    Shape,
    SpeedBlend,
    Status,
    SurfaceContact,
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


def sole(*corners):
    return SurfaceContact(name="left", corners=corners).bind(load_robot("talos"))


POSTURE = PostureTask.of(LEG)
WRONG_SIZE = ControllerSettings(disturbance=DisturbanceObserver(bound=np.ones(3)))
CORNERS = [f"left_sole_{a}_{b}" for a in ("front", "rear") for b in ("left", "right")]
BALL = Shape(name="ball", geometry=coal.Sphere(0.1))
MISTAKES = [
    ("nothing to do", lambda: Controller(LEG, [])),
    ("two tasks", lambda: Controller(LEG, [POSTURE, POSTURE])),
    ("foot", lambda: Controller(LEG, [POSTURE], [PointContact(name="toe")])),
    ("shin", lambda: Controller(LEG, [FramePoseTask(name="pose", frame="shinn")])),
    ("at most one", lambda: Controller(LEG, [POSTURE], limits=[RotorTorqueLimit()] * 2)),
    ("knee", lambda: PostureTask.of(LEG, ("kneee",))),
    ("several degrees", lambda: PostureTask.of(load_robot("solo12"), ("root_joint",))),
    ("another robot", lambda: Controller(load_robot("solo12"), [POSTURE])),
    ("axes", lambda: CenterOfMassTask(axes="xw")),
    ("axes", lambda: FramePositionTask(name="foot", frame="foot", axes="")),
    ("weight", lambda: CenterOfMassTask(weight=-1.0)),
    ("weight", lambda: CenterOfMassTask(weight=np.nan)),
    ("stiffness", lambda: CenterOfMassTask(stiffness=np.inf)),
    ("acceleration_limit must be > 0", lambda: CenterOfMassTask(acceleration_limit=0.0)),
    *[("level", lambda level=level: CenterOfMassTask(level=level)) for level in (-1, 0.5, True)],
    ("height", lambda: CapturePointTask(height=0.0)),
    ("daqp", lambda: Controller(LEG, [POSTURE], settings=ControllerSettings(solver="quadprogg"))),
    ("full_speed", lambda: SpeedBlend(full_speed=0.0)),
    ("rest_margin", lambda: ControllerSettings(rest_margin=0.6)),
    ("time_step", lambda: ControllerSettings(time_step=0.0)),
    ("1 ms is", lambda: ControllerSettings(time_step=1.0)),
    ("time_step", lambda: ControllerSettings(time_step="1 ms")),
    ("normal_min", lambda: PointContact(name="foot", normal_minimum=2.0, normal_maximum=1.0)),
    ("fraction", lambda: RotorTorqueLimit(0.0)),
    ("positive", lambda: JointLimit.of(LEG, acceleration=0.0)),
    ("bal", lambda: CollisionLimit([BALL], [("ball", "bal")])),
    ("margin", lambda: CollisionLimit([BALL], [], margin=0.5)),
    ("one name", lambda: CollisionLimit([BALL, BALL], [])),
    ("no motor to brake it", lambda: JointLimit.of(load_robot("planar_leg"), ["base_pitch"])),
    ("share", lambda: MotorBraking(share=1.5)),
    ("least", lambda: MotorBraking(least=0.0)),
    ("three corners", lambda: sole(*CORNERS[:2])),
    ("several frames", lambda: sole(*CORNERS[:3], "right_sole_rear_right")),
    ("between", lambda: sole(CORNERS[0], CORNERS[0], CORNERS[1], CORNERS[1])),
    ("between", lambda: sole(CORNERS[0], CORNERS[1], CORNERS[0])),
    ("duration", lambda: ContactRamp(["left"], load=10.0, duration=0.0)),
    ("along y", lambda: PointContact(name="foot", ground_normal=(0.0, 0.2, 1.0)).bind(LEG)),
    ("point up", lambda: PointContact(name="foot", ground_normal=(1.0, 0.0, 0.0))),
    ("rate", lambda: DisturbanceObserver(rate=0.0)),
    ("bound", lambda: DisturbanceObserver(bound=-1.0)),
    ("shape", lambda: Controller(LEG, [POSTURE], settings=WRONG_SIZE)),
]


@pytest.mark.parametrize(("word", "made"), MISTAKES)
def test_a_mistake_of_the_setup_is_named(word, made):
    with pytest.raises((ControlError, RobotError), match=word):
        made()


MOVING = np.array([0.0, 0.0, 0.0, 1.0, -2.0])

KINDS = {
    "list": lambda values: values.tolist(),
    "every second": lambda values: np.repeat(values, 2)[::2],
    "column": lambda values: np.column_stack([values, values])[:, 1],
    "read-only": lambda values: np.frombuffer(values.tobytes()),
    "other byte order": lambda values: values.astype(">f8"),
    "long double": lambda values: values.astype(np.longdouble),
    "whole numbers": lambda values: (
        values.astype(int) if (values == values.round()).all() else values
    ),
}


@pytest.mark.parametrize("kind", KINDS)
def test_any_kind_of_vector_is_the_same_state(kind):
    wanted = leg_controller(LEG).step(Motion(STAND, MOVING))
    given = leg_controller(LEG).step(Motion(KINDS[kind](STAND), KINDS[kind](MOVING)))
    assert given.status is Status.SOLVED
    np.testing.assert_array_equal(given.rotor_torque, wanted.rotor_torque)
