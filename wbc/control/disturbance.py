"""What the model misses, learned from the momentum that it did not expect."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import ControlError
from wbc.robot import Robot


@dataclass(frozen=True, eq=False)
class DisturbanceObserver:
    """A momentum observer: a torque on the coordinates that explains how the robot moves.

    With the acceleration qdd that the last tick expected, and M with the rotors' inertia,

        d <- clip(d + rate M (v - v_last - step qdd), +-bound),

    the discrete form of De Luca & Mattone (2003) with the controller's own prediction as the model.
    d joins the bias of the next tick, so that a constant load is learned within about 1/rate. What
    holds a contact or a resting gear moves nothing and teaches nothing. After a tick without a
    solution, or with other contacts (a foot that lands has an impact), d stays as it is.

    Attributes:
        rate: [1/s] of learning; slow against the tasks' gains, or the two loops swing together.
        bound: greatest torque [N m] or force [N] of every coordinate (nv,), or one for all.
    """

    rate: float = 2.0
    bound: float | FloatArray = 1.0

    def __post_init__(self) -> None:
        """Check the ranges."""
        if not 0.0 < self.rate < np.inf:
            raise ControlError(f"disturbance observer: rate must be > 0 1/s, got {self.rate}.")
        bound = np.asarray(self.bound, dtype=np.float64)
        if not np.isfinite(bound).all() or (bound < 0.0).any():
            raise ControlError(f"disturbance observer: bound must be >= 0, got {self.bound}.")


class DisturbanceEstimate:
    """The observer's memory from one tick to the next.

    Attributes:
        torque: d (nv,) [N m, N].
    """

    def __init__(self, robot: Robot, observer: DisturbanceObserver | None) -> None:
        """Start without any disturbance.

        Raises:
            ControlError: a bound of another size than nv.
        """
        nv, gears = robot.model.nv, robot.transmission
        self._observer = observer
        self.torque = np.zeros(nv)
        self._expected: FloatArray | None = None
        self._contacts: object = None
        self._rotors = np.zeros((nv, nv))
        turns = np.zeros((gears.size, nv))
        turns[:, robot.actuated] = gears.motor_from_joint
        self._rotors = turns.T @ (gears.reflected_inertia[:, None] * turns)
        if observer is None:
            return
        bound = np.asarray(observer.bound, dtype=np.float64)
        if bound.shape not in ((), (nv,)):
            raise ControlError(
                f"disturbance observer: bound has shape {bound.shape}, expected ({nv},) or one "
                "number."
            )
        self._bound = np.broadcast_to(bound, (nv,))

    @property
    def on(self) -> bool:
        """Whether anything is learned at all."""
        return self._observer is not None

    def forget(self) -> None:
        """Forget what was learned."""
        self.torque, self._expected = np.zeros(len(self.torque)), None

    def updated(self, velocity: FloatArray, mass: FloatArray, contacts: object) -> FloatArray:
        """Return d (nv,) after a tick's velocity; nothing is remembered.

        Args:
            velocity: v (nv,).
            mass: M (nv, nv) of the links.
            contacts: the active contacts, to be told from those of the last tick.
        """
        if self._observer is None or self._expected is None or contacts != self._contacts:
            return self.torque
        surprise = (mass + self._rotors) @ (velocity - self._expected)
        learned = self.torque + self._observer.rate * surprise
        return np.asarray(np.clip(learned, -self._bound, self._bound))

    def remember(
        self,
        torque: FloatArray,
        velocity: FloatArray,
        acceleration: FloatArray,
        dt: float,
        contacts: object,
    ) -> None:
        """Take d (nv,) of a tick with a solution, and the velocity that it leads to."""
        self.torque = torque
        self._expected = velocity + dt * acceleration
        self._contacts = contacts

    def interrupt(self) -> None:
        """Expect nothing of the next tick, as the last one had no solution."""
        self._expected = None
