"""Robots of `example-robot-data` that this project does not ship, with gears that are assumed.

Every gear has a ratio of 10 on legs and 100 on arms, a rotor of 2e-5 and 1e-5 kg m^2, and keeps
85 % of the torque when the motor drives and 80 % when the joint does. Torque limits are those of
the URDF files.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.control import (
    CenterOfMassTask,
    Contact,
    FrameOrientationTask,
    FramePoseTask,
    PointContact,
    PostureTask,
    SurfaceContact,
    Task,
)
from wbc.robot import ContactPoint, Robot
from wbc.transmission import Transmission

SHARE = Path(pin.__file__).parents[4] / "share"
FOLDER = SHARE / "example-robot-data" / "robots"
CORNERS = [(-0.05, 0.025), (-0.05, -0.025), (0.12, 0.03), (0.12, -0.03)]  # of G1's sole, its URDF
LEGS = ("lf", "lh", "rf", "rh")


@dataclass(frozen=True)
class Foreign:
    """A robot in the pose from which the checks start.

    Attributes:
        robot: links and gears.
        pose: q (nq,).
        hand: a frame at the end of an arm or a leg that is free to move.
        other: another frame, for distances.
        standing: contacts.
        free: name of the contact that must go for `hand` to be free, None where there is none.
        trunk: frame of the trunk, None for an arm.
    """

    robot: Robot
    pose: FloatArray
    hand: str
    other: str
    standing: tuple[Contact, ...]
    free: str | None
    trunk: str | None

    def solids(self) -> pin.GeometryModel:
        """Return the solids of the URDF, with pairs of links three or more joints apart."""
        model, path = self.robot.model, str(urdf(self.robot.name))
        kind = pin.GeometryType.COLLISION
        found = pin.buildGeomFromUrdf(model, path, kind, package_dirs=str(SHARE))
        joints = [solid.parentJoint for solid in found.geometryObjects]
        for i, one in enumerate(joints):
            for j, other in enumerate(joints[:i]):
                if len(_path(model, one) ^ _path(model, other)) > _NEAR:
                    found.addCollisionPair(pin.CollisionPair(j, i))
        return found

    def tasks(self) -> list[Task]:
        """Return what the robot is usually asked to do."""
        posture = PostureTask.of(self.robot, weight=0.1, stiffness=50.0)
        if self.trunk is None:
            return [FramePoseTask(name="pose", frame=self.hand, weight=10.0), posture]
        trunk = FrameOrientationTask(name="trunk", frame=self.trunk, weight=1.0)
        return [CenterOfMassTask(weight=10.0), trunk, posture]


def hyq() -> Foreign:
    """Return IIT's hydraulic quadruped, 87 kg."""
    joints = {}
    for leg in LEGS:
        ahead = 1.0 if leg[1] == "f" else -1.0
        joints |= {
            f"{leg}_haa_joint": -0.2,
            f"{leg}_hfe_joint": 0.75 * ahead,
            f"{leg}_kfe_joint": -1.5 * ahead,
        }
    feet = [ContactPoint(name=leg, frame=f"{leg}_foot", offset=np.zeros(3)) for leg in LEGS]
    robot = _made("hyq", "hyq_description/robots/hyq_no_sensors.urdf", feet)
    return _quadruped(robot, joints, "trunk", "lf_foot", "rh_foot")


def go2() -> Foreign:
    """Return Unitree's quadruped, 15 kg."""
    joints = {}
    for leg in ("FL", "FR", "RL", "RR"):
        side = 0.068 if leg[1] == "L" else -0.068
        joints |= {
            f"{leg}_hip_joint": side,
            f"{leg}_thigh_joint": 0.785,
            f"{leg}_calf_joint": -1.44,
        }
    feet = [
        ContactPoint(name=leg, frame=f"{leg}_foot", offset=np.zeros(3))
        for leg in ("FL", "FR", "RL", "RR")
    ]
    robot = _made("go2", "go2_description/urdf/go2.urdf", feet)
    return _quadruped(robot, joints, "base", "FL_foot", "RR_foot")


def g1() -> Foreign:
    """Return Unitree's humanoid, 33 kg, with a sole of four corners under each foot."""
    joints = {}
    for side in ("left", "right"):
        joints |= {
            f"{side}_hip_pitch_joint": -0.3,
            f"{side}_knee_joint": 0.6,
            f"{side}_ankle_pitch_joint": -0.3,
            f"{side}_elbow_joint": 0.8,
        }
    feet = [
        ContactPoint(
            name=f"{side}_{i}", frame=f"{side}_ankle_roll_link", offset=np.array([x, y, -0.035])
        )
        for side in ("left", "right")
        for i, (x, y) in enumerate(CORNERS)
    ]
    robot = _made("g1", "g1_description/urdf/g1_29dof_rev_1_0.urdf", feet)
    soles = tuple(
        SurfaceContact(name=side, corners=tuple(f"{side}_{i}" for i in range(4)))
        for side in ("left", "right")
    )
    pose = _on_the_ground(robot, _posed(robot, joints))
    hands = "left_wrist_yaw_link", "right_wrist_yaw_link"
    return Foreign(robot, pose, *hands, soles, None, "torso_link")


