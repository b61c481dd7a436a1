"""Inertia, gravity and contact Jacobian of many designs: kinematics with the designs as an axis.

A link's inertia enters the mass matrix as H = sum m Jc'Jc + Jw'(R I R')Jw with the Jacobians of its
centre of mass and of its rotation. Every array has a leading axis of k designs, or of 1 as long as
nothing that it depends on varies, so that a sweep of the gears alone computes the links once.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.errors import DynamicsError
from wbc.metrics.designs import Designs
from wbc.robot import Robot


@dataclass(frozen=True, eq=False)
class LinkTerms:
    """What the links of each design weigh and how its contact point moves, at rest.

    Attributes:
        mass_matrix: H_l (k or 1, nv, nv), rotors not in it.
        gravity: torque of gravity on the left of the equation of motion (k or 1, nv).
        jacobian: (k or 1, 3, nv), velocity of the contact point, world axes.
        mass: (k or 1,) [kg], of the whole robot.
    """

    mass_matrix: FloatArray
    gravity: FloatArray
    jacobian: FloatArray
    mass: FloatArray


@dataclass(frozen=True, eq=False)
class _Placed:
    """Rotation (k, 3, 3) and origin (k, 3) of every joint, and its axes in the world.

    `linear` and `angular` (k, 3, n) are the joint's motion subspace, turned into world axes.
    """

    rotation: list[FloatArray]
    origin: list[FloatArray]
    linear: list[FloatArray]
    angular: list[FloatArray]


def link_terms(designs: Designs, contact: str) -> LinkTerms:
    """Return the terms of the links for every design.

    Raises:
        DynamicsError: a joint that is neither revolute, prismatic nor a free-flyer.
        RobotError: no such contact.
    """
    model = designs.robot.model
    placed = _place(designs)
    support = _supports(model)
    H, g = np.zeros((1, model.nv, model.nv)), np.zeros((1, model.nv))
    total = np.zeros(1)
    for joint in range(1, model.njoints):
        body = model.inertias[joint]
        if body.mass == 0.0 and not np.any(body.inertia):
            continue
        length = designs.length_scale[:, joint - 1]
        mass = body.mass * designs.mass_scale[:, joint - 1]
        lever = length[:, None] * np.asarray(body.lever)
        about = (designs.mass_scale[:, joint - 1] * length**2)[:, None, None] * np.asarray(
            body.inertia
        )
        R = placed.rotation[joint]
        center = placed.origin[joint] + np.einsum("kij,kj->ki", *_wide(R, lever))
        Jv, Jw = _jacobians(placed, model, support[joint], center)
        turned = R @ about @ np.swapaxes(R, 1, 2)
        added = (
            mass[:, None, None] * (np.swapaxes(Jv, 1, 2) @ Jv) + np.swapaxes(Jw, 1, 2) @ turned @ Jw
        )
        columns = _columns(model, support[joint])
        H = _grown(H, len(added))
        H[np.ix_(range(len(H)), columns, columns)] += added
        weight = -mass[:, None] * (np.asarray(model.gravity.linear) @ Jv)
        g = _grown(g, len(weight))
        g[:, columns] += weight
        total = total + mass
    return LinkTerms(H, g, _contact_jacobian(designs, placed, support, contact), total)


def _contact_jacobian(
    designs: Designs, placed: _Placed, support: list[list[int]], contact: str
) -> FloatArray:
    robot, model = designs.robot, designs.robot.model
    point = robot.contact(contact)
    frame = model.frames[model.getFrameId(point.frame)]
    joint = int(frame.parentJoint)
    if joint == 0:
        return np.zeros((1, 3, model.nv))
    offset = np.asarray((frame.placement * point.placement()).translation)
    offsets = designs.length_scale[:, joint - 1, None] * offset
    place = placed.origin[joint] + np.einsum("kij,kj->ki", *_wide(placed.rotation[joint], offsets))
    Jv, _ = _jacobians(placed, model, support[joint], place)
    jacobian = np.zeros((len(Jv), 3, model.nv))
    jacobian[:, :, _columns(model, support[joint])] = Jv
    return jacobian


def _place(designs: Designs) -> _Placed:
    model, q = designs.robot.model, designs.position
    rotation, origin = [np.eye(3)[None]], [np.zeros((1, 3))]
    linear, angular = [np.zeros((1, 3, 0))], [np.zeros((1, 3, 0))]
    for joint in range(1, model.njoints):
        parent, place = int(model.parents[joint]), model.jointPlacements[joint]
        scale = designs.length_scale[:, parent - 1, None] if parent > 0 else np.ones((1, 1))
        moved = scale * np.asarray(place.translation)
        R = rotation[parent] @ np.asarray(place.rotation)
        p = origin[parent] + np.einsum("kij,kj->ki", *_wide(rotation[parent], moved))
        own, shift, v, w = _motion(designs.robot, joint, q)
        p = p + np.einsum("kij,kj->ki", *_wide(R, shift))
        R = R @ own
        rotation.append(R)
        origin.append(p)
        linear.append(R @ v)
        angular.append(R @ w)
    return _Placed(rotation, origin, linear, angular)


def _motion(
    robot: Robot, joint: int, q: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return rotation (k, 3, 3), shift (k, 3) and subspace (3, n), (3, n) of one joint."""
    kind: Any = robot.model.joints[joint]
    data = kind.createData()
    kind.calc(data, robot.neutral())
    subspace = np.asarray(data.S).reshape(6, -1)
    v, w = subspace[:3], subspace[3:]
    here = q[:, kind.idx_q : kind.idx_q + kind.nq]
    if kind.shortname() == "JointModelFreeFlyer":
        turn = np.array(
            [pin.Quaternion(row[3:] / np.linalg.norm(row[3:])).matrix() for row in here]
        )
        return turn, here[:, :3], v, w
    if kind.nq != 1 or kind.nv != 1 or (np.any(v) and np.any(w)):
        raise DynamicsError(
            f"joint '{robot.model.names[joint]}' ({kind.shortname()}) is neither revolute, "
            "prismatic nor a free-flyer; evaluate its designs one by one."
        )
    if np.any(v):
        return np.eye(3)[None], here * v[:, 0], v, w
    x, y, z = w[:, 0]
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angle = here[:, :, None]
    turn = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * (cross @ cross)
    return turn, np.zeros((1, 3)), v, w


