"""Points 5 and 6: what changes by tick, gears that are better than believed, unknown loads."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from benchmarks.foreign.motions import followed, placement, played, reach, towards
from wbc.control import (
    Controller,
    ControllerSettings,
    DisturbanceObserver,
    Reference,
    RestPolicy,
)
from wbc.effects import PayloadMass
from wbc.robot import Motion


def activation(foreign):
    """A task of activation 0 is as if it were not there; weights by tick are a task's own."""
    ours, feet = reach(foreign, weight=3.0)
    still = Motion(foreign.pose, np.zeros(foreign.robot.model.nv))
    wish = {"hand": Reference(towards(foreign, 0.05)[1])}
    tasks = [t for t in ours.tasks if t.name != "hand"]
    plain = Controller(foreign.robot, tasks, foreign.standing).step(still, None, feet)
    off = ours.step(still, wish, feet, activation={"hand": 0.0})
    full = ours.step(still, wish, feet)
    half = ours.step(still, wish, feet, activation={"hand": 0.5})
    same = ours.step(still, wish, feet, weights={"hand": 1.5})
    apart = np.abs(off.acceleration - plain.acceleration).max()
    twice = np.abs(half.acceleration - same.acceleration).max()
    moved = np.abs(full.acceleration - plain.acceleration).max()
    return f"{apart:.0e}, {twice:.0e} of {moved:.0e} rad/s^2", max(apart, twice) < 1e-3 * moved


def tick_length(foreign):
    """A hand that is sent 3 cm away arrives as well with ticks of 4 ms that `step` is told."""
    ends = []
    start, goal = towards(foreign, 0.03)
    for tick in (1e-3, 4e-3):
        ours, feet = reach(foreign)
        ticks = round(0.8 / tick)
        *_, (command, state) = followed(
            foreign.robot, ours, foreign.pose, ticks, {"hand": Reference(goal)}, feet, tick
        )
        if not command.status.usable:
            return command.message, False
        ends.append(placement(foreign.robot, state.position, foreign.hand).translation)
    apart = 1e3 * np.abs(ends[1] - ends[0]).max()
    return f"{apart:.3f} mm apart after {1e3 * np.linalg.norm(goal - start):.0f}", apart < 0.3


def margin(foreign):
    """Gears 5 % better than believed: with the margin, least torque stays where they hold."""
    robot = foreign.robot
    gears, scale = robot.transmission, 1.05
    outside = {}
    for share in (0.0, 0.15):
        settings = ControllerSettings(rest_policy=RestPolicy.LEAST_TORQUE, rest_margin=share)
        ours = Controller(robot, foreign.tasks(), foreign.standing, settings=settings)
        command = ours.step(Motion(foreign.pose, np.zeros(robot.model.nv)))
        T, t = command.output_torque, command.mesh_torque
        ends = gears.backward_efficiency * scale * T, T / (gears.forward_efficiency * scale)
        beyond = np.maximum(np.minimum(*ends) - t, t - np.maximum(*ends))
        outside[share] = int((beyond > 1e-9).sum())
    told = f"{outside[0.0]} gears slip without, {outside[0.15]} with a margin of 0.15"
    return told, outside[0.0] > 0 and not outside[0.15]


def observer(foreign):
    """An unknown load: the momentum observer takes at least nine tenths of the error away."""
    robot = foreign.robot.lossless()
    body = robot.bodies[-1]
    if foreign.trunk is not None:
        frame = robot.model.frames[robot.model.getFrameId(foreign.trunk)]
        body = next(b for b in robot.bodies if _joint_of(robot, b) == frame.parentJoint)
    mass = 0.05 * pin.computeTotalMass(robot.model)
    loaded, left = robot.with_effect(PayloadMass(body, mass=mass)), {}
    frame = foreign.trunk or foreign.hand
    for learns in (None, DisturbanceObserver(rate=4.0, bound=10.0 * mass * 9.81)):
        ours = Controller(
            robot,
            foreign.tasks(),
            foreign.standing,
            settings=ControllerSettings(disturbance=learns),
        )
        *_, last = played(loaded, ours, foreign.pose, 1500, {})
        moved = placement(robot, last.position, frame).translation
        moved = moved - placement(robot, foreign.pose, frame).translation
        left[learns is not None] = 1e3 * float(np.linalg.norm(moved))
    told = f"{mass:.1f} kg: {left[False]:.2f} -> {left[True]:.3f} mm"
    return told, left[True] < 0.1 * left[False]


def _joint_of(robot, body):
    return robot.model.frames[robot.model.getFrameId(body)].parentJoint


CHECKS = (activation, tick_length, margin, observer)
