"""Balls and blocks as robots without joints."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc import Robot
from wbc.robot import ContactPoint
from wbc.transmission import Transmission


def free_body(mass, inertia, contacts):
    """Return a free body; contacts are (offset, friction, radius)."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
    body = pin.Inertia(mass, np.zeros(3), np.diag(np.broadcast_to(inertia, 3)))
    model.appendBodyToJoint(joint, body, pin.SE3.Identity())
    model.addBodyFrame("body", joint, pin.SE3.Identity(), 0)
    points = [
        ContactPoint(f"point_{i}", "body", np.array(offset, dtype=float), friction, radius)
        for i, (offset, friction, radius) in enumerate(contacts)
    ]
    return Robot("body", model, Transmission((), np.zeros(0), np.zeros(0)), tuple(points))


def ball(radius=0.1, mass=1.0, friction=0.8):
    """Return a uniform ball that touches and rolls with all of its surface."""
    return free_body(mass, 0.4 * mass * radius**2, [(np.zeros(3), friction, radius)])


def block(half=(0.2, 0.2, 0.05), mass=10.0, friction=0.4):
    """Return a uniform block on the four corners of its lower face."""
    x, y, z = half
    inertia = mass / 3.0 * np.array([y * y + z * z, x * x + z * z, x * x + y * y])
    feet = [((a * x, b * y, -z), friction, 0.0) for a in (-1, 1) for b in (-1, 1)]
    return free_body(mass, inertia, feet)


def at(position, rotation=None):
    """Return q (7,) of a free body."""
    turn = np.eye(3) if rotation is None else rotation
    return np.concatenate([position, pin.Quaternion(np.array(turn)).coeffs()])


def world_velocity(state):
    """Return linear (3,) and angular (3,) velocity in world axes of a free body's state."""
    turn = pin.Quaternion(np.array(state.position[3:7])).matrix()
    return turn @ state.velocity[:3], turn @ state.velocity[3:6]
