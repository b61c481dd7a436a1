"""Links that weigh, are balanced or touch the ground otherwise than drawn; where gravity leans."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import final

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.effects.link_inertias import USUAL, heavy_bodies, mass_left
from wbc.errors import EffectError
from wbc.robot import Effect, Motion, Robot, SearchOffer, Usual, number


def _payload_remarks(effect: PayloadMass, robot: Robot) -> tuple[str, ...]:
    """Say of a negative mass that it is drawn and not there."""
    if effect.mass >= 0.0:
        return ()
    joint, _ = effect._place(robot)
    return (mass_left(-effect.mass, robot.model.inertias[joint].mass, effect.where),)


@final
@dataclass(frozen=True)
class PayloadMass(Effect):
    """A point mass fixed to a body at its centre of mass, or to a contact point.

    Attributes:
        mass: [kg]; negative takes away.
    """

    mass: float = field(metadata=number("kg", 0.0, -1000.0, 1000.0, 0.3))

    explanation = "Something was mounted, filled or left out: a body is heavier or lighter."
    experiment = (
        "Hold still in several poses, then move fast: the extra torque follows gravity and "
        "inertia together, at one place of the chain."
    )
    search = SearchOffer(remarks=_payload_remarks)

    @classmethod
    def places(cls, robot: Robot) -> tuple[str, ...]:
        """Every body that has a mass, and every contact point."""
        return (*heavy_bodies(robot), *(contact.name for contact in robot.contacts))

    def _place(self, robot: Robot) -> tuple[int, FloatArray]:
        """Return the joint that moves the mass, and its point (3,) [m] in that joint's frame."""
        if self.where in robot.bodies:
            joint = robot.body_joint(self.where)
            return joint, robot.model.inertias[joint].lever
        return robot.contact_place(robot.contact(self.where))

    def change(self, robot: Robot) -> Robot:
        """Return the robot that carries the mass.

        Raises:
            EffectError: so much is taken away that no body is left that can exist.
        """
        if self.mass == 0.0:
            return robot
        joint, point = self._place(robot)
        before = robot.model.inertias[joint]
        if before.mass + self.mass <= 0.0:
            raise EffectError(
                f"payload of {self.mass:g} kg at '{self.where}' leaves no mass there "
                f"(the body has {before.mass:g} kg)."
            )
        after = add_point_mass(before, self.mass, point)
        return robot.with_inertia(joint, require_physical(before, after, self.where))


def _freedom(effect: Effect) -> int:
    """The number of directions in which a centre of mass moved, or gravity leans."""
    return max(1, sum(value != 0.0 for value in effect.values.values()))


def _center_implausibility(effect: CenterOfMass, robot: Robot, motions: Sequence[Motion]) -> float:
    """Return what a centre costs that is shifted by much of the link's reach [nats].

    Drawings are usually wrong by the share of it that `link_inertia` takes, too.
    """
    shift = float(np.linalg.norm([effect.x, effect.y, effect.z]))
    size = reach(robot, robot.body_joint(effect.where))
    return 0.5 * (shift / (USUAL * size)) ** 2 if size > 0.0 else 0.0


@final
@dataclass(frozen=True)
class CenterOfMass(Effect):
    """The centre of mass of a body is shifted; mass and inertia about it stay.

    Attributes:
        x: shift in the frame of the body's joint [m].
        y: likewise.
        z: likewise.
    """

    x: float = field(metadata=number("m", 0.0, -10.0, 10.0, 0.02))
    y: float = field(metadata=number("m", 0.0, -10.0, 10.0, 0.02))
    z: float = field(metadata=number("m", 0.0, -10.0, 10.0, 0.02))

    explanation = (
        "Cables, covers or a battery sit elsewhere than in the CAD model: the body is as heavy "
        "as the model says but hangs differently."
    )
    experiment = (
        "Hold the body still at many angles: the extra gravity torque is a shifted sine of the "
        "angle, while the total weight on the ground is right."
    )
    search = SearchOffer(freedom=_freedom, implausibility=_center_implausibility)

    @classmethod
    def places(cls, robot: Robot) -> tuple[str, ...]:
        """Every body that has a mass."""
        return heavy_bodies(robot)

    def change(self, robot: Robot) -> Robot:
        """Return the robot with the centre of mass moved.

        Raises:
            EffectError: no body has its centre of mass there with this inertia about it.
        """
        joint = robot.body_joint(self.where)
        before = robot.model.inertias[joint]
        center = before.lever + np.array([self.x, self.y, self.z])
        after = pin.Inertia(before.mass, center, before.inertia)
        return robot.with_inertia(joint, require_physical(before, after, self.where))


