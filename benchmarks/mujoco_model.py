"""A robot of this library as a MuJoCo model: same links, rotors as armature, point feet."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
import pinocchio as pin

from wbc import Robot


def mujoco_model(
    robot: Robot, step: float, slabs: Sequence[tuple[float, float]] = ()
) -> mujoco.MjModel:
    """Return the MuJoCo model of a robot, with joints in the same order.

    The ground is flat but for slabs: (x where one begins, its height) [m], 10 m long.
    """
    spec = mujoco.MjSpec()
    spec.compiler.balanceinertia = True
    spec.option.timestep = step
    spec.option.gravity = np.array(robot.model.gravity.linear)
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[50, 50, 1])
    for edge, height in slabs:
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=[edge + 5.0, 0.0, 0.5 * height],
            size=[5.0, 5.0, 0.5 * height],
        )
    model, bodies = robot.model, {0: spec.worldbody}
    armature = dict(
        zip(robot.transmission.joints, robot.transmission.reflected_inertia, strict=True)
    )
    for number in range(1, model.njoints):
        joint, place = model.joints[number], model.jointPlacements[number]
        body = bodies[model.parents[number]].add_body(
            pos=place.translation, quat=_quaternion(place.rotation)
        )
        bodies[number] = body
        _add_joint(body, joint, model.names[number], armature.get(model.names[number], 0.0))
        _add_inertia(body, model.inertias[number])
    for contact in robot.contacts:
        frame = model.frames[model.getFrameId(contact.frame)]
        point = (frame.placement * contact.placement()).translation
        bodies[frame.parentJoint].add_geom(
            type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[1e-3, 0, 0], pos=point, mass=0.0
        )
    return spec.compile()


def _quaternion(rotation: np.ndarray) -> np.ndarray:
    x, y, z, w = pin.Quaternion(rotation).coeffs()
    return np.array([w, x, y, z])


def _add_joint(body: mujoco.MjsBody, joint: pin.JointModel, name: str, armature: float) -> None:
    if joint.shortname() == "JointModelFreeFlyer":
        body.add_freejoint(name=name)
        return
    data = joint.createData()
    joint.calc(data, np.zeros(joint.nq))
    subspace = np.asarray(data.S).reshape(6, -1)[:, 0]
    slides = np.linalg.norm(subspace[:3]) > 0.5
    kind = mujoco.mjtJoint.mjJNT_SLIDE if slides else mujoco.mjtJoint.mjJNT_HINGE
    axis = subspace[:3] if slides else subspace[3:]
    body.add_joint(name=name, type=kind, axis=axis, armature=armature)


def _add_inertia(body: mujoco.MjsBody, inertia: pin.Inertia) -> None:
    body.mass = max(inertia.mass, 1e-6)
    body.ipos = inertia.lever
    moments, axes = np.linalg.eigh(inertia.inertia)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    moments = np.maximum(moments, 1e-8)
    body.inertia, body.iquat = moments, _quaternion(axes)
    body.explicitinertial = True
