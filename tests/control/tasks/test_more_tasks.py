"""Tasks that peers have, hard tasks, levels, and targets far away."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pinocchio as pin
import pytest

from wbc.control import (
    CapturePointTask,
    CenterOfMassTask,
    Controller,
    ControllerSettings,
    FrameOrientationTask,
    FramePositionTask,
    JointLimit,
    PointContact,
    PostureTask,
    Reference,
    RotorTorqueLimit,
    Status,
    SurfaceContact,
)
from wbc.control.kinematics import Kinematics
from wbc.effects import load_robot
from wbc.robot import Motion
from wbc.sim import Plant

TALOS = load_robot("talos")
HALF = TALOS.poses["half_sitting"]
SOLO = load_robot("solo12")
STAND = next(iter(SOLO.poses.values()))
HAND = "arm_left_7_link"


def moving(robot, pose, seed=0):
    generator = np.random.default_rng(seed)
    q = pin.integrate(robot.model, pose, 0.2 * generator.normal(size=robot.model.nv))
    return q, *generator.normal(size=(2, robot.model.nv))


def talos_controller(*tasks, **settings):
    soles = [
        SurfaceContact(
            name=side,
            corners=tuple(
                f"{side}_sole_{a}_{b}" for a in ("front", "rear") for b in ("left", "right")
            ),
        )
        for side in ("left", "right")
    ]
    own = [
        CenterOfMassTask(weight=10.0),
        FrameOrientationTask(name="trunk", frame="torso_2_link"),
        PostureTask.of(TALOS, weight=0.01),
    ]
    return Controller(TALOS, [*own, *tasks], soles, settings=ControllerSettings(**settings))


def placed(robot, q, frame):
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    return data.oMf[robot.model.getFrameId(frame)]


def test_a_pushed_humanoid_takes_its_capture_point_back():
    """It starts with 0.25 m/s; by the law of the task xi decays at its stiffness."""
    data = TALOS.model.createData()
    com = pin.centerOfMass(TALOS.model, data, HALF).copy()
    point = CapturePointTask(height=float(com[2]), weight=10.0, stiffness=6.0)
    tasks = [
        CenterOfMassTask(name="height", axes="z", weight=10.0),
        point,
        FrameOrientationTask(name="trunk", frame="torso_2_link"),
        PostureTask.of(TALOS, weight=0.01),
    ]
    controller = talos_controller()
    controller = Controller(TALOS, tasks, [b.contact for b in controller._contacts.values()])
    jacobian = pin.jacobianCenterOfMass(TALOS.model, data, HALF)
    feet = [f"leg_{side}_6_link" for side in ("left", "right")]
    rows = [jacobian]
    pin.computeJointJacobians(TALOS.model, data, HALF)
    pin.framesForwardKinematics(TALOS.model, data, HALF)
    for frame in feet:
        rows.append(
            pin.getFrameJacobian(
                TALOS.model,
                data,
                TALOS.model.getFrameId(frame),
                pin.ReferenceFrame.LOCAL_WORLD_ALIGNED,
            )
        )
    wanted = np.zeros(15)
    wanted[1] = 0.15
    v = np.linalg.lstsq(np.vstack(rows), wanted, rcond=None)[0]
    q, step, seen = HALF.copy(), 1e-3, []
    pole = np.sqrt(9.81 / com[2])
    for _ in range(600):
        command = controller.step(
            Motion(q, v), {"capture_point": Reference(com[:2]), "height": Reference(com[2:])}
        )
        assert command.status is Status.SOLVED
        pin.centerOfMass(TALOS.model, data, q, v)
        seen.append(data.com[0][1] + data.vcom[0][1] / pole - com[1])
        v = v + step * command.acceleration
        q = pin.integrate(TALOS.model, q, step * v)
    assert seen[0] > 0.03
    times = step * np.arange(600)
    np.testing.assert_allclose(seen, seen[0] * np.exp(-6.0 * times), atol=0.05 * seen[0])


@pytest.mark.parametrize("solver", ["proxqp", "daqp"])
@pytest.mark.parametrize("rival", [1.0, 1e4])
def test_a_hard_task_is_kept_whatever_others_weigh(solver, rival):
    target = placed(TALOS, HALF, HAND).translation + np.array([0.05, 0.05, 0.1])
    hand = FramePositionTask(name="hand", frame=HAND, weight=np.inf)
    other = FramePositionTask(name="rival", frame="arm_left_6_link", weight=rival)
    controller = talos_controller(hand, other, solver=solver)
    _, v, _ = moving(TALOS, HALF, 3)
    state = Motion(HALF, 0.02 * v)
    command = controller.step(state, {"hand": Reference(target)})
    assert command.status is Status.SOLVED, command.message
    kinematics = Kinematics(TALOS)
    kinematics.update(HALF, 0.02 * v)
    rate = hand.jacobian(kinematics) @ (0.02 * v)
    wanted = 100.0 * (target - hand.value(kinematics)) - 20.0 * rate
    found = hand.jacobian(kinematics) @ command.acceleration + hand.drift(kinematics)
    np.testing.assert_allclose(found, wanted, atol=1e-5)
    dense = controller.problem
    assert np.isfinite(dense.H).all()
    assert len(dense.b) == 6 + 12 + 3


def test_hard_posture_and_a_hard_task_that_is_off():
    names = SOLO.transmission.joints[:3]
    leg = PostureTask.of(SOLO, names, name="leg", weight=np.inf)
    tasks = [CenterOfMassTask(weight=10.0), PostureTask.of(SOLO, weight=0.1), leg]
    controller = Controller(SOLO, tasks, [PointContact(name=c.name) for c in SOLO.contacts])
    stance = dict.fromkeys([c.name for c in SOLO.contacts][1:], np.inf)
    target = {"leg": Reference(STAND[7:10] + 0.1)}
    still = Motion(STAND, np.zeros(18))
    on = controller.step(still, target, stance)
    np.testing.assert_allclose(on.acceleration[6:9], 10.0, atol=1e-6)
    off = controller.step(still, target, stance, activation={"leg": 0.0})
    assert off.status is Status.SOLVED
    assert np.abs(off.acceleration[6:9]).max() < 1.0


def test_a_hard_task_that_contradicts_a_contact_gives_way():
    """The foot stays where it stands; the tick says which task is not kept."""
    foot = FramePositionTask(name="foot", frame=SOLO.contacts[0].frame, weight=np.inf)
    tasks = [CenterOfMassTask(weight=10.0), PostureTask.of(SOLO, weight=0.1), foot]
    controller = Controller(SOLO, tasks, [PointContact(name=c.name) for c in SOLO.contacts])
    command = controller.step(Motion(STAND, np.zeros(18)), {"foot": Reference([0.3, 0.2, 0.1])})
    assert command.status.usable
    assert list(command.passed) == ["task 'foot'"]
    assert "task 'foot'" in command.message
    kinematics = Kinematics(SOLO)
    kinematics.update(STAND, np.zeros(18))
    np.testing.assert_allclose(foot.jacobian(kinematics) @ command.acceleration, 0.0, atol=1e-5)
    assert np.abs(command.rotor_torque).max() <= SOLO.transmission.torque_limit.max()


def test_a_target_a_metre_above_a_quadruped_refuses_no_tick():
    """It stretches its legs and stays there; without the limit 41 of these ticks had no motion."""
    robot = load_robot("solo12")
    q = np.array(robot.poses["standing"])
    target = np.array(pin.centerOfMass(robot.model, robot.model.createData(), q))
    target[2] += 1.0
    tasks = [
        CenterOfMassTask(weight=100.0),
        FrameOrientationTask(name="trunk", frame="base_link", weight=10.0),
        PostureTask.of(robot, weight=0.1, stiffness=50.0),
    ]
    feet = [PointContact(name=contact.name) for contact in robot.contacts]
    limits = [RotorTorqueLimit(), JointLimit.of(robot)]
    controller, plant, statuses = Controller(robot, tasks, feet, limits), Plant(robot), Counter()
    state = plant.state(q)
    for _ in range(1000):
        motion = Motion(state.position, state.velocity)
        command = controller.step(motion, {"center_of_mass": Reference(target)})
        statuses[command.status.usable] += 1
        state = plant.step(state, command.rotor_torque, 1e-3).state
    assert statuses == {True: 1000}
    assert state.position[2] > q[2] + 0.05


@pytest.mark.parametrize("way", [(1.0, 0.0), (0.0, 1.0), (-1.0, 1.0)], ids=str)
@pytest.mark.parametrize(("name", "trunk"), [("solo12", "base_link"), ("anymal", "base")])
def test_a_target_a_metre_aside_does_not_drop_a_quadruped(name, trunk, way):
    """It leans as far as its feet carry it and stays there; before, it fell over them."""
    robot = load_robot(name)
    q, data = np.array(robot.poses["standing"]), robot.model.createData()
    start = np.array(pin.centerOfMass(robot.model, data, q))
    target = start + np.array([*way, 0.0])
    tasks = [
        CenterOfMassTask(weight=100.0),
        FrameOrientationTask(name="trunk", frame=trunk, weight=10.0),
        PostureTask.of(robot, weight=0.1, stiffness=50.0),
    ]
    feet = [PointContact(name=contact.name) for contact in robot.contacts]
    controller, plant, usable = Controller(robot, tasks, feet), Plant(robot), Counter()
    state = plant.state(q, lifted=True)
    for _ in range(1500):
        motion = Motion(state.position, state.velocity)
        command = controller.step(motion, {"center_of_mass": Reference(target)})
        usable[command.status.usable] += 1
        state = plant.step(state, command.rotor_torque, 1e-3).state
    moved = np.array(pin.centerOfMass(robot.model, data, state.position)) - start
    assert usable == {True: 1500}
    assert np.abs(state.velocity).max() < 1e-2
    assert moved[:2] @ way > 0.08 * np.linalg.norm(way)
    assert moved[2] > -0.1 * start[2]


@pytest.mark.parametrize("limit", [2.0, 20.0])
def test_a_joint_goes_to_its_target_at_its_limit_and_does_not_pass_it(limit):
    """From rest it asks for its limit; then it goes at limit / damping, and comes to rest there."""
    robot = load_robot("planar_leg_fixed").lossless()
    task = PostureTask.of(robot, ("knee",), acceleration_limit=limit)
    rest = PostureTask.of(robot, ("hip",), name="hip", weight=10.0)
    controller = Controller(robot, [task, rest], limits=[])
    q, v, step, target = np.array([0.4, -1.0]), np.zeros(2), 1e-3, 1.0
    speeds, asked = [], []
    for _ in range(round(2.0 / (limit / 20.0) / step + 2.0 / step)):
        command = controller.step(Motion(q, v), {"posture": Reference(np.array([target]))})
        assert command.status.usable
        a = command.acceleration
        q, v = q + step * v + 0.5 * step**2 * a, v + step * a
        speeds.append(v[1])
        asked.append(a[1])
    assert asked[0] == pytest.approx(limit, rel=1e-3)
    assert np.abs(asked).max() <= limit * (1.0 + 1e-3)
    assert max(speeds) == pytest.approx(limit / 20.0, rel=0.02)
    assert q[1] == pytest.approx(target, abs=1e-3)


@pytest.mark.parametrize(
    ("speed", "ahead", "found"),
    [(50.0, None, -100.0), (0.0, 500.0, 500.0)],
    ids=["brakes", "ahead"],
)
def test_what_is_fed_back_is_limited_and_what_is_fed_forward_is_not(speed, ahead, found):
    robot, signs = load_robot("planar_leg_fixed").lossless(), np.array([1.0, -1.0])
    controller = Controller(robot, [PostureTask.of(robot, acceleration_limit=100.0)], limits=[])
    wish = {} if ahead is None else {"posture": Reference(acceleration=ahead * signs)}
    command = controller.step(Motion(np.array([0.4, -1.0]), speed * signs), wish)
    np.testing.assert_allclose(command.acceleration, found * signs, rtol=1e-3)
