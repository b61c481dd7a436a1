"""What a pinocchio model must be like before equations of motion may be built on it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from wbc.errors import RobotError, unknown_name
from wbc.robot.contact import ContactPoint


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
        if not model.existFrame(contact.frame):
            known = [frame.name for frame in model.frames]
            raise RobotError(
                f"contact '{contact.name}': "
                + unknown_name(f"frame of '{name}'", contact.frame, known)
            )
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