@final
@dataclass(frozen=True)
class GravityDirection(Effect):
    """Gravity leans against the model's: the base or the ground is tilted.

    Attributes:
        roll: rotation of the field about the world's x axis [rad].
        pitch: about the world's y axis [rad].
    """

    roll: float = field(metadata=number("rad", 0.0, -3.2, 3.2, 0.02))
    pitch: float = field(metadata=number("rad", 0.0, -3.2, 3.2, 0.02))

    explanation = "Mounting, ground or attitude sensor is tilted: gravity pulls sideways."
    experiment = "Use a spirit level; or hold mirrored poses: their gravity torques do not cancel."
    search = SearchOffer(freedom=_freedom)

    @classmethod
    def places(cls, robot: Robot) -> tuple[str, ...]:
        """The whole robot."""
        return ("robot",)

    def change(self, robot: Robot) -> Robot:
        """Return the robot in the tilted field."""
        field = np.asarray(robot.model.gravity.linear)
        return robot.with_gravity(pin.rpy.rpyToMatrix(self.roll, self.pitch, 0.0) @ field)


@final
@dataclass(frozen=True)
class ContactRadius(Effect):
    """The ground is touched by a ball around a contact point, not by the point.

    Attributes:
        radius: of the ball [m].
    """

    radius: float = field(metadata=number("m", 0.0, 0.0, 1.0, 0.01, usual=Usual(0.0, 0.05, 0.02)))

    explanation = (
        "A foot is larger or smaller than described: the ground pushes it this far below the "
        "contact point, so that forces along the ground turn every joint above otherwise."
    )
    experiment = (
        "Measure the foot. Or push the standing robot sideways: the error of all joints of a leg "
        "follows the force along the ground times one length."
    )

    @classmethod
    def places(cls, robot: Robot) -> tuple[str, ...]:
        """Every contact point."""
        return tuple(contact.name for contact in robot.contacts)

    @classmethod
    def null_values(cls, robot: Robot, where: str) -> dict[str, float]:
        """Return the radius that the robot has."""
        return {"radius": robot.contact(where).radius}

    def change(self, robot: Robot) -> Robot:
        """Return the robot with this ball."""
        contact = robot.contact(self.where)
        if self.radius == contact.radius:
            return robot
        ball = replace(contact, radius=self.radius)
        return robot.with_contacts(ball if one is contact else one for one in robot.contacts)


def add_point_mass(inertia: pin.Inertia, mass: float, point: FloatArray) -> pin.Inertia:
    """Return `inertia` with a point mass [kg] added (a negative one taken away).

    Args:
        inertia: in some frame.
        mass: [kg].
        point: (3,) [m] in that frame.
    """
    unit = pin.Inertia(1.0, np.asarray(point), np.zeros((3, 3))).toDynamicParameters()
    return pin.Inertia.FromDynamicParameters(inertia.toDynamicParameters() + mass * unit)


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


def reach(robot: Robot, joint: int) -> float:
    """Return how far [m] a link is known to reach from its joint, or from its centre of mass.

    To the joints and contact points that it carries, to its drawn centre of mass, and by two radii
    of gyration about that.

    Args:
        robot: as drawn.
        joint: of the model, which moves the link.
    """
    inertia = robot.model.inertias[joint]
    sizes = [float(np.linalg.norm(point)) for point in (*robot.ends(joint), inertia.lever)]
    if inertia.mass > 0.0:
        about_center = max(float(np.trace(inertia.inertia)), 0.0)  # of a point: 0, but for rounding
        sizes.append(2.0 * float(np.sqrt(0.5 * about_center / inertia.mass)))
    return max(sizes)
