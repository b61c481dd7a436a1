"""Dynamics and kinematics of one tick, the rarer quantities computed when first asked for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.dynamics import Workspace
from wbc.errors import ControlError, unknown_name
from wbc.robot import Robot

_WORLD = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


class Kinematics:
    """What the plant, tasks and contacts read at one state.

    One object serves one controller; `update` moves it to the next state. All arrays are views of
    memory that the next `update` overwrites. Accelerations are those at qdd = 0, from which every
    drift dJ/dt v follows.

    Attributes:
        model: the pinocchio model, the robot's contact points among its frames.
        data: pinocchio's data at the present state.
        position: q (nq,).
        velocity: v (nv,).
        mass: of the robot [kg].
        gravity: magnitude of the acceleration of gravity [m/s^2].
        mass_matrix: H_l (nv, nv), inertia of the links without reflected rotor inertia.
        bias: c_l (nv,), Coriolis, centrifugal and gravity torque [N m, N].
    """

    def __init__(self, robot: Robot, frames: Sequence[pin.Frame] = ()) -> None:
        """Prepare for a robot; `update` must come before anything is read.

        Args:
            robot: the robot.
            frames: further frames to know, such as the middles of soles.
        """
        self.model = Workspace(robot).model.copy()
        for frame in frames:
            self.model.addFrame(frame, False)
        self.data = data = self.model.createData()
        self.position: FloatArray = np.zeros(self.model.nq)
        self.velocity: FloatArray = np.zeros(self.model.nv)
        self.mass_matrix: FloatArray = data.M
        self.bias: FloatArray = data.tau
        self.mass = float(pin.computeTotalMass(self.model))
        self.gravity = float(np.linalg.norm(self.model.gravity.linear))
        self._rest = np.zeros(self.model.nv)
        self._com: FloatArray = data.com[0]
        self._com_drift: FloatArray = data.acom[0]
        self._com_jacobian: FloatArray = data.Jcom
        self._momentum: FloatArray = data.Ag
        self._frames: dict[str, int] = {}
        self._com_ready = self._momentum_drift_ready = False

    def update(self, position: FloatArray, velocity: FloatArray) -> None:
        """Move to the state q (nq,), v (nv,)."""
        model, data = self.model, self.data
        self.position, self.velocity = position, velocity
        pin.crba(model, data, position, pin.Convention.WORLD)  # which leaves A_g behind as well
        pin.rnea(model, data, position, velocity, self._rest)
        pin.forwardKinematics(model, data, position, velocity, self._rest)
        self._com_ready = self._momentum_drift_ready = False

    def frame_id(self, name: str) -> int:
        """Return the number of a frame.

        Raises:
            ControlError: no such frame; the message lists those there are.
        """
        number = self._frames.get(name)
        if number is None:
            if not self.model.existFrame(name):
                known = [frame.name for frame in self.model.frames]
                raise ControlError(unknown_name("frame", name, known))
            number = int(self.model.getFrameId(name))
            self._frames[name] = number
        return number

    def placement(self, frame: int) -> pin.SE3:
        """Return the placement of a frame in the world."""
        return pin.updateFramePlacement(self.model, self.data, frame)

    def frame_jacobian(self, frame: int, axes: pin.ReferenceFrame = _WORLD) -> FloatArray:
        """Return J (6, nv): linear velocity of the frame's origin over angular velocity."""
        rows: FloatArray = pin.getFrameJacobian(self.model, self.data, frame, axes)
        return rows

    def frame_velocity(self, frame: int) -> FloatArray:
        """Return the velocity (6,) of the frame's origin over the angular one, world axes."""
        rate: FloatArray = pin.getFrameVelocity(self.model, self.data, frame, _WORLD).vector
        return rate

    def frame_drift(self, frame: int, axes: pin.ReferenceFrame = _WORLD) -> FloatArray:
        """Return dJ/dt v (6,), the classical acceleration of the frame at qdd = 0."""
        motion = pin.getFrameClassicalAcceleration(self.model, self.data, frame, axes)
        drift: FloatArray = motion.vector
        return drift

    def center_of_mass(self) -> FloatArray:
        """Return the centre of mass (3,) [m], world."""
        self._update_com()
        return self._com

    def center_of_mass_jacobian(self) -> FloatArray:
        """Return J_com (3, nv), world axes."""
        self._update_com()
        return self._com_jacobian

    def center_of_mass_drift(self) -> FloatArray:
        """Return dJ_com/dt v (3,) [m/s^2], world axes."""
        self._update_com()
        return self._com_drift

    def momentum_matrix(self) -> FloatArray:
        """Return A_g (6, nv): h_g = A_g v, linear over angular, about the centre of mass."""
        return self._momentum

    def momentum_drift(self) -> FloatArray:
        """Return dA_g/dt v (6,), linear [N] over angular [N m]."""
        if not self._momentum_drift_ready:
            pin.computeCentroidalMomentumTimeVariation(self.model, self.data)
            self._momentum_drift_ready = True
        drift: FloatArray = self.data.dhg.vector
        return drift

    def _update_com(self) -> None:
        if not self._com_ready:
            pin.centerOfMass(self.model, self.data, pin.KinematicLevel.ACCELERATION, False)
            pin.jacobianCenterOfMass(self.model, self.data, False)
            self._com_ready = True
