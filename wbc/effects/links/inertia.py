"""Spatial inertia of a link as its ten parameters, in which masses simply add."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.errors import EffectError
from wbc.robot import Robot


def point_mass(mass: float, point: FloatArray) -> FloatArray:
    """Return the ten parameters of a point mass, pinocchio's order.

    The order is [m, m c, Ixx, Ixy, Iyy, Ixz, Iyz, Izz], moments about the frame's origin.

    Args:
        mass: [kg].
        point: (3,) [m] in the frame.
    """
    x, y, z = point
    about_origin = [y * y + z * z, -x * y, x * x + z * z, -x * z, -y * z, x * x + y * y]
    return mass * np.array([1.0, x, y, z, *about_origin])


def add_point_mass(inertia: pin.Inertia, mass: float, point: FloatArray) -> pin.Inertia:
    """Return `inertia` with a point mass added (a negative one taken away)."""
    return pin.Inertia.FromDynamicParameters(
        inertia.toDynamicParameters() + point_mass(mass, point)
    )


def with_shifted_center(inertia: pin.Inertia, shift: FloatArray) -> pin.Inertia:
    """Return `inertia` with its centre of mass moved by `shift` (3,) [m], moments about it kept."""
    old, new = inertia.lever, inertia.lever + shift
    about_origin = inertia.mass * (_steiner(new) - _steiner(old))
    parameters = np.array(inertia.toDynamicParameters())
    parameters[1:4] = inertia.mass * new
    parameters[4:] += about_origin[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]
    return pin.Inertia.FromDynamicParameters(parameters)


def require_physical(before: pin.Inertia, after: pin.Inertia, place: str) -> pin.Inertia:
    """Return `after` if some distribution of positive mass has these parameters.

    That is so where the pseudo-inertia (4, 4) is positive semidefinite (Wensing, Kim & Slotine,
    2018). A drawing that was not physical to begin with must not become less so.

    Raises:
        EffectError: no body could have this inertia.
    """
    least = min(_smallest(before), 0.0)
    if _smallest(after) < least - 1e-9 * max(abs(after.mass), 1.0):
        raise EffectError(f"the change at '{place}' leaves an inertia that no body can have.")
    return after


def _smallest(inertia: pin.Inertia) -> float:
    pseudo = pin.PseudoInertia.FromDynamicParameters(inertia.toDynamicParameters())
    return float(np.linalg.eigvalsh(pseudo.toMatrix())[0])


def _steiner(point: FloatArray) -> FloatArray:
    """Return |p|^2 1 - p p' (3, 3)."""
    return np.asarray(point @ point * np.eye(3) - np.outer(point, point))


def reach(robot: Robot, joint: int) -> float:
    """Return how far [m] a link is known to reach from its joint, or from its centre of mass.

    To the joints and contact points that it carries, to its drawn centre of mass, and by two radii
    of gyration about that.

    Args:
        robot: as drawn.
        joint: of the model, which moves the link.
    """
    model = robot.model
    inertia = model.inertias[joint]
    carried = [
        model.jointPlacements[child].translation
        for child in range(1, model.njoints)
        if model.parents[child] == joint
    ]
    for contact in robot.contacts:
        frame = model.frames[model.getFrameId(contact.frame)]
        if frame.parentJoint == joint:
            carried.append(frame.placement.act(np.asarray(contact.offset)))
    sizes = [float(np.linalg.norm(point)) for point in (*carried, inertia.lever)]
    if inertia.mass > 0.0:
        about_center = max(float(np.trace(inertia.inertia)), 0.0)  # of a point: 0, but for rounding
        sizes.append(2.0 * float(np.sqrt(0.5 * about_center / inertia.mass)))
    return max(sizes)
