"""Points 2 to 4 of what a robot asks of its controller: safe torque, bad input, contacts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin

from benchmarks.foreign.motions import followed, ideal, kinetic, placement, played
from wbc.control import (
    Controller,
    ControllerSettings,
    LetDown,
    PointContact,
    PostureTask,
    Reference,
    Status,
)
from wbc.robot import Motion


def passive(foreign):
    """A safe torque takes energy, on ideal gears without limits."""
    robot = foreign.robot.lossless()
    size = robot.transmission.size
    robot = robot.with_transmission(robot.transmission.replace(torque_limit=np.full(size, 1e9)))
    generator, worst = np.random.default_rng(0), 0.0
    for _ in range(2):
        settings = ControllerSettings(safety=LetDown(hold=100.0))
        ours = Controller(robot, [PostureTask.of(robot)], settings=settings)
        q, v = foreign.pose, np.zeros(robot.model.nv)
        v[robot.actuated] = generator.normal(size=size)
        before = first = kinetic(robot, q, v)
        for _ in range(100):
            torque = ours.step(Motion(q, v), contacts={"nowhere": 0.0}).rotor_torque
            q, v = ideal(robot, q, v, torque)
            after = kinetic(robot, q, v)
            worst, before = max(worst, (after - before) / first), after
    return f"energy gained in a tick over the first one {worst:.0e}", worst < 1e-3


def quiet_torque(foreign):
    """A safe torque does not hammer between the limits."""
    robot = foreign.robot.lossless()
    ours = Controller(robot, foreign.tasks(), foreign.standing)
    q, v = foreign.pose, np.zeros(robot.model.nv)
    v[robot.actuated] = 0.3 * np.random.default_rng(1).normal(size=robot.transmission.size)
    torques = []
    for _ in range(100):
        torques.append(ours.step(Motion(q, v), contacts={"nowhere": 0.0}).rotor_torque)
        q, v = ideal(robot, q, v, torques[-1])
    jump = float((np.abs(np.diff(torques, axis=0)) / robot.transmission.torque_limit).max())
    return f"largest jump over the limit {jump:.2f}", jump < 1.0


def held(foreign):
    """A reference of the wrong shape drops neither hand nor trunk, in the plant for 0.5 s."""
    robot = foreign.robot
    ours = Controller(robot, foreign.tasks(), foreign.standing)
    ours.step(Motion(foreign.pose, np.zeros(robot.model.nv)))
    states = played(robot, ours, foreign.pose, 500, {"posture": Reference(np.zeros(3))})
    frame = foreign.trunk or foreign.hand
    start = placement(robot, foreign.pose, frame).translation
    moved = max(
        np.abs(placement(robot, s.position, frame).translation - start).max() for s in states
    )
    return f"{foreign.trunk or foreign.hand} moves by {1e3 * moved:.2f} mm", moved < 0.01


def bad_input(foreign):
    """Input that makes no sense neither raises nor is solved."""
    robot, ours = foreign.robot, Controller(foreign.robot, foreign.tasks(), foreign.standing)
    q, v = foreign.pose, np.zeros(robot.model.nv)
    still, name = Motion(q, v), foreign.tasks()[0].name
    foot = foreign.standing[0].name if foreign.standing else "foot"
    wrong = [Reference(x) for x in (None, 1.0, "a", np.zeros(7), np.full(5000, 1.0), [None], {})]
    cases = [
        (None,),
        ("state",),
        (Motion(q[1:], v),),
        (Motion(q, v[1:]),),
        (still, [1]),
        (still, 3),
    ]
    cases += [(still, None, x) for x in ([foot], {foot}, foot, {foot: None}, {foot: "a"}, 3)]
    cases += [(still, {name: x}) for x in (None, 1.0, *wrong[1:])]
    cases += [(still, {"posture": Reference(None, np.zeros(3))}), (still, {"nothing": wrong[0]})]
    cases += [(still, {name: Reference(np.full(3, np.nan))}), (Motion(q * np.nan, v),)]
    if robot.has_free_flyer:
        for scale in (0.0, 1.1):
            turned = q.copy()
            turned[3:7] *= scale
            cases.append((Motion(turned, v),))
        turns = (np.zeros(3), 2.0 * np.eye(3), -np.eye(3), np.full((3, 3), np.nan))
        cases += [(still, {"trunk": Reference(x)}) for x in turns]
    solved, raised = 0, 0
    options = [{"weights": {"posture": -1}}, {"activation": {"posture": 2}}, {"dt": 0.0}]
    options += [{"dt": np.nan}, {"weights": 3}, {"activation": {"nothing": 1}}, {"dt": "a"}]
    for arguments, more in [(c, {}) for c in cases] + [((still,), o) for o in options]:
        try:
            solved += ours.step(*arguments, **more).status is Status.SOLVED
        except Exception:
            raised += 1
    good = ours.step(still).status is Status.SOLVED
    total = len(cases) + len(options)
    return f"{total} inputs, {raised} raised, {solved} solved", good and not raised + solved


def forgotten(foreign):
    """A NaN, feed-forward that is left out, and buffers of the caller leave no trace."""
    robot = foreign.robot
    still = Motion(foreign.pose, np.zeros(robot.model.nv))
    one, two = (Controller(robot, foreign.tasks(), foreign.standing) for _ in range(2))
    target = np.array(foreign.pose[robot.actuated_position]) + 0.01
    buffer = target.copy()
    one.step(still, {"posture": Reference(buffer, np.ones(len(target)), np.ones(len(target)))})
    buffer[:] = 7.0
    one.step(still, {"posture": Reference(target * np.nan)})
    two.step(still, {"posture": Reference(target)})
    apart = np.abs(one.step(still).acceleration - two.step(still).acceleration).max()
    return f"accelerations apart by {apart:.0e} rad/s^2", bool(apart < 1e-4)


def redundant(foreign):
    """Velocity noise of 1e-3 rad/s fails no tick, with a point at every corner of a sole."""
    robot, generator = foreign.robot, np.random.default_rng(2)
    points = tuple(PointContact(name=c.name) for c in robot.contacts)
    failed = 0
    for solver in ("proxqp", "daqp"):
        ours = Controller(
            robot, foreign.tasks(), points, settings=ControllerSettings(solver=solver)
        )
        for _ in range(100):
            v = 1e-3 * generator.normal(size=robot.model.nv)
            failed += ours.step(Motion(foreign.pose, v)).status is not Status.SOLVED
    return f"{failed} of 200 ticks not solved", not failed


def drift(foreign):
    """How far a contact has drifted is taken back within 1.5 s."""
    if not foreign.standing:
        return None
    robot, feet = foreign.robot, tuple(replace(c, stiffness=25.0) for c in foreign.standing)
    ours, rest = Controller(robot, foreign.tasks(), feet), np.zeros(robot.model.nv)
    ours.step(Motion(foreign.pose, rest))
    frames = [robot.contacts[0].frame, robot.contacts[-1].frame]
    start = [placement(robot, foreign.pose, f).translation for f in frames]
    moved = pin.integrate(robot.model, foreign.pose, 0.01 * np.eye(robot.model.nv)[7])
    sizes = []
    for q in (moved, *(s.position for _, s in followed(robot, ours, moved, 1500, None))):
        now = [placement(robot, q, f).translation for f in frames]
        sizes.append(np.abs(np.array(now) - start).max())
    told = f"{1e3 * sizes[0]:.2f} -> {1e3 * sizes[-1]:.3f} mm"
    return told, sizes[0] > 5e-4 and sizes[-1] < 0.05 * sizes[0] and len(sizes) > 1500


def rolling(foreign):
    """The lowest point of a ball under a link rests while the ball rolls."""
    if foreign.free is None:
        return None
    radius, plain = 0.02, foreign.robot
    robot = replace(plain, contacts=tuple(replace(c, radius=radius) for c in plain.contacts))
    ours = Controller(robot, foreign.tasks(), foreign.standing)
    data, slip, rolled = robot.model.createData(), 0.0, 0.0
    com = pin.centerOfMass(robot.model, data, foreign.pose).copy()

    def asked(tick):
        return {"center_of_mass": Reference(com + np.sin(0.01 * tick) * np.array([0.03, 0, -0.02]))}

    for _, state in followed(robot, ours, foreign.pose, 300, asked):
        pin.forwardKinematics(robot.model, data, state.position, state.velocity)
        for contact in robot.contacts:
            frame = robot.model.getFrameId(contact.frame)
            rate = pin.getFrameVelocity(robot.model, data, frame, pin.LOCAL_WORLD_ALIGNED)
            low = rate.linear + np.cross(rate.angular, [0.0, 0.0, -radius])
            slip = max(slip, np.abs(low).max())
            rolled = max(rolled, np.abs(rate.linear[:2]).max())
    told = f"{1e3 * rolled:.1f} mm/s at the centre, {1e3 * slip:.2f} where it touches"
    return told, slip < 2e-3 < rolled


CHECKS = (passive, quiet_torque, held, bad_input, forgotten, redundant, drift, rolling)
