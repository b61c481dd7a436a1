"""Single free bodies with contact points or balls, for the textbook's tests."""

from __future__ import annotations

from itertools import product

import numpy as np
import pinocchio as pin

from wbc import Robot
from wbc.robot import ContactPoint
from wbc.transmission import Transmission


def no_gears() -> Transmission:
    return Transmission((), np.zeros(0), np.zeros(0))


def free_body(inertia: pin.Inertia, contacts: tuple[ContactPoint, ...] = ()) -> Robot:
    """A body on a free flyer, with a frame 'body' at its base."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
    model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    model.addFrame(pin.Frame("body", joint, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    return Robot("body", model, no_gears(), contacts)


def block(size: tuple[float, float, float], friction: float, mass: float = 1.0) -> Robot:
    """A block that touches with its eight corners."""
    half = 0.5 * np.array(size)
    corners = tuple(
        ContactPoint(f"corner{i}", "body", half * signs, friction)
        for i, signs in enumerate(product((-1.0, 1.0), repeat=3))
    )
    return free_body(pin.Inertia.FromBox(mass, *size), corners)


def ball(radius: float, friction: float, mass: float = 1.0) -> Robot:
    """A ball that touches with its surface."""
    contact = ContactPoint("surface", "body", np.zeros(3), friction, radius)
    return free_body(pin.Inertia.FromSphere(mass, radius), (contact,))
