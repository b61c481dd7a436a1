"""Point 7, collision limits: coal is the judge."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin

from benchmarks.foreign.motions import followed, placement, reach, towards
from wbc.control import (
    CollisionLimit,
    Reference,
    RotorTorqueLimit,
    Shape,
)
from wbc.control.kinematics import Kinematics
from wbc.control.rows.collision import CollisionRows


def collision(foreign):
    """A hand that is sent through a ball keeps its distance, by coal, ten times a tick."""
    robot = foreign.robot
    start, goal = towards(foreign, 0.25)
    ball = start + 0.6 * (goal - start)
    shapes = [
        Shape(name="hand", geometry=coal.Capsule(0.02, 0.04), frame=foreign.hand),
        Shape(name="ball", geometry=coal.Sphere(0.03), placement=pin.SE3(np.eye(3), ball)),
    ]
    least = {}
    for kept in (False, True):
        limit = CollisionLimit(shapes, [("hand", "ball")], margin=0.01)
        limits = [RotorTorqueLimit(), *([limit] if kept else [])]
        ours, feet = reach(foreign, limits=limits)
        q, worst = foreign.pose, np.inf
        wish = {"hand": Reference(goal)}
        for command, state in followed(robot, ours, q, 600, wish, feet):
            if not command.status.usable:
                return command.message, False
            for share in np.linspace(0.1, 1.0, 10):
                at = placement(
                    robot, pin.interpolate(robot.model, q, state.position, share), foreign.hand
                )
                worst = min(worst, _distance(shapes, at))
            q = state.position
        least[kept] = 1e3 * worst
    told = f"nearest {least[False]:.1f} mm without, {least[True]:.2f} with a margin of 10"
    return told, least[False] < 0.0 and least[True] > 9.5


def _distance(shapes, place):
    hand, ball = shapes
    one = coal.Transform3s(place.rotation, place.translation)
    two = coal.Transform3s(np.eye(3), ball.placement.translation)
    result = coal.DistanceResult()
    return coal.distance(hand.geometry, one, ball.geometry, two, coal.DistanceRequest(), result)


def collision_rows(foreign):
    """Rows of the URDF's own solids are the rates of coal's distances."""
    robot = foreign.robot
    geometry = foreign.solids()
    limit = CollisionLimit.of(robot, geometry, influence=5.0, rate=2.0)
    v = np.random.default_rng(3).normal(size=robot.model.nv)
    rows, judge = CollisionRows(limit, robot.model), Kinematics(robot)
    found = []
    for share in (0.0, 1e-5, -1e-5):
        judge.update(pin.integrate(robot.model, foreign.pose, share * v), v)
        rows.fill(judge)
        found.append((rows.rows @ v, rows.distances.copy()))
    rates = (found[1][1] - found[2][1]) / 2e-5
    apart = np.abs(found[0][0] - rates)
    told = f"{len(apart)} pairs, {np.median(apart):.0e} m/s, worst {apart.max():.0e}"
    return told, float(np.percentile(apart, 90)) < 1e-3 * np.abs(rates).max()


def own_bodies(foreign):
    """A hand that is sent into another link of the robot stops before it; meshes of the URDF."""
    if foreign.free is not None:
        return None
    robot, geometry = foreign.robot, foreign.solids()
    everything = CollisionLimit.of(robot, geometry)
    judge = CollisionRows(everything, robot.model)
    start = _distances(judge, robot, foreign.pose)
    pairs = [p for p, far in zip(everything.pairs, start, strict=True) if far > 0.03]
    limit = CollisionLimit(everything.shapes, pairs, margin=0.01)
    judge, least, costs = CollisionRows(limit, robot.model), {}, {}
    goal = placement(robot, foreign.pose, foreign.other).translation
    for kept in (False, True):
        limits = [RotorTorqueLimit(), *([limit] if kept else [])]
        ours, feet = reach(foreign, limits=limits)
        worst, times = np.inf, []
        for command, state in followed(
            robot, ours, foreign.pose, 800, {"hand": Reference(goal)}, feet
        ):
            if not command.status.usable:
                return f"after {len(times)} ticks: {command.message}", False
            times.append(command.tick_time)
            worst = min(worst, _distances(judge, robot, state.position).min())
        least[kept], costs[kept] = 1e3 * worst, float(np.median(times))
    told = (
        f"{len(pairs)} pairs, nearest {least[False]:.1f} mm without, {least[True]:.2f} with a "
        f"margin of 10; a tick {1e3 * costs[True]:.2f} ms, {costs[True] / costs[False]:.1f} times"
    )
    return told, least[False] < 0.0 and least[True] > 9.0


def _distances(rows, robot, q):
    judge = Kinematics(robot)
    judge.update(q, np.zeros(robot.model.nv))
    rows.fill(judge)
    return rows.distances.copy()


CHECKS = (collision, collision_rows, own_bodies)
