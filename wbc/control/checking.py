"""What tasks, contacts and limits say about themselves, held against differences and motions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.control.controller import Controller
from wbc.control.kinematics import Kinematics
from wbc.control.qp.solvers import WarmStart
from wbc.control.reference import Reference
from wbc.control.rows.contacts import Contact, PointContact
from wbc.control.rows.limits import JointLimit, RotorTorqueLimit
from wbc.control.rows.posture import PostureTask
from wbc.control.rows.task import Task
from wbc.control.settings import ControllerSettings
from wbc.control.speed import SpeedBlend
from wbc.dynamics import contact_torque, link_torque, rotor_torque
from wbc.errors import ControlError
from wbc.robot import Motion, Robot


@dataclass(frozen=True)
class DerivativeErrors:
    """Largest differences between stated and finite-difference derivatives.

    Attributes:
        jacobian: of J v against the rate of -error for a fixed target (or of the value's own
            motion), in the task's unit per second.
        drift: of J qdd + dJ/dt v against the rate of J v.
    """

    jacobian: float
    drift: float


def check_task(
    robot: Robot,
    task: Task,
    position: FloatArray,
    velocity: FloatArray,
    acceleration: FloatArray,
    *,
    step: float = 1e-5,
) -> DerivativeErrors:
    """Return how far a task's Jacobian and drift are from central differences.

    The error's rate is checked about its own present value, where it must be -J v; a task whose
    value is itself a rate (momentum) is checked by J v = value instead.

    Args:
        robot: the robot.
        task: any task.
        position, velocity, acceleration: (nq,), (nv,), (nv,) of the motion to go along.
        step: of the differences [s].
    """
    task.check(robot)
    at = _along(robot, position, velocity, acceleration)
    here, ahead, behind = at(0.0), at(step), at(-step)
    target, rate = task.value(here), task.jacobian(here) @ velocity
    if np.shape(target) == rate.shape and np.allclose(target, rate, rtol=1e-9, atol=1e-9):
        jacobian = float(np.abs(np.asarray(target) - rate).max())
    else:
        gone = (task.error(ahead, target) - task.error(behind, target)) / (2.0 * step)
        jacobian = float(np.abs(gone + rate).max())
    stated = task.jacobian(here) @ acceleration + task.drift(here)
    found = task.jacobian(ahead) @ ahead.velocity - task.jacobian(behind) @ behind.velocity
    return DerivativeErrors(jacobian, float(np.abs(stated - found / (2.0 * step)).max()))


def check_contact(
    robot: Robot,
    contact: Contact,
    position: FloatArray,
    velocity: FloatArray,
    acceleration: FloatArray,
    *,
    step: float = 1e-5,
) -> float:
    """Return how far J qdd + dJ/dt v of a contact is from the central difference of J v."""
    bound, nv = contact.bind(robot), robot.model.nv
    frames = bound.frames(robot.model)
    at = _along(robot, position, velocity, acceleration, frames)
    here, ahead, behind = at(0.0), at(step), at(-step)
    jacobian, drift = np.zeros((bound.rows, nv)), np.zeros(bound.rows)
    bound.fill(ahead, jacobian, drift)
    found = jacobian @ ahead.velocity
    bound.fill(behind, jacobian, drift)
    found = (found - jacobian @ behind.velocity) / (2.0 * step)
    bound.fill(here, jacobian, drift)
    return float(np.abs(jacobian @ acceleration + drift - found).max())


def _along(
    robot: Robot,
    position: FloatArray,
    velocity: FloatArray,
    acceleration: FloatArray,
    frames: Sequence[pin.Frame] = (),
) -> Callable[[float], Kinematics]:
    """Return the kinematics at time t of the motion with constant acceleration through a state."""

    def at(time: float) -> Kinematics:
        moved = time * velocity + 0.5 * time**2 * acceleration
        q = pin.integrate(robot.model, position, moved)
        kinematics = Kinematics(robot, frames)
        kinematics.update(q, velocity + time * acceleration)
        return kinematics

    return at


@dataclass(frozen=True)
class TorqueLimitErrors:
    """How far the rows of a rotor torque limit are from what they stand for.

    Attributes:
        gradient: largest difference of N dtau_phi along a coordinate or a force, relative to the
            largest.
        bounds: of the bounds on N tau_phi [N m].
        beyond: how far a rotor that is driven as hard as allowed gets beyond the speed limit, as a
            share of it; 0 where the limit does not depend on speed.
    """

    gradient: float
    bounds: float
    beyond: float


def check_joint_limit(
    limit: JointLimit,
    position: FloatArray,
    velocity: FloatArray,
    *,
    step: float = 1e-3,
    duration: float = 2.0,
) -> float:
    """Return how far a joint that is driven as hard as its limit allows gets beyond its stops.

    The joints are driven up for `duration` with the greatest acceleration allowed, and down with
    the least, each from the given state; the limit keeps its promise if neither goes beyond.

    Args:
        limit: any joint limit, whose rows are one-degree joints.
        position, velocity: (nq,) and (nv,) to start from, within the limit.
        step, duration: of the motion [s].
    """
    beyond = 0.0
    for up in (True, False):
        q, v = position.copy(), velocity.copy()
        for _ in range(round(duration / step)):
            least, greatest = limit.bounds(q, v, step)
            a = greatest if up else least
            q[limit.position_rows] += step * v[limit.rows] + 0.5 * step**2 * a
            v[limit.rows] += step * a
            at = q[limit.position_rows]
            worst = np.maximum(at - limit.upper, limit.lower - at).max(initial=0.0)
            beyond = max(beyond, float(worst))
    return beyond


def check_torque_limit(
    robot: Robot,
    limit: RotorTorqueLimit,
    position: FloatArray,
    velocity: FloatArray,
    acceleration: FloatArray,
    *,
    contacts: Sequence[PointContact] = (),
    step: float = 1e-6,
) -> TorqueLimitErrors:
    """Return how far the torque rows of a tick are from inverse dynamics through the gears.

    A controller wants an acceleration of the driven joints. The rows of its program, C x within
    bounds, are held against the rotor torques of inverse dynamics (`wbc.dynamics.rotor_torque`, as
    for logs) at its solution: their gradient against central differences, their bounds against
    what the limit says at these speeds.

    Args:
        robot: the robot, every motor turning at `velocity`; a tick must be solvable.
        limit: any rotor torque limit.
        position, velocity, acceleration: (nq,), (nv,), (nv,).
        contacts: that carry the robot.
        step: of the differences [rad/s^2, and tenths of the weight].

    Raises:
        ControlError: the tick has no solution.
    """
    gears, nv = robot.transmission, robot.model.nv
    bound = [contact.bind(robot) for contact in contacts]
    task = PostureTask.of(robot, stiffness=0.0, damping=0.0)
    certain = SpeedBlend(full_speed=1e-9, correction=0.0, trusted_error=0.0)
    settings = ControllerSettings(speed_blend=certain, warm_start=WarmStart.SOLVER)
    controller = Controller(robot, [task], contacts, [limit], settings)
    rest = position[robot.actuated_position]
    wanted = Reference(rest, None, acceleration[robot.actuated])
    for _ in range(2):  # rows that do not bind stand in the directions of the last tick
        command = controller.step(Motion(position, velocity), {task.name: wanted})
    problem = controller.problem
    if not command.status.usable or command.solution is None or problem is None:
        raise ControlError(f"the tick to check has no solution: {command.message}")
    weight = sum(inertia.mass for inertia in robot.model.inertias)
    weight *= float(np.linalg.norm(robot.model.gravity.linear))

    def reflected(x: FloatArray) -> FloatArray:
        forces, at = {}, nv
        for contact in bound:
            own = 0.1 * weight * x[at : at + contact.rows]
            forces[contact.contact.name] = contact.wrench(own)[None]
            at += contact.rows
        motion = Motion(position[None], velocity[None], x[None, :nv])
        pushed = contact_torque(robot, position[None], forces)
        needed, _ = rotor_torque(robot, motion, link_torque(robot, motion), pushed)
        return np.asarray(gears.gear_ratio * needed[0])

    limited = np.flatnonzero(np.isfinite(gears.torque_limit))
    x, rows = command.solution.x, problem.C[: len(limited)]
    moves = step * np.eye(len(x))
    found = np.array([reflected(x + move) - reflected(x - move) for move in moves])
    gradient = found[:, limited].T / (2.0 * step) - rows
    speed = gears.gear_ratio * (gears.motor_from_joint @ velocity[robot.actuated])
    low, high = (gears.gear_ratio * end for end in limit.bounds(robot, speed))
    offset = reflected(x)[limited] - rows @ x
    ends = [np.minimum(low, high)[limited] - offset, np.maximum(low, high)[limited] - offset]
    stated = [problem.lower[: len(limited)], problem.upper[: len(limited)]]
    return TorqueLimitErrors(
        float(np.abs(gradient).max() / np.abs(rows).max()),
        float(np.abs(np.subtract(ends, stated)).max()),
        0.0 if limit.is_constant else _beyond_top_speed(robot, limit),
    )


def _beyond_top_speed(robot: Robot, limit: RotorTorqueLimit) -> float:
    """Return how far rotors get beyond their speed limit either way, as a share of it."""
    gears = robot.transmission
    top = np.where(np.isfinite(gears.speed_limit), gears.speed_limit, 1.0)
    # So light that two hundred steps of full torque would reach the speed limit.
    pace, beyond = 0.005 * top / gears.torque_limit, 0.0
    for up in (True, False):
        speed = np.zeros(gears.size)
        for _ in range(4000):
            low, high = limit.bounds(robot, speed)
            speed = speed + pace * (high if up else low)
        over = np.where(np.isfinite(gears.speed_limit), np.abs(speed) / top - 1.0, 0.0)
        beyond = max(beyond, float(over.max()))
    return beyond
