"""What a controller can be told besides tasks, contacts and limits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.gears import RestPolicy, SpeedBlend
from wbc.control.inputs import TickInputError, check_step
from wbc.control.policies import LetDown, SafetyPolicy
from wbc.control.qp.solvers import WarmStart
from wbc.control.reference import State
from wbc.errors import ControlError


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

    def bounds(self, nv: int) -> FloatArray:
        """Return the bound of every coordinate (nv,).

        Raises:
            ControlError: a bound of another size.
        """
        bound = np.asarray(self.bound, dtype=np.float64)
        if bound.shape not in ((), (nv,)):
            raise ControlError(
                f"disturbance observer: bound has shape {bound.shape}, expected ({nv},) or one "
                "number."
            )
        return np.array(np.broadcast_to(bound, (nv,)))


@dataclass(frozen=True)
class ControllerSettings:
    """Settings of a controller.

    Attributes:
        time_step: time until the next tick [s] where `step` is not told.
        rest_policy: what to choose inside the interval that stiction leaves free.
        rest_margin: share of that interval, 0 to 0.5, that is kept free at either end, so that
            efficiencies that are a little off do not let a resting gear slip.
        speed_blend: how the directions of the gears are judged.
        warm_start: whether the constraints that bound the last solution are tried before the
            solver is asked.
        solver: asked where the controller's own guess fails: "daqp", or "proxqp" with daqp behind
            it.
        tolerance: absolute tolerance of the solver on every residual.
        max_iterations: iterations that solvers may take in one tick.
        max_rounds: programs solved at most in one tick while directions are revised, a third of
            them at most after the first solution, for a better one.
        acceleration_weight: regularisation of qdd towards zero.
        force_weight: regularisation of the contact forces (per tenth of the robot's weight)
            towards a shared load; far below 1e-5 it drowns in the solver's tolerance, and how
            feet share the load then depends on the past.
        contact_ramp: [s] in which a contact that appears or disappears takes up or gives off the
            robot's weight, 0 for at once: its greatest normal force changes no faster. Flags that
            flicker then do not throw the robot about.
        safety: what to command when a tick has no solution.
        disturbance: learns what the model misses; None (the default) learns nothing.
        state_hook: makes a state of what `step` is given (a message, an estimate to filter); None
            where it is given states.
        deadline: [s] that a tick may take before its status is LATE; None for no deadline.
    """

    time_step: float = 1e-3
    rest_policy: RestPolicy = RestPolicy.NEUTRAL
    rest_margin: float = 0.0
    speed_blend: SpeedBlend = field(default_factory=SpeedBlend)
    warm_start: WarmStart = WarmStart.ACTIVE_SET
    solver: str = "daqp"
    tolerance: float = 1e-7
    max_iterations: int = 1000
    max_rounds: int = 9
    acceleration_weight: float = 1e-6
    force_weight: float = 1e-4
    contact_ramp: float = 0.02
    safety: SafetyPolicy = field(default_factory=LetDown)
    deadline: float | None = None
    disturbance: DisturbanceObserver | None = None
    state_hook: Callable[[Any], State] | None = None

    def __post_init__(self) -> None:
        """Check the ranges."""
        try:
            check_step(self.time_step)
        except TickInputError as cause:
            raise ControlError(f"setting time_step: {cause}") from cause
        positive = ("tolerance", "max_iterations", "max_rounds", "acceleration_weight")
        for name in positive:
            if not getattr(self, name) > 0:
                raise ControlError(f"setting {name} must be > 0, got {getattr(self, name)}.")
        for name in ("force_weight", "contact_ramp"):
            if not 0.0 <= getattr(self, name) < np.inf:
                raise ControlError(f"setting {name} must be >= 0, got {getattr(self, name)}.")
        if not 0.0 <= self.rest_margin <= 0.5:
            raise ControlError(
                f"setting rest_margin must lie between 0 and 0.5, got {self.rest_margin}."
            )
        if self.deadline is not None and not self.deadline > 0.0:
            raise ControlError(f"setting deadline must be > 0 s, got {self.deadline}.")
