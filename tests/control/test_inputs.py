"""`step` never raises and never takes nonsense: every bad input is a status that names it."""

import copy
import pickle

import coal
import numpy as np
import pinocchio as pin
import pytest

from tests.control.scenes import center_of_mass, leg_controller, points, still
from wbc.control import (
    CapturePointTask,
    CenterOfMassTask,
    CollisionLimit,
    ContactRamp,
    Controller,
    ControllerSettings,
    DisturbanceObserver,
    FrameOrientationTask,
    FramePoseTask,
    FramePositionTask,
    JointLimit,
    PointContact,
    PostureTask,
    Reference,
    RotorTorqueEffort,
    RotorTorqueLimit,
    Shape,
    SpeedBlend,
    Status,
    SurfaceContact,
    Task,
)
from wbc.effects import load_robot
from wbc.errors import ControlError, RobotError
from wbc.robot import Motion

SOLO, LEG = load_robot("solo12"), load_robot("planar_leg_strong")
STAND, STATE, REST = SOLO.pose(), still(SOLO), np.zeros(SOLO.model.nv)
FEET = [contact.name for contact in SOLO.contacts]


def controller():
    tasks = [
        CenterOfMassTask(weight=10.0),
        FrameOrientationTask(name="trunk", frame="base_link"),
        FramePoseTask(name="pose", frame="base_link", weight=0.1),
        PostureTask.of(SOLO, weight=0.1),
        RotorTorqueEffort(weight=1e-4),
    ]
    return Controller(SOLO, tasks, points(SOLO))


def turned(norm):
    q = STAND.copy()
    q[3:7] *= norm
    return Motion(q, REST)


COM, NAN, NONE = center_of_mass(SOLO, STAND), np.array([0.0, np.nan, 0.0]), np.array([None] * 3)
WORDS = [str(x) for x in STAND]
FOOT, TRUNK = FEET[0], np.full((3, 3), None)
# words of which the message holds one, and arguments of step
STATES = [
    *[("position", state) for state in (None, 3.0)],
    ("shape (19,)", Motion(STAND[:4], REST)),
    *[("numbers", Motion(words, REST)) for words in ("standing", WORDS)],
    ("number", Motion(np.array(WORDS, dtype=object), REST)),
    ("number", Motion(None, None)),
    ("number", Motion(STAND, [10**400] * len(REST))),
    ("complex", Motion(STAND + 1e-3j, REST)),
    ("bool", Motion(STAND, REST.astype(bool))),
    ("masked", Motion(np.ma.masked_array(STAND, STAND > 0.5), REST)),
    *[("quaternion", turned(norm)) for norm in (0.0, 1.1)],
]
REFERENCES = [
    ("center_of_mass", {"center_of_mas": Reference()}),
    ("references", [Reference()]),
    *[("Reference", {"center_of_mass": wish}) for wish in (COM, None)],
    ("acceleration", {"posture": Reference(None, None, REST)}),
    ("SE3", {"pose": Reference(np.eye(4))}),
    ("rotation", {"pose": Reference(pin.SE3(2.0 * np.eye(3), np.zeros(3)))}),
    *[("shape", {"center_of_mass": Reference(wish)}) for wish in (0.3, COM[None])],
    ("numbers|array", {"center_of_mass": Reference("high")}),
    *[("complex", {"center_of_mass": Reference(*w)}) for w in ((COM + 1j,), (COM, COM + 1j))],
    ("number", {"center_of_mass": Reference(NONE)}),
    *[("velocity", {"center_of_mass": Reference(COM, speed)}) for speed in (1.0, NONE)],
    *[
        ("not finite", {"center_of_mass": Reference(*wish)})
        for wish in ((NAN,), (COM, None, NAN), (COM, NAN + np.inf))
    ],
    *[
        ("rotation", {"trunk": Reference(wish)})
        for wish in (REST[:3], 2.0 * np.eye(3), np.diag([1.0, 1.0, -1.0]), np.zeros((3, 3)), TRUNK)
    ],
    ("not finite", {"trunk": Reference(np.full((3, 3), np.nan))}),
]
BAD = [
    *[(word, {"state": state}) for word, state in STATES],
    *[(word, {"references": wish}) for word, wish in REFERENCES],
    *[("map", {"contacts": given}) for given in (FEET, set(FEET), FOOT)],
    *[(FOOT, {"contacts": {FOOT: most}}) for most in (None, True, "on", -1.0, 10**400)],
    (FOOT, {"contacts": {"feet": 1.0}}),
    ("contact", {"contacts": {0: 1.0}}),
    *[("dt", {"dt": dt}) for dt in (0.0, np.nan, np.inf, "1 ms", 10**400, 1.7e308, 1.0, 0.5)],
    ("weights", {"weights": [1.0]}),
    *[("posture", {"weights": {"posture": weight}}) for weight in (10**400, -1.0, np.inf)],
    *[("posture", {"activation": {"posture": share}}) for share in (2.0, None)],
    ("posture", {"activation": {"postur": 1.0}}),
]


def refused(command, word):
    assert not command.status.usable
    assert any(part in command.message for part in word.split("|")), command.message
    assert np.isfinite(command.rotor_torque).all()
    assert np.all(np.abs(command.rotor_torque) <= SOLO.transmission.torque_limit)


