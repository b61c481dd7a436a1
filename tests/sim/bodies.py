"""Free bodies with contact points, balls or collision geometry, and runs that watch them."""

from itertools import product

import coal
import numpy as np
import pinocchio as pin

from wbc import Robot
from wbc.robot import ContactPoint, FreeBody, bare_robot
from wbc.sim import Plant, SimState, Terrain
from wbc.transmission import Transmission


def free_body(inertia: pin.Inertia, contacts: tuple[ContactPoint, ...] = ()) -> Robot:
    """A body on a free flyer, with a frame 'body' at its base."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
    model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    model.addFrame(pin.Frame("body", joint, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    return Robot("body", model, Transmission((), np.zeros(0), np.zeros(0)), contacts)


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


def one_joint(joint: object, body: pin.Inertia, **gears: float) -> Robot:
    """One link behind one gear of these numbers."""
    model = pin.Model()
    number = model.addJoint(0, joint, pin.SE3.Identity(), "joint")
    model.appendBodyToJoint(number, body, pin.SE3.Identity())
    numbers = {name: np.array([value]) for name, value in gears.items()}
    return Robot("one joint", model, Transmission(("joint",), **numbers))


def free(*bodies: FreeBody, pairs: tuple[tuple[str, str], ...] = ()) -> Robot:
    return bare_robot(pin.Model()).with_free_bodies(*bodies, pairs=pairs)


def solid(shape: coal.CollisionGeometry, terrain: Terrain, mass: float = 2.0) -> Plant:
    """One free solid on a ground."""
    return Plant(free(FreeBody("body", shape, mass)), terrain)


def hull_of(points: np.ndarray) -> coal.CollisionGeometry:
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(len(points) // 3, len(points))
    mesh.addVertices(points)
    mesh.endModel()
    mesh.buildConvexHull(True, "Qt")
    return mesh.convex


def placed(*places: tuple[list[float], list[float]]) -> np.ndarray:
    """Return q of free bodies at places, turned by roll, pitch, yaw."""
    turns = [pin.Quaternion(pin.rpy.rpyToMatrix(*turn)).coeffs() for _, turn in places]
    return np.concatenate([np.r_[p, t] for (p, _), t in zip(places, turns, strict=True)])


def watched(
    plant: Plant,
    state: SimState,
    duration: float,
    gain: float = 1e-5,
    said: tuple = ("coarse",),
    step: float = 1e-3,
    parts: int = 5,
) -> tuple[SimState, float]:
    """Run a plant without torques until it rests; return the end, and how deep it was.

    No step makes more than the share `gain` of the first energy, the step's own error: turning is
    of second order. Events are of the kinds `said`.
    """
    deepest, torque = 0.0, np.zeros(plant.robot.transmission.size)
    energy = total = plant.mechanical_energy(state)
    for _ in range(round(duration / step)):
        result = plant.step(state, torque, step)
        state, after = result.state, plant.mechanical_energy(result.state)
        assert after < energy + gain * abs(total) + 1e-12
        assert {event.kind for event in result.events} <= set(said)
        assert len(result.parts) <= parts  # no chatter
        energy = after
        gaps = [plant.gaps(state).min(initial=0.0), plant.pair_gaps(state).min(initial=0.0)]
        deepest = min(deepest, *gaps)
        if np.abs(state.velocity).max() < 1e-9:
            break
    return state, deepest
