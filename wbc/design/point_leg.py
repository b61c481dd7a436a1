"""A planar leg with one point foot under simulated control: the robot of the case study's kind.

Standing, landing and hopping need a controller. These three are for robots with one contact, a base
that moves in the plane by joints of its own (two prismatic ones and a revolute one, none driven),
and two driven joints.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin
from scipy.optimize import brentq

from wbc.arrays import FloatArray
from wbc.control import (
    CenterOfMassTask,
    Controller,
    ControllerSettings,
    PointContact,
    PointFootBalanceTask,
    PostureTask,
    Reference,
    RestPolicy,
)
from wbc.design.simulated import height_row, require_point_leg
from wbc.dynamics import evaluate
from wbc.errors import DesignError
from wbc.robot import Robot

_BEND = (-2.0, 2.0)  # [rad] about the pose, in which a balanced hip angle is looked for


@dataclass(frozen=True, eq=False)
class PointLeg:
    """The names and indices of such a leg.

    Attributes:
        robot: the leg.
        contact: name of its foot.
        base: name of the link that carries it.
        height: row of the base's height in q.
    """

    robot: Robot
    contact: str
    base: str
    height: int

    @classmethod
    def of(cls, robot: Robot, contact: str) -> PointLeg:
        """Return the leg.

        Raises:
            DesignError: a robot of another kind.
        """
        require_point_leg(robot)
        return cls(robot, contact, robot.bodies[2], height_row(robot))

    def balanced(self, q: FloatArray, lift: float = 0.0) -> FloatArray:
        """Return q with the centre of mass over the foot and the foot `lift` [m] above ground.

        The last driven joint keeps its angle, the first one turns.

        Raises:
            DesignError: no angle balances the leg.
        """
        pose, rest = q.copy(), np.zeros(self.robot.model.nv)
        joint = int(self.robot.actuated_position[0])
        middle = float(q[joint])

        def overhang(angle: float) -> float:
            pose[joint] = angle
            terms = evaluate(self.robot, pose, rest)
            return float(terms.center_of_mass[0] - terms.contact_position[0, 0])

        angles = middle + np.linspace(*_BEND, 81)
        signs = np.sign([overhang(angle) for angle in angles])
        changes = np.flatnonzero(signs[1:] != signs[:-1])
        if not changes.size:
            raise DesignError(f"no pose of '{self.robot.name}' balances on its foot.")
        nearest = changes[np.argmin(np.abs(angles[changes] - middle))]
        pose[joint] = brentq(overhang, angles[nearest], angles[nearest + 1])
        return placed(self.robot, pose, lift)

    def stance(self, policy: RestPolicy = RestPolicy.NEUTRAL) -> Controller:
        """Return a controller that keeps height and balance."""
        tasks = [
            CenterOfMassTask(
                name="height",
                axes="z",
                weight=100.0,
                stiffness=400.0,
                acceleration_limit=np.inf,
            ),
            PointFootBalanceTask(contact=self.contact, frame=self.base, weight=100.0),
            PostureTask.of(self.robot, weight=1e-3),
        ]
        settings = ControllerSettings(rest_policy=policy)
        contacts = [PointContact(name=self.contact)]
        return Controller(self.robot, tasks, contacts, settings=settings)

    def mistaken(self, share: float) -> PointLeg:
        """Return the leg as a controller believes it: efficiencies wrong by `share`.

        Both efficiencies are multiplied by 1 + share and cut at 1, where a gear would create power.
        """
        gears = self.robot.transmission
        forward = np.minimum(gears.forward_efficiency * (1.0 + share), 1.0)
        backward = np.minimum(gears.backward_efficiency * (1.0 + share), 1.0)
        changed = gears.replace(forward_efficiency=forward, backward_efficiency=backward)
        return replace(self, robot=self.robot.with_transmission(changed))


def placed(robot: Robot, q: FloatArray, lift: float) -> FloatArray:
    """Return q with the lowest contact `lift` [m] above the ground."""
    pose = q.copy()
    row = height_row(robot)
    heights = evaluate(robot, pose, np.zeros(robot.model.nv)).contact_position[:, 2]
    pose[row] += lift - float(heights.min())
    return pose


def total_mass(robot: Robot) -> float:
    """Return the mass of all links [kg]."""
    return float(pin.computeTotalMass(robot.model))


def standing_reference(height: float) -> dict[str, Reference]:
    """Return the references of `stance` for a height of the centre of mass [m]."""
    return {"height": Reference(np.array([height])), "balance": Reference(0.0)}
