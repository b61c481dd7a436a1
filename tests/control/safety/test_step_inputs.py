"""`step` never raises and never takes nonsense: every bad input is a status that names it."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pinocchio as pin
import pytest

from wbc.control import (
    CenterOfMassTask,
    ContactForceTask,
    Controller,
    FrameOrientationTask,
    FramePoseTask,
    PointContact,
    PostureTask,
    Reference,
    RotorTorqueEffort,
    Status,
    Task,
)
from wbc.effects import load_robot
from wbc.robot import Motion

SOLO = load_robot("solo12")
STAND = next(iter(SOLO.poses.values()))
REST = np.zeros(SOLO.model.nv)
STATE = Motion(STAND, REST)
FEET = [contact.name for contact in SOLO.contacts]


def controller():
    tasks = [
        CenterOfMassTask(weight=10.0),
        FrameOrientationTask(name="trunk", frame="base_link"),
        FramePoseTask(name="pose", frame="base_link", weight=0.1),
        PostureTask.of(SOLO, weight=0.1),
        ContactForceTask(name="load", contact=FEET[0]),
        RotorTorqueEffort(weight=1e-4),
    ]
    return Controller(SOLO, tasks, [PointContact(name=name) for name in FEET])


def turned(norm):
    q = STAND.copy()
    q[3:7] *= norm
    return Motion(q, REST)


def words(values):
    return np.array([str(x) for x in values], dtype=object)


COM = pin.centerOfMass(SOLO.model, SOLO.model.createData(), STAND)
DOUBLE = pin.SE3(2.0 * np.eye(3), np.zeros(3))
NAN = np.array([0.0, np.nan, 0.0])
# name -> arguments of step, and a word that the message holds
BAD = {
    "contacts as list": ((STATE, None, FEET), "map"),
    "contacts as set": ((STATE, None, set(FEET)), "map"),
    "contacts as str": ((STATE, None, FEET[0]), "map"),
    "contact without number": ((STATE, None, {FEET[0]: None}), FEET[0]),
    "contact as truth": ((STATE, None, {FEET[0]: True}), FEET[0]),
    "contact as words": ((STATE, None, {FEET[0]: "on"}), FEET[0]),
    "contact by number": ((STATE, None, {0: 1.0}), "contact"),
    "contact of another name": ((STATE, None, {"feet": 1.0}), FEET[0]),
    "contact below zero": ((STATE, None, {FEET[0]: -1.0}), FEET[0]),
    "state None": ((None,), "position"),
    "state of another size": ((Motion(STAND[:4], REST),), "shape (19,)"),
    "state a number": ((3.0,), "position"),
    "state of words": ((Motion("standing", REST),), "numbers"),
    "state of None": ((Motion(None, None),), "number"),
    "state of number words": ((Motion([str(x) for x in STAND], REST),), "numbers"),
    "state of number words in objects": ((Motion(words(STAND), REST),), "number"),
    "complex state": ((Motion(STAND + 1e-3j, REST),), "complex"),
    "state of truth values": ((Motion(STAND, REST.astype(bool)),), "bool"),
    "masked state": ((Motion(np.ma.masked_array(STAND, STAND > 0.5), REST),), "masked"),
    "state of integers too large": ((Motion(STAND, [10**400] * len(REST)),), "number"),
    "quaternion 0": ((turned(0.0),), "quaternion"),
    "quaternion 1.1": ((turned(1.1),), "quaternion"),
    "reference of another name": ((STATE, {"center_of_mas": Reference()}), "center_of_mass"),
    "references as list": ((STATE, [Reference()]), "references"),
    "reference as array": ((STATE, {"center_of_mass": COM}), "Reference"),
    "reference None": ((STATE, {"center_of_mass": None}), "Reference"),
    "scalar for a vector": ((STATE, {"center_of_mass": Reference(0.3)}), "shape"),
    "words for a vector": ((STATE, {"center_of_mass": Reference("high")}), "numbers|array"),
    "row for a vector": ((STATE, {"center_of_mass": Reference(COM[None])}), "shape"),
    "scalar velocity": ((STATE, {"center_of_mass": Reference(COM, 1.0)}), "velocity"),
    "long acceleration": ((STATE, {"posture": Reference(None, None, REST)}), "acceleration"),
    "rpy for an orientation": ((STATE, {"trunk": Reference(np.zeros(3))}), "rotation"),
    "twice a rotation": ((STATE, {"trunk": Reference(2.0 * np.eye(3))}), "rotation"),
    "reflection": ((STATE, {"trunk": Reference(np.diag([1.0, 1.0, -1.0]))}), "rotation"),
    "zeros as rotation": ((STATE, {"trunk": Reference(np.zeros((3, 3)))}), "rotation"),
    "matrix for a pose": ((STATE, {"pose": Reference(np.eye(4))}), "SE3"),
    "pose that is none": ((STATE, {"pose": Reference(DOUBLE)}), "rotation"),
    "force of wrong shape": ((STATE, {"load": Reference(np.zeros(2))}), "shape"),
    "complex target": ((STATE, {"center_of_mass": Reference(COM + 1j)}), "complex"),
    "None in a target": ((STATE, {"center_of_mass": Reference(np.array([None] * 3))}), "number"),
    "complex velocity": ((STATE, {"center_of_mass": Reference(COM, COM + 1j)}), "complex"),
    "None in a velocity": (
        (STATE, {"center_of_mass": Reference(COM, np.array([None] * 3))}),
        "velocity",
    ),
    "None in a rotation": ((STATE, {"trunk": Reference(np.full((3, 3), None))}), "rotation"),
    "None in a force": ((STATE, {"load": Reference(np.array([None] * 3))}), "load"),
    "contact limit too large": ((STATE, None, {FEET[0]: 10**400}), FEET[0]),
    "NaN target": ((STATE, {"center_of_mass": Reference(NAN)}), "not finite"),
    "NaN rotation": ((STATE, {"trunk": Reference(np.full((3, 3), np.nan))}), "not finite"),
    "NaN feed-forward": ((STATE, {"center_of_mass": Reference(COM, None, NAN)}), "not finite"),
    "infinite velocity": ((STATE, {"center_of_mass": Reference(COM, NAN + np.inf)}), "not finite"),
    "NaN force": ((STATE, {"load": Reference(NAN)}), "not finite"),
}
MORE = {
    "dt zero": ({"dt": 0.0}, "dt"),
    "dt NaN": ({"dt": np.nan}, "dt"),
    "dt as words": ({"dt": "1 ms"}, "dt"),
    "dt infinite": ({"dt": np.inf}, "dt"),
    "dt that no float holds": ({"dt": 10**400}, "dt"),
    "dt that overflows a target": ({"dt": 1.7e308}, "dt"),
    "dt in milliseconds": ({"dt": 1.0}, "dt"),
    "dt in milliseconds at 2 kHz": ({"dt": 0.5}, "dt"),
    "weight that no float holds": ({"weights": {"posture": 10**400}}, "posture"),
    "weights as list": ({"weights": [1.0]}, "weights"),
    "weight negative": ({"weights": {"posture": -1.0}}, "posture"),
    "weight infinite": ({"weights": {"posture": np.inf}}, "posture"),
    "activation above one": ({"activation": {"posture": 2.0}}, "posture"),
    "activation of nothing": ({"activation": {"postur": 1.0}}, "posture"),
    "activation None": ({"activation": {"posture": None}}, "posture"),
}


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


@pytest.mark.parametrize("case", BAD)
def test_a_bad_input_is_named_and_forgotten(used, case):
    before = used.step(STATE).rotor_torque
    arguments, word = BAD[case]
    refused(used.step(*arguments), word)
    assert used.step(*arguments).status in (Status.BAD_INPUT, Status.NOT_FINITE)
    after = used.step(STATE)
    assert after.status is Status.SOLVED
    np.testing.assert_allclose(after.rotor_torque, before, atol=1e-6)


@pytest.mark.parametrize("case", MORE)
def test_a_bad_setting_of_a_tick_is_named(used, case):
    options, word = MORE[case]
    refused(used.step(STATE, **options), word)
    assert used.step(STATE).status is Status.SOLVED


def test_an_exception_of_a_task_is_a_status():
    class Broken(Task):
        def check(self, robot):
            return 1

        def value(self, kinematics):
            raise RuntimeError("no value today")

        error = jacobian = drift = value

    ours = Controller(SOLO, [Broken(name="broken")], [PointContact(name=name) for name in FEET])
    command = ours.step(STATE)
    refused(command, "no value today")
    assert command.status is Status.FAILED


def test_an_exception_does_not_hide_the_state_from_the_safe_command():
    """Whatever raises, joints that turn are braked as after any other bad tick."""

    class Breaks(PostureTask):
        def admitted(self, target, size):
            if target is not None and np.max(np.abs(target)) > 100.0:
                raise RuntimeError("no target today")
            return super().admitted(target, size)

    turning = Motion(STAND, np.r_[np.zeros(6), np.full(12, 0.5)])
    torques = []
    for wish in (np.full(12, 200.0), np.full(12, np.nan)):
        task = Breaks.of(SOLO)
        ours = Controller(SOLO, [task], [PointContact(name=name) for name in FEET])
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
    ours, other = controller(), controller()
    push = Reference(COM, np.full(3, 0.2), np.full(3, 1.0))
    ours.step(STATE, {"center_of_mass": push})
    other.step(STATE, {"center_of_mass": Reference(COM)})
    np.testing.assert_allclose(
        ours.step(STATE).acceleration, other.step(STATE).acceleration, atol=1e-6
    )


def test_buffers_of_the_caller_are_not_kept():
    ours, other = controller(), controller()
    buffer, turn = COM.copy(), np.eye(3)
    q, v = STAND.copy(), REST.copy()
    wish = {"center_of_mass": Reference(buffer), "trunk": Reference(turn)}
    first = ours.step(Motion(q, v), wish)
    kept = first.rotor_torque.copy()
    other.step(STATE, {"center_of_mass": Reference(COM), "trunk": Reference(np.eye(3))})
    buffer[:], turn[:], q[:], v[:] = 7.0, 0.0, 0.3, 9.0
    np.testing.assert_array_equal(first.rotor_torque, kept)
    np.testing.assert_allclose(
        ours.step(STATE).acceleration, other.step(STATE).acceleration, atol=1e-6
    )
    ours.step(Motion(np.full_like(q, np.nan), v))
    np.testing.assert_allclose(ours.step(None).rotor_torque, ours.step(None).rotor_torque)
