"""A mass that the model does not know of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from wbc.effects.links.inertia import add_point_mass, require_physical
from wbc.effects.links.link_inertia import mass_left
from wbc.errors import EffectError
from wbc.robot import Effect, Parameter, Robot, SearchOffer


def _remarks(effect: PayloadMass, robot: Robot) -> tuple[str, ...]:
    """Say of a negative mass that it is drawn and not there."""
    if effect.mass >= 0.0:
        return ()
    joint = (
        robot.body_joint(effect.where) if effect.where in robot.bodies else effect._carrier(robot)
    )
    return (mass_left(-effect.mass, robot.model.inertias[joint].mass, effect.where),)


@final
@dataclass(frozen=True)
class PayloadMass(Effect):
    """A point mass fixed to a body at its centre of mass, or to a contact point.

    Attributes:
        mass: [kg]; negative takes away.
    """

    mass: float

    name = "payload_mass"
    parameters = (Parameter("mass", "kg", 0.0, -1000.0, 1000.0, 0.3),)
    explanation = (
        "Something was mounted, filled or left out: a body is heavier or lighter than in the "
        "CAD model."
    )
    experiment = (
        "Hold still in several poses, then move fast: the extra torque follows gravity and "
        "inertia together, at one place of the chain."
    )
    search = SearchOffer(remarks=_remarks)

    @classmethod
    def places(cls, robot: Robot) -> tuple[str, ...]:
        """Every body that has a mass, and every contact point."""
        heavy = [b for b in robot.bodies if robot.model.inertias[robot.body_joint(b)].mass > 0.0]
        return (*heavy, *(c.name for c in robot.contacts))

    def _carrier(self, robot: Robot) -> int:
        contact = robot.contact(self.where)
        return int(robot.model.frames[robot.model.getFrameId(contact.frame)].parentJoint)

    def change(self, robot: Robot) -> Robot:
        """Return the robot that carries the mass."""
        if self.where in robot.bodies:
            joint = robot.body_joint(self.where)
            point = robot.model.inertias[joint].lever
        else:
            contact = robot.contact(self.where)
            frame = robot.model.frames[robot.model.getFrameId(contact.frame)]
            joint = frame.parentJoint
            point = frame.placement.act(contact.offset)
        before = robot.model.inertias[joint]
        if self.mass == 0.0:
            return robot
        if before.mass + self.mass <= 0.0:
            raise EffectError(
                f"payload of {self.mass:g} kg at '{self.where}' leaves no mass there "
                f"(the body has {before.mass:g} kg)."
            )
        after = add_point_mass(before, self.mass, point)
        return robot.with_inertia(joint, require_physical(before, after, self.where))
