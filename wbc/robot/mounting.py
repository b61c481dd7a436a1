"""Where the rotors sit: which link carries each motor's housing, and along which axis it spins."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray, IntArray, frozen
from wbc.errors import RobotError, unknown_name
from wbc.transmission import Transmission


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
