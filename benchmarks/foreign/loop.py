"""Point 7, what a loop around the controller needs."""

from __future__ import annotations

import copy
import pickle
import threading
from collections import Counter
from dataclasses import replace
from types import SimpleNamespace

import mujoco
import numpy as np
import pinocchio as pin

from benchmarks.foreign.motions import TICK, followed, placement, reach, towards
from benchmarks.mujoco_model import mujoco_model
from wbc.control import (
    ContactRamp,
    ContactSchedule,
    Controller,
    JointLimit,
    PostureTask,
    Reference,
    RotorTorqueLimit,
    Status,
)
from wbc.robot import JointMap, Motion


def joint_targets(foreign):
    """Perfect position drives that follow `Command.position` move as the accelerations say."""
    robot = foreign.robot
    start, goal = towards(foreign, 0.03)
    ours, feet = reach(foreign)
    *_, (_, meant) = followed(robot, ours, foreign.pose, 800, {"hand": Reference(goal)}, feet)
    ours, feet = reach(foreign)
    q, v = foreign.pose.copy(), np.zeros(robot.model.nv)
    for _ in range(800):
        command = ours.step(Motion(q, v), {"hand": Reference(goal)}, feet)
        if not command.status.usable:
            return command.message, False
        v = v + TICK * command.acceleration
        q = pin.integrate(robot.model, q, TICK * v)
        q[robot.actuated_position], v[robot.actuated] = command.position, command.velocity
    one, two = (placement(robot, x, foreign.hand).translation for x in (q, meant.position))
    apart, whole = np.linalg.norm(one - two), np.linalg.norm(start - one)
    return f"{1e3 * apart:.2f} mm apart after {1e3 * whole:.0f}", apart < 0.01 * whole


def joint_limits(foreign):
    """A posture 0.3 rad beyond a stop stops at it."""
    if foreign.trunk is not None:
        return None
    robot = foreign.robot
    joint = robot.transmission.joints[2]
    at = robot.position_index(joint)
    stop = foreign.pose[at] + 0.05
    model = robot.model.copy()
    upper = np.array(model.upperPositionLimit)
    upper[at] = stop
    model.upperPositionLimit = upper
    robot = replace(robot, model=model)
    limits = [RotorTorqueLimit(), JointLimit.of(robot, [joint])]
    ours = Controller(robot, [PostureTask.of(robot, stiffness=50.0)], limits=limits)
    wish = foreign.pose[robot.actuated_position].copy()
    wish[list(robot.transmission.joints).index(joint)] += 0.3
    reached = max(
        s.position[at]
        for _, s in followed(robot, ours, foreign.pose, 800, {"posture": Reference(wish)})
    )
    return f"{1e3 * (reached - stop):.3f} mrad beyond the stop", -0.01 < reached - stop < 1e-4


def schedule(foreign):
    """A trot by `ContactSchedule` and `ContactRamp` on the spot: every tick is usable."""
    if foreign.free is None:
        return None
    names = [c.name for c in foreign.standing]
    pairs = {n: 0.0 if n in (names[0], names[3]) else 0.5 for n in names}
    trot = ContactSchedule(0.4, pairs, duty=0.6)
    load = 9.81 * pin.computeTotalMass(foreign.robot.model)
    ramp = ContactRamp(names, load=load, duration=0.02)
    ours = Controller(foreign.robot, foreign.tasks(), foreign.standing)
    still, refused = Motion(foreign.pose, np.zeros(foreign.robot.model.nv)), 0
    for tick in range(800):
        feet = ramp.step(trot.standing(TICK * tick), TICK)
        refused += not ours.step(still, contacts=feet).status.usable
    return f"{refused} of 800 ticks refused", not refused


def joint_orders(foreign):
    """States and torques in the orders of a URDF, a ROS message and MuJoCo."""
    robot, generator = foreign.robot, np.random.default_rng(5)
    q = pin.integrate(robot.model, foreign.pose, 0.3 * generator.normal(size=robot.model.nv))
    v, names = generator.normal(size=robot.model.nv), list(robot.single_joints)
    place = [robot.position_index(j) for j in names]
    rate = [robot.velocity_index(j) for j in names]
    order = generator.permutation(len(names))
    told = [names[i] for i in order]
    message = SimpleNamespace(
        name=told, position=q[place][order].tolist(), velocity=v[rate][order].tolist(), effort=[]
    )
    joints = JointMap.of(robot, names)
    got = joints.motion_of_joint_state(message)
    worst = (
        np.abs(got.position[place] - q[place]).max() + np.abs(got.velocity[rate] - v[rate]).max()
    )
    torque = generator.normal(size=robot.transmission.size)
    sent = dict(zip(told, JointMap.of(robot, told).torques(torque), strict=True))
    known = dict(
        zip(robot.transmission.joints, robot.transmission.gear_ratio * torque, strict=True)
    )
    worst += max(abs(sent[j] - known[j]) for j in known)
    worst += _mujoco(robot, q, v)
    return f"worst difference {worst:.0e}", worst < 1e-9


def _mujoco(robot, q, v):
    """Return how far places of links differ between MuJoCo's state and what the map makes of it."""
    model = mujoco_model(robot, 1e-3)
    data = mujoco.MjData(model)
    offset = 7 if robot.has_free_flyer else 0
    if offset:
        data.qpos[:7] = [*q[:3], q[6], *q[3:6]]
        turn = pin.Quaternion(q[3:7]).toRotationMatrix()
        data.qvel[:3], data.qvel[3:6] = turn @ v[:3], v[3:6]
    data.qpos[offset:], data.qvel[offset and 6 :] = q[offset:], v[offset and 6 :]
    found = JointMap.of_mujoco(robot, model).motion_of_mujoco(data)
    return np.abs(found.position - q).max() + np.abs(found.velocity - v).max()


def threads_and_copies(foreign):
    """Two threads get torques and are told; robots pickle and copy to the same controller."""
    robot = foreign.robot
    still = Motion(foreign.pose, np.zeros(robot.model.nv))
    ours = Controller(robot, foreign.tasks(), foreign.standing)
    own = ours.step(still).rotor_torque
    apart = 0.0
    for twin in (pickle.loads(pickle.dumps(robot)), copy.deepcopy(robot), copy.copy(robot)):
        other = Controller(twin, foreign.tasks(), foreign.standing).step(still).rotor_torque
        apart = max(apart, np.abs(other - own).max())
    statuses = []

    def loop():
        statuses.extend(ours.step(still) for _ in range(300))

    both = [threading.Thread(target=loop) for _ in range(2)]
    for thread in both:
        thread.start()
    for thread in both:
        thread.join()
    wild = sum(not np.isfinite(c.rotor_torque).all() for c in statuses)
    kinds = Counter(c.status for c in statuses)
    good = not wild and len(statuses) == 600 and kinds.keys() <= {Status.SOLVED, Status.BAD_INPUT}
    good = good and ours.step(still).status is Status.SOLVED and apart < 1e-9
    return f"copies {apart:.0e} N m apart; {kinds[Status.BAD_INPUT]} of 600 told to wait", good


CHECKS = (joint_targets, joint_limits, schedule, joint_orders, threads_and_copies)