def panda() -> Foreign:
    """Return Franka's arm of seven joints; its fingers are locked."""
    robot = _made("panda", "panda_description/urdf/panda.urdf", [], ("panda_finger",))
    angles = (0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785)
    joints = {f"panda_joint{i + 1}": angle for i, angle in enumerate(angles)}
    return Foreign(robot, _posed(robot, joints), "panda_hand", "panda_link0", (), None, None)


def tiago() -> Foreign:
    """Return PAL's arm on a lift, ten joints; its wheels are locked."""
    robot = _made("tiago", "tiago_description/robots/tiago_no_hand.urdf", [], ("wheel",))
    angles = (0.2, -0.6, -0.4, 1.6, 0.3, -0.4, 0.2)
    joints = {f"arm_{i + 1}_joint": angle for i, angle in enumerate(angles)}
    pose = _posed(robot, joints | {"torso_lift_joint": 0.15})
    return Foreign(robot, pose, "arm_7_link", "torso_lift_link", (), None, None)


_NEAR = 2  # joints between two links that may overlap


def _path(model: pin.Model, joint: int) -> set[int]:
    """Return the joints between a link and the root."""
    found = set()
    while joint > 0:
        found.add(joint)
        joint = model.parents[joint]
    return found


ROBOTS = {made.__name__: made for made in (hyq, go2, g1, panda, tiago)}


def urdf(name: str) -> Path:
    """Return the file that a robot was made of."""
    return FOLDER / _FILES[name]


_FILES: dict[str, str] = {}


def _made(name: str, file: str, feet: list[ContactPoint], locked: tuple[str, ...] = ()) -> Robot:
    _FILES[name] = file
    path = str(FOLDER / file)
    model = pin.buildModelFromUrdf(path, pin.JointModelFreeFlyer()) if feet else None
    if model is None:
        model = pin.buildModelFromUrdf(path)
        numbers = [i for i, joint in enumerate(model.names) if joint.startswith(locked)]
        model = pin.buildReducedModel(model, numbers, pin.neutral(model))
    model.friction = model.damping = np.zeros(model.nv)
    joints = tuple(model.names)[2 if feet else 1 :]
    ratio, ones = (10.0 if feet else 100.0), np.ones(len(joints))
    gears = Transmission(
        joints=joints,
        gear_ratio=ratio * ones,
        rotor_inertia=(2e-5 if feet else 1e-5) * ones,
        forward_efficiency=0.85 * ones,
        backward_efficiency=0.8 * ones,
        torque_limit=np.array(model.effortLimit)[-len(joints) :] / ratio,
    )
    return Robot(name, model, gears, tuple(feet))


def _posed(robot: Robot, joints: dict[str, float]) -> FloatArray:
    q = np.array(robot.neutral())
    for joint, angle in joints.items():
        q[robot.position_index(joint)] = angle
    return q


def _on_the_ground(robot: Robot, q: FloatArray) -> FloatArray:
    """Return q with the lowest contact point at height 0."""
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    points = [
        data.oMf[robot.model.getFrameId(c.frame)].act(np.array(c.offset)) for c in robot.contacts
    ]
    lower = np.array(q)
    lower[2] -= min(point[2] for point in points)
    return lower


def _quadruped(
    robot: Robot, joints: dict[str, float], trunk: str, hand: str, other: str
) -> Foreign:
    pose = _leaning(robot, _on_the_ground(robot, _posed(robot, joints)), hand)
    feet = tuple(PointContact(name=contact.name) for contact in robot.contacts)
    return Foreign(robot, pose, hand, other, feet, hand.split("_")[0], trunk)


def _leaning(robot: Robot, q: FloatArray, lifted: str) -> FloatArray:
    """Return q with feet and trunk as they are, but the centre of mass above three of the feet.

    Gauss-Newton steps on feet, turning of the trunk and centre of mass.
    """
    model, data = robot.model, robot.model.createData()
    frames = [model.getFrameId(contact.frame) for contact in robot.contacts]
    pin.framesForwardKinematics(model, data, q)
    places = np.array([data.oMf[frame].translation for frame in frames])
    rest = [i for i, contact in enumerate(robot.contacts) if contact.frame != lifted]
    goal = np.array([*places[rest].mean(axis=0)[:2], pin.centerOfMass(model, data, q)[2]])
    for _ in range(10):
        com = pin.jacobianCenterOfMass(model, data, q)
        pin.framesForwardKinematics(model, data, q)
        rows, left = [com, np.eye(model.nv)[3:6]], [goal - data.com[0], np.zeros(3)]
        for frame, place in zip(frames, places, strict=True):
            rows.append(
                pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)[:3]
            )
            left.append(place - data.oMf[frame].translation)
        step = np.linalg.lstsq(np.vstack(rows), np.concatenate(left), rcond=None)[0]
        q = pin.integrate(model, q, step)
    return np.asarray(q)
