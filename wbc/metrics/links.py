"""Inertia and contact Jacobian of many designs, at rest.

Every array has a leading axis of k designs, or of 1 as long as nothing that it depends on varies,
so that a sweep of the gears alone computes the links once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.metrics.designs import Designs, Stretching


@dataclass(frozen=True, eq=False)
class LinkTerms:
    """What the links of each design weigh and how its contact point moves.

    Attributes:
        mass_matrix: H_l (k or 1, nv, nv), rotors not in it.
        jacobian: (k or 1, 3, nv), velocity of the contact point, world axes.
        mass: (k or 1,) [kg], of the whole robot.
        spin: a'J_omega (k or 1, m, nv), spin of each rotor's housing about its axis per v; None
            where rotors do not turn with links.
    """

    mass_matrix: FloatArray
    jacobian: FloatArray
    mass: FloatArray
    spin: FloatArray | None = None


def link_terms(designs: Designs, contact: str) -> LinkTerms:
    """Return the terms of the links for every design.

    Raises:
        RobotError: no such contact.
    """
    robot, model = designs.robot, designs.robot.model.copy()
    point = robot.contact(contact)
    drawn = model.frames[model.getFrameId(point.frame)]
    place = drawn.placement * point.placement()
    frame = model.addFrame(
        pin.Frame(f"{contact} of designs", drawn.parentJoint, place, pin.FrameType.OP_FRAME)
    )
    mounting = robot.mounting if robot.rotors_turn_with_links else None
    stretching, data = Stretching(model, [frame]), model.createData()
    q, lengths, masses = designs.position, designs.length_scale, designs.mass_scale
    links = max(len(lengths), len(masses))
    own = np.array([body.mass for body in model.inertias])[1:]
    count = max(len(q), links)
    inertia = np.zeros((count, model.nv, model.nv))
    jacobian = np.zeros((count, 3, model.nv))
    spin = np.zeros((count, robot.transmission.size, model.nv))
    world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    for i in range(count):
        if i < links:
            stretching.to(lengths[min(i, len(lengths) - 1)], masses[min(i, len(masses) - 1)])
        here = q[min(i, len(q) - 1)]
        inertia[i] = pin.crba(model, data, here, pin.Convention.WORLD)
        pin.computeJointJacobians(model, data, here)
        jacobian[i] = pin.getFrameJacobian(model, data, frame, world)[:3]
        if mounting is not None:
            for gear, housing in enumerate(mounting.housing.tolist()):
                turning = pin.getJointJacobian(model, data, housing, world)[3:]
                spin[i, gear] = data.oMi[housing].rotation @ mounting.axis[gear] @ turning
    whole = np.triu(inertia) + np.swapaxes(np.triu(inertia, 1), 1, 2)
    return LinkTerms(whole, jacobian, masses @ own, None if mounting is None else spin)
