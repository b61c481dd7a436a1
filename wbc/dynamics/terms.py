"""The terms of the equation of motion, evaluated once per state and shared by everything else."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.errors import DynamicsError
from wbc.robot import Robot

_WORLD = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


@dataclass(frozen=True, eq=False, slots=True)
class Terms:
    """Link-side quantities at one state; the rotors are not in them.

    Attributes:
        position: q (nq,).
        velocity: v (nv,).
        mass_matrix: H_l (nv, nv), inertia of the links without reflected rotor inertia.
        bias: c_l (nv,), Coriolis, centrifugal and gravity torque [N m, N].
        contact_jacobian: J (3k, nv), linear velocity of the k contact points, world axes.
        contact_position: (k, 3) [m], world.
        data: pinocchio's data at this state, for further kinematics; overwritten by the next
            `evaluate` with the same workspace. What it returns are views of its memory: keep the
            terms for as long as you use them, or copy. `evaluate(...).data.com[0]` reads memory
            that is free already; `evaluate(...).center_of_mass` does not.
    """

    position: FloatArray
    velocity: FloatArray
    mass_matrix: FloatArray
    bias: FloatArray
    contact_jacobian: FloatArray
    contact_position: FloatArray
    data: pin.Data

    @property
    def center_of_mass(self) -> FloatArray:
        """Centre of mass (3,) [m], world; a copy, taken from `data` when asked."""
        return np.array(self.data.com[0])


class Workspace:
    """Memory for evaluating one robot; make one per thread and keep it.

    Contact points become operational frames of a private copy of the model, so that pinocchio
    computes their Jacobians directly.
    """

    def __init__(self, robot: Robot) -> None:
        """Prepare memory for `robot`."""
        model = robot.model.copy() if robot.contacts else robot.model
        self.robot = robot
        self.frames: list[int] = []
        for contact in robot.contacts:
            parent = model.frames[model.getFrameId(contact.frame)]
            frame = pin.Frame(
                f"contact:{contact.name}",
                parent.parentJoint,
                model.getFrameId(contact.frame),
                parent.placement * contact.placement(),
                pin.FrameType.OP_FRAME,
            )
            self.frames.append(model.addFrame(frame, False))
        self.model = model
        self.data = model.createData()
        self._zero = np.zeros(model.nv)


def evaluate(
    robot: Robot, position: FloatArray, velocity: FloatArray, workspace: Workspace | None = None
) -> Terms:
    """Evaluate the link-side terms at (q, v).

    Args:
        robot: the robot.
        position: q (nq,).
        velocity: v (nv,).
        workspace: reusable memory; a new one is made when left out (slower).

    Raises:
        DynamicsError: a wrong shape, or a workspace that belongs to another robot.
    """
    space = Workspace(robot) if workspace is None else workspace
    if space.robot is not robot:
        raise DynamicsError(
            f"the workspace belongs to '{space.robot.name}' (another object than '{robot.name}'); "
            "make a new Workspace after every with_... change."
        )
    model, data = space.model, space.data
    if position.shape != (model.nq,) or velocity.shape != (model.nv,):
        raise DynamicsError(
            f"'{robot.name}' needs q of shape ({model.nq},) and v of shape ({model.nv},), "
            f"got {position.shape} and {velocity.shape}."
        )
    pin.computeAllTerms(model, data, position, velocity)
    k = len(space.frames)
    jacobian, points = np.empty((3 * k, model.nv)), np.empty((k, 3))
    pin.forwardKinematics(model, data, position, velocity, space._zero)
    for i, frame in enumerate(space.frames):
        pin.updateFramePlacement(model, data, frame)
        columns = pin.getFrameJacobian(model, data, frame, _WORLD)
        jacobian[3 * i : 3 * i + 3] = columns[:3].reshape(3, -1)  # a vector of one coordinate
        points[i] = data.oMf[frame].translation
    return Terms(position, velocity, data.M.copy(), data.nle.copy(), jacobian, points, data)
