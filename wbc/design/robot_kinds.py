"""What a robot must be for each simulation of designs: told before plant and controller load."""

from __future__ import annotations

import pinocchio as pin

from wbc.errors import DesignError
from wbc.robot import Robot


def height_row(robot: Robot) -> int:
    """Return the row of q that moves the whole robot along z.

    Raises:
        DesignError: a robot whose base does not move along z.
    """
    model = robot.model
    if robot.has_free_flyer:
        return 2
    for joint in range(1, model.njoints):
        if model.joints[joint].shortname() == "JointModelPZ" and model.parents[joint] < joint:
            if model.names[joint] not in robot.transmission.joints:
                return int(model.joints[joint].idx_q)
            break
    raise DesignError(f"the base of '{robot.name}' cannot fall; only a floating base can.")


def require_point_leg(robot: Robot) -> None:
    """Check that a robot has one contact, a planar base of three joints and two driven joints.

    Raises:
        DesignError: it does not.
    """
    model = robot.model
    kinds = [model.joints[j].shortname()[10:11] for j in range(1, model.njoints)]
    driven = robot.transmission.size
    if len(robot.contacts) != 1 or driven != 2 or kinds[:3] != ["P", "P", "R"]:
        raise DesignError(
            f"'{robot.name}' is no planar leg with one foot, a base of three joints and two "
            "driven joints: it cannot be simulated standing, landing or hopping. Leave these out "
            "of --simulate."
        )
    height_row(robot)


def require_quadruped(robot: Robot) -> None:
    """Check that a robot floats and has one foot in each corner, seen from above.

    Raises:
        DesignError: it does not.
    """
    corners = set()
    if robot.has_free_flyer:
        data = robot.model.createData()
        pin.framesForwardKinematics(robot.model, data, robot.pose())
        for contact in robot.contacts:
            place = data.oMi[1].actInv(data.oMf[robot.model.getFrameId(contact.frame)])
            corners.add((place.translation[0] > 0.0, place.translation[1] > 0.0))
    if len(corners) != 4 or len(robot.contacts) != 4:
        raise DesignError(
            f"'{robot.name}' cannot trot: that needs a floating base and four contacts, one in "
            "each corner."
        )
