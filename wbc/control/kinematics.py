"""Kinematics of one tick, each quantity computed when the first task asks for it."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.dynamics import Terms
from wbc.errors import ControlError, unknown_name

_WORLD = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


class Kinematics:
    """What tasks and contacts read at one state.

    The tick's `Terms` hold placements, Jacobians, and accelerations at qdd = 0, from which every
    drift dJ/dt v follows. One object serves one controller; `update` moves it to the next state.

    Attributes:
        model: the pinocchio model of the tick's workspace.
        terms: link-side terms of the present state.
    """

    def __init__(self, model: pin.Model) -> None:
        """Prepare for a model; `update` must come before anything is read."""
        self.model = model
        self.terms: Terms
        self._frames: dict[str, int] = {}
        self._com_ready = False
        self._momentum_ready = False

    def update(self, terms: Terms) -> None:
        """Take the terms of the present state."""
        self.terms = terms
        self._com_ready = False
        self._momentum_ready = False

    @property
    def position(self) -> FloatArray:
        """q (nq,)."""
        return self.terms.position

    @property
    def velocity(self) -> FloatArray:
        """v (nv,)."""
        return self.terms.velocity

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
        return pin.updateFramePlacement(self.model, self.terms.data, frame)

    def frame_jacobian(self, frame: int, axes: pin.ReferenceFrame = _WORLD) -> FloatArray:
        """Return J (6, nv): linear velocity of the frame's origin over angular velocity."""
        return np.asarray(pin.getFrameJacobian(self.model, self.terms.data, frame, axes))

    def frame_drift(self, frame: int, axes: pin.ReferenceFrame = _WORLD) -> FloatArray:
        """Return dJ/dt v (6,), the classical acceleration of the frame at qdd = 0."""
        motion = pin.getFrameClassicalAcceleration(self.model, self.terms.data, frame, axes)
        return np.asarray(motion.vector)

    def center_of_mass(self) -> FloatArray:
        """Return the centre of mass (3,) [m], world."""
        return np.asarray(self.terms.data.com[0])

    def center_of_mass_jacobian(self) -> FloatArray:
        """Return J_com (3, nv), world axes."""
        return np.asarray(self.terms.data.Jcom)

    def center_of_mass_drift(self) -> FloatArray:
        """Return dJ_com/dt v (3,) [m/s^2], world axes."""
        if not self._com_ready:
            pin.centerOfMass(self.model, self.terms.data, pin.KinematicLevel.ACCELERATION, False)
            self._com_ready = True
        return np.asarray(self.terms.data.acom[0])

    def momentum_matrix(self) -> FloatArray:
        """Return A_g (6, nv): h_g = A_g v, linear over angular, about the centre of mass."""
        self._update_momentum()
        return np.asarray(self.terms.data.Ag)

    def momentum_drift(self) -> FloatArray:
        """Return dA_g/dt v (6,), linear [N] over angular [N m]."""
        self._update_momentum()
        return np.asarray(self.terms.data.dhg.vector)

    def _update_momentum(self) -> None:
        if not self._momentum_ready:
            data = self.terms.data
            pin.computeCentroidalMap(self.model, data, self.terms.position)
            pin.computeCentroidalMomentumTimeVariation(self.model, data)
            self._momentum_ready = True
