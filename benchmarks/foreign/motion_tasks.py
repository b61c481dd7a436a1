"""Point 7, tasks: gaze, distance, strict levels, hard tasks, the capture point."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from benchmarks.foreign.motions import followed, placement, reach, towards
from wbc.control import (
    CapturePointTask,
    Controller,
    FrameDistanceTask,
    FrameOrientationTask,
    FramePositionTask,
    GazeTask,
    PostureTask,
    Reference,
    Status,
)
from wbc.control.checking import check_task
from wbc.control.kinematics import Kinematics
from wbc.robot import Motion


def gaze_and_distance(foreign):
    """Rows and drifts of both tasks against finite differences; the hand looks where asked."""
    robot, generator = foreign.robot, np.random.default_rng(4)
    q = pin.integrate(robot.model, foreign.pose, 0.1 * generator.normal(size=robot.model.nv))
    distance = FrameDistanceTask(frame=foreign.hand, other=foreign.other)
    errors = check_task(robot, distance, q, *generator.normal(size=(2, robot.model.nv)))
    worst = max(errors.jacobian, 1e-2 * errors.drift)
    axis = np.array([0.0, 0.0, 1.0])
    place = placement(robot, foreign.pose, foreign.hand)
    turn = pin.exp3(np.array([0.15, 0.1, 0.0]))
    goal = place.translation + place.rotation @ turn @ axis
    gaze = GazeTask(frame=foreign.hand, axis=tuple(axis), weight=30.0, stiffness=50.0)
    ours, feet = reach(foreign, gaze)
    wish = {"gaze": Reference(goal), "hand": Reference(place.translation)}
    *_, (_, state) = followed(robot, ours, foreign.pose, 1200, wish, feet)
    end = placement(robot, state.position, foreign.hand)
    ahead = (goal - end.translation) / np.linalg.norm(goal - end.translation)
    off = np.degrees(np.arccos(min(1.0, float(ahead @ end.rotation @ axis))))
    # a foot of three joints that keeps its place cannot look anywhere
    good = worst < 1e-5 and (foreign.free is not None or off < 2.0)
    return f"derivatives {worst:.0e}; looks {off:.2f} of 10.3 deg past it", good


def levels(foreign):
    """Three strict levels: what stands below moves nothing of what stands above; hard tasks."""
    robot = foreign.robot
    names = ("first", "second", "third")
    start, goal = towards(foreign, 0.05)
    still = Motion(foreign.pose, np.zeros(robot.model.nv))
    worst = 0.0
    found = []
    for depth in (1, 2, 3):
        tasks = [
            FramePositionTask(name=names[0], frame=foreign.hand, stiffness=50.0),
            FrameOrientationTask(name=names[1], frame=foreign.hand, level=1),
            PostureTask.of(robot, name=names[2], level=2, stiffness=20.0),
        ][:depth]
        wishes = [
            goal,
            pin.exp3(np.array([0.3, 0.2, 0.1])),
            foreign.pose[robot.actuated_position] + 0.1,
        ]
        ours = Controller(robot, tasks, foreign.standing)
        feet = {c.name: np.inf for c in foreign.standing if c.name != foreign.free}
        wish = {n: Reference(w) for n, w in zip(names[:depth], wishes, strict=False)}
        command = ours.step(still, wish, feet)
        if command.status is not Status.SOLVED:
            return f"{depth} levels: {command.message}", False
        judge = Kinematics(robot)
        judge.update(still.position, still.velocity)
        found.append([t.jacobian(judge) @ command.acceleration for t in tasks])
    for above, below in ((0, 1), (0, 2), (1, 2)):
        for own, other in zip(found[above], found[below], strict=False):
            worst = max(worst, np.abs(own - other).max())
    ours, feet = reach(foreign, weight=np.inf)
    command = ours.step(still, {"hand": Reference(goal)}, feet)
    miss = np.nan
    if command.status is Status.SOLVED:
        wanted = 100.0 * (goal - start)
        miss = np.abs(ours.tasks[-1].jacobian(judge) @ command.acceleration - wanted).max()
    return f"levels {worst:.0e}, hard task {miss:.0e} m/s^2", worst < 1e-3 and miss < 1e-4


def capture_point(foreign):
    """A push is caught: the capture point comes back."""
    if foreign.trunk is None:
        return None
    robot = foreign.robot
    data = robot.model.createData()
    height = float(pin.centerOfMass(robot.model, data, foreign.pose)[2])
    pole = np.sqrt(9.81 / height)
    task = CapturePointTask(weight=100.0, stiffness=5.0, height=height)
    keep = [t for t in foreign.tasks() if t.name != "center_of_mass"]
    ours = Controller(robot, [task, *keep], foreign.standing)
    middle = data.com[0][:2].copy()
    v = _sideways(robot, foreign.pose)
    ends = []
    for _, state in followed(
        robot, ours, foreign.pose, 1500, {"capture_point": Reference(middle)}, velocity=v
    ):
        pin.centerOfMass(robot.model, data, state.position, state.velocity)
        ends.append(np.abs(data.com[0][:2] + data.vcom[0][:2] / pole - middle).max())
    told = f"{1e3 * ends[0]:.1f} -> {1e3 * ends[-1]:.2f} mm"
    return told, len(ends) == 1500 and ends[-1] < 0.05 * ends[0]


def _sideways(robot, q):
    """Return v (nv,) at which feet rest and the centre of mass moves sideways by 0.03 m/s."""
    data = robot.model.createData()
    frames = [robot.model.getFrameId(contact.frame) for contact in robot.contacts]
    com = pin.jacobianCenterOfMass(robot.model, data, q)
    rest = [
        pin.computeFrameJacobian(robot.model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)[:3]
        for frame in frames
    ]
    rates = np.zeros(3 * len(rest) + 3)
    rates[-2] = 0.03
    return np.linalg.lstsq(np.vstack([*rest, com]), rates, rcond=None)[0]


CHECKS = (gaze_and_distance, levels, capture_point)
