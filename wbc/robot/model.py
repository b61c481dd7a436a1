"""What a robot is made of beside its gears: contact points, mounted rotors, sound bodies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray, IntArray, Remade, checked, frozen
from wbc.errors import RobotError, unknown_name
from wbc.transmission import Transmission


@dataclass(frozen=True, eq=False)
class ContactPoint(Remade):
    """A point fixed to a link that may touch the ground, or the centre of a ball that does.

    Attributes:
        name: how logs and controllers call it.
        frame: name of a frame of the pinocchio model.
        offset: (3,) [m] of the point in that frame.
        friction: Coulomb coefficient mu assumed between point and ground.
        radius: [m] of a ball around the point that touches in its stead and rolls; 0 for a point.
    """

    name: str
    frame: str
    offset: FloatArray
    friction: float = 0.7
    radius: float = 0.0

    def __post_init__(self) -> None:
        """Check and freeze."""
        label = f"offset of contact '{self.name}'"
        object.__setattr__(self, "offset", checked(self.offset, (3,), label, RobotError))
        if not self.friction >= 0.0:
            raise RobotError(f"contact '{self.name}': friction must be >= 0, got {self.friction}.")
        if not 0.0 <= self.radius < np.inf:
            raise RobotError(f"contact '{self.name}': radius must be >= 0, got {self.radius}.")

    def placement(self) -> pin.SE3:
        """Return the placement of the point in its frame."""
        return pin.SE3(pin.SE3.Identity().rotation, self.offset)


@dataclass(frozen=True, eq=False)
class FreeBody:
    """A uniform solid that moves freely beside a robot: a box to grasp, a stone to stand on.

    Attributes:
        name: of its joint and its link.
        shape: a `coal.Sphere`, `Capsule`, `Box`, `Cylinder` or convex mesh.
        mass: [kg].
    """

    name: str
    shape: Any
    mass: float

    def inertia(self) -> pin.Inertia:
        """Return mass, centre and inertia about it.

        Raises:
            RobotError: a mass or a volume that is not positive.
        """
        volume = float(self.shape.computeVolume())
        if not (self.mass > 0.0 and volume > 0.0):
            raise RobotError(
                f"free body '{self.name}': mass and volume must be positive, got {self.mass} kg "
                f"and {volume} m^3."
            )
        turning = np.asarray(self.shape.computeMomentofInertiaRelatedToCOM())
        return pin.Inertia(self.mass, self.shape.computeCOM(), self.mass / volume * turning)


@dataclass(frozen=True, eq=False)
class LinkSolid:
    """Collision geometry of a link beside that of the model file.

    Attributes:
        link: name of a frame of the pinocchio model; also that of the solid.
        shape: a `coal.Sphere`, `Capsule`, `Box`, `Cylinder` or convex mesh, in the frame's axes.
    """

    link: str
    shape: Any


@dataclass(frozen=True)
class BodySurface:
    """How the links of a robot touch the ground beside its contacts (`body_surfaces`).

    Attributes:
        links: names of the bodies that may touch, None for all.
        friction: Coulomb coefficient between them and the ground.
        depth: [m] that a mesh may sink into flat ground between its points.
        pairs: of bodies that touch each other, too; none without.
        solids: beside those of the model file; free bodies have one (`Robot.with_free_bodies`).
    """

    links: tuple[str, ...] | None = None
    friction: float = 0.7
    depth: float = 0.02
    pairs: tuple[tuple[str, str], ...] = ()
    solids: tuple[LinkSolid, ...] = ()

    def __post_init__(self) -> None:
        """Check the ranges."""
        if not self.friction >= 0.0:
            raise RobotError(f"bodies: friction must be >= 0, got {self.friction}.")
        if not self.depth > 0.0:
            raise RobotError(f"bodies: depth must be positive, got {self.depth}.")


@dataclass(frozen=True, eq=False)
class RotorMounting:
    """The housings of the m rotors.

    Attributes:
        housing: (m,) number of the joint that moves the link carrying each motor; 0 is the world.
        axis: (m, 3) unit vector of each rotor's spin, in the frame of its housing's joint.
    """

    housing: IntArray
    axis: FloatArray


def rotor_mounting(model: pin.Model, transmission: Transmission) -> RotorMounting:
    """Return where the rotors sit.

    A motor sits on the link that the transmission names, else on the link before its joint, and
    spins about the joint's axis (along the slide for a prismatic joint) as it lies in the neutral
    configuration.

    Raises:
        RobotError: a housing that is no link of the model.
    """
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    housings, axes = [], []
    links = transmission.housings or ("",) * transmission.size
    for joint, link in zip(transmission.joints, links, strict=True):
        number = model.getJointId(joint)
        housing = _joint_of(model, joint, link) if link else model.parents[number]
        subspace = np.asarray(data.joints[number].S).reshape(6, -1)[:, 0]
        axis = data.oMi[number].rotation @ (subspace[3:] + subspace[:3])
        housings.append(int(housing))
        axes.append(data.oMi[housing].rotation.T @ axis)
    return RotorMounting(frozen(housings, np.int_), frozen(np.reshape(axes, (-1, 3))))


def _joint_of(model: pin.Model, joint: str, link: str) -> int:
    if not model.existBodyName(link):
        known = [f.name for f in model.frames if f.type == pin.FrameType.BODY]
        raise RobotError(f"housing of the motor of '{joint}': " + unknown_name("link", link, known))
    return int(model.frames[model.getBodyId(link)].parentJoint)


def require_sound(name: str, model: pin.Model, contacts: Sequence[ContactPoint]) -> None:
    """Check a robot's links and contacts.

    Args:
        name: of the robot, for messages.
        model: of its links.
        contacts: its contact points.

    Raises:
        RobotError: two contacts of one name, or one at no frame; joints whose inertia matrix
            pinocchio would get wrong; rotor inertias in the model, which would count twice.
    """
    names = [contact.name for contact in contacts]
    if len(set(names)) != len(names):
        raise RobotError(f"'{name}' has two contacts of one name: {', '.join(names)}.")
    for contact in contacts:
        if not model.existFrame(contact.frame):  # a list of all frames for each robot takes time
            known = [frame.name for frame in model.frames]
            place = f"contact '{contact.name}': "
            raise RobotError(place + unknown_name(f"frame of '{name}'", contact.frame, known))
    if not _depth_first(model):
        raise RobotError(
            f"the joints of '{name}' are not in depth-first order: pinocchio's inertia "
            "matrix would be wrong without a word. Add each subtree's joints in one go, as the "
            "URDF and MJCF loaders do."
        )
    if np.any(np.abs(np.asarray(model.armature)) > 0.0):
        raise RobotError(
            f"the model of '{name}' carries armature; put rotor inertias into the "
            "transmission instead (they would count twice)."
        )


def _depth_first(model: pin.Model) -> bool:
    """Return whether every joint's parent is the joint before it or one of that one's ancestors."""
    chain = [0]
    for number in range(1, model.njoints):
        parent = int(model.parents[number])
        if parent not in chain:
            return False
        del chain[chain.index(parent) + 1 :]
        chain.append(number)
    return True