def _jacobians(
    placed: _Placed, model: pin.Model, support: list[int], point: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return linear and angular Jacobian (k, 3, n) of a point over its supporting joints."""
    linear, angular = [], []
    for joint in support:
        arm = (point - placed.origin[joint])[:, :, None]
        w = placed.angular[joint]
        linear.append(placed.linear[joint] + np.cross(w, arm, axis=1))
        angular.append(w)
    k = max(len(part) for part in (*linear, *angular))
    wide = [np.broadcast_to(part, (k, *part.shape[1:])) for part in linear]
    turn = [np.broadcast_to(part, (k, *part.shape[1:])) for part in angular]
    return np.concatenate(wide, axis=2), np.concatenate(turn, axis=2)


def _supports(model: pin.Model) -> list[list[int]]:
    """Return per joint the joints from the root to it."""
    chains: list[list[int]] = [[]]
    for joint in range(1, model.njoints):
        chains.append([*chains[int(model.parents[joint])], joint])
    return chains


def _columns(model: pin.Model, support: list[int]) -> list[int]:
    return [
        column
        for joint in support
        for column in range(
            model.joints[joint].idx_v, model.joints[joint].idx_v + model.joints[joint].nv
        )
    ]


def _wide(matrices: FloatArray, vectors: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return both with the same leading axis."""
    k = max(len(matrices), len(vectors))
    return (
        np.broadcast_to(matrices, (k, *matrices.shape[1:])),
        np.broadcast_to(vectors, (k, *vectors.shape[1:])),
    )


def _grown(values: FloatArray, k: int) -> FloatArray:
    return values if len(values) >= k else np.repeat(values, k, axis=0)