@pytest.fixture(scope="module")
def used():
    ours = controller()
    assert ours.step(STATE).status is Status.SOLVED
    return ours


@pytest.mark.parametrize(("word", "arguments"), BAD)
def test_a_bad_input_is_named_and_forgotten(used, word, arguments):
    before, command = used.step(STATE).rotor_torque, used.step(**({"state": STATE} | arguments))
    refused(command, word)
    assert command.status in (Status.BAD_INPUT, Status.NOT_FINITE)
    after = used.step(STATE)
    assert after.status is Status.SOLVED
    np.testing.assert_allclose(after.rotor_torque, before, atol=1e-6)


def test_speed_that_overflows_the_dynamics():
    with np.errstate(all="ignore"):
        refused(controller().step(Motion(STAND, np.full(18, 1e200))), "")


def test_late_tick_keeps_its_command():
    at = Motion(AT, np.zeros(5))
    late, on_time = (leg_controller(LEG, deadline=limit).step(at) for limit in (1e-9, None))
    assert late.status is Status.LATE
    assert late.status.usable
    np.testing.assert_allclose(late.rotor_torque, on_time.rotor_torque)


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
    ("joint of 'solo12'", lambda: Controller(load_robot("solo12"), [POSTURE])),
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
    ("braking", lambda: JointLimit.of(SOLO, braking=1.5)),
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


AT = LEG.configuration(hip=-0.37, knee=0.7, base_z=0.75)
MOVING = np.array([0.0, 0.0, 0.0, 1.0, -2.0])
KINDS = {
    "list": lambda values: values.tolist(),
    "every second": lambda values: np.repeat(values, 2)[::2],
    "column": lambda values: np.column_stack([values, values])[:, 1],
    "read-only": lambda values: np.frombuffer(values.tobytes()),
    "other byte order": lambda values: values.astype(">f8"),
    "long double": lambda values: values.astype(np.longdouble),
    "whole numbers": lambda values: values.astype(int) if values is MOVING else values,
}


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
def test_any_kind_of_vector_is_the_same_state(kind):
    states = Motion(AT, MOVING), Motion(kind(AT), kind(MOVING))
    wanted, given = (leg_controller(LEG).step(state) for state in states)
    assert given.status is Status.SOLVED
    np.testing.assert_array_equal(given.rotor_torque, wanted.rotor_torque)


def test_an_exception_of_a_task_is_a_status():
    class Broken(Task):
        def check(self, robot):
            return 1

        def value(self, kinematics):
            raise RuntimeError("no value today")

        error = jacobian = drift = value

    command = Controller(SOLO, [Broken(name="broken")], points(SOLO)).step(STATE)
    refused(command, "no value today")
    assert command.status is Status.FAILED


def test_an_exception_does_not_hide_the_state_from_the_safe_command():
    """Whatever raises, joints that turn are braked as after any other bad tick."""

    class Breaks(PostureTask):
        def admitted(self, target, size):
            if target is not None and np.max(np.abs(target)) > 100.0:
                raise RuntimeError("no target today")
            return super().admitted(target, size)

    turning, torques = Motion(STAND, np.r_[np.zeros(6), np.full(12, 0.5)]), []
    for wish in (np.full(12, 200.0), np.full(12, np.nan)):
        ours = Controller(SOLO, [Breaks.of(SOLO)], points(SOLO))
        ours.step(STATE)
        for _ in range(30):  # beyond the ticks that are ridden through
            command = ours.step(turning, {"posture": Reference(wish)})
        assert not command.status.usable
        torques.append(command.rotor_torque)
    np.testing.assert_allclose(torques[0], torques[1], rtol=1e-9)


@pytest.mark.parametrize("copied", [pickle.dumps, copy.deepcopy, copy.copy])
def test_a_copy_is_refused_in_words(used, copied):
    with pytest.raises(TypeError, match="make another one"):
        copied(used)


def test_feed_forward_left_out_ends():
    """A moving target without its reference stays where it was, at rest."""
    found = []
    for more in ((), (np.full(3, 0.2), np.full(3, 1.0))):
        ours = controller()
        ours.step(STATE, {"center_of_mass": Reference(COM, *more)})
        found.append(ours.step(STATE).acceleration)
    np.testing.assert_allclose(*found, atol=1e-6)


def test_buffers_of_the_caller_are_not_kept():
    ours, other = controller(), controller()
    buffer, turn, q, v = COM.copy(), np.eye(3), STAND.copy(), REST.copy()
    wish = {"center_of_mass": Reference(buffer), "trunk": Reference(turn)}
    first = ours.step(Motion(q, v), wish)
    kept = first.rotor_torque.copy()
    other.step(STATE, {"center_of_mass": Reference(COM), "trunk": Reference(np.eye(3))})
    buffer[:], turn[:], q[:], v[:] = 7.0, 0.0, 0.3, 9.0
    np.testing.assert_array_equal(first.rotor_torque, kept)
    found, known = (one.step(STATE).acceleration for one in (ours, other))
    np.testing.assert_allclose(found, known, atol=1e-6)
    ours.step(Motion(np.full_like(q, np.nan), v))
    np.testing.assert_allclose(ours.step(None).rotor_torque, ours.step(None).rotor_torque)
