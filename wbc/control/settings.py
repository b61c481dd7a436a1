"""What a controller can be told besides tasks, contacts and limits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, final

import numpy as np

from wbc.arrays import FloatArray, must
from wbc.control.inputs import Checked, State, check_step
from wbc.control.qp.solvers import SOLVERS, WarmStart
from wbc.errors import ControlError, require_known


class RestPolicy(Enum):
    """Which mesh input torque to choose where a gear stands still and T fixes only an interval.

    NEUTRAL passes T through as if without loss; LEAST_TORQUE takes the end of least magnitude and
    lets friction carry the rest; MOST_MARGIN takes the middle, farthest from slipping either way.
    """

    NEUTRAL = "neutral"
    LEAST_TORQUE = "least_torque"
    MOST_MARGIN = "most_margin"


@dataclass(frozen=True)
class SpeedBlend(Checked):
    """How sure the controller is of the direction of a joint.

    The measured sign flips with every count of encoder noise while a joint stands, and each flip
    costs the full width of the stiction interval; the velocity of a reference knows nothing of
    the feedback's own motions. The controller therefore goes by the speed that its own
    accelerations lead to, drawn slowly towards the measurement:

        v <- v + step qdd,   then with e = v_meas - v
        v <- v + correction step clip(e, +-trusted_error) + (e beyond trusted_error)
        sigma = clip(v / full_speed, -1, 1)

    A joint that sticks although it should move gathers expected speed until its gear is driven
    into the branch that breaks it loose; an impact, an error beyond all noise, is taken over at
    once.

    Attributes:
        full_speed: [rad/s] of the motor output from which a direction counts as certain.
        correction: [1/s] rate at which the expected speed follows the measured one.
        trusted_error: [rad/s] that noise and small disturbances explain, some five standard
            deviations of the velocity noise. With zero the measured speed is believed.
    """

    full_speed: float = field(default=0.02, metadata=must("> 0 rad/s"))
    correction: float = field(default=30.0, metadata=must(">= 0 and < inf"))
    trusted_error: float = field(default=0.25, metadata=must(">= 0 and < inf"))

    _told = "speed blend: "


@dataclass(frozen=True, eq=False)
class DisturbanceObserver(Checked):
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

    rate: float = field(default=2.0, metadata=must("> 0 1/s and < inf"))
    bound: float | FloatArray = field(default=1.0, metadata=must(">= 0 and < inf"))

    _told = "disturbance observer: "

    def bounds(self, nv: int) -> FloatArray:
        """Return the bound of every coordinate (nv,).

        Raises:
            ControlError: a bound of another size.
        """
        bound = np.asarray(self.bound, dtype=np.float64)
        if bound.shape not in ((), (nv,)):
            raise self.wrong(f"bound has shape {bound.shape}, expected ({nv},) or one number.")
        return np.array(np.broadcast_to(bound, (nv,)))


@final
@dataclass(frozen=True)
class LetDown(Checked):
    """Rides through, holds the robot against gravity, then lets it down gently.

    The last good torque is repeated for a few ticks, as most bad ticks come alone. Then the torque
    goes over, within as many ticks, to what holds the robot still, and damping. After `hold` the
    part against gravity fades out over `lowering`; the damping stays. Compensating gravity and
    damping put no energy into a motion on an arm: with g the gravity torque,
    d/dt (1/2 v'M v) = v'(tau - g) <= 0, and losses of the gears only take more.

    Attributes:
        ride_through: ticks that repeat the last good torque.
        hold: [s] for which gravity is held in full.
        lowering: [s] in which the robot is let down then.
        rate: [1/s] of the damping.
    """

    ride_through: int = field(default=5, metadata=must(">= 0"))
    hold: float = field(default=1.0, metadata=must(">= 0 s"))
    lowering: float = field(default=3.0, metadata=must("> 0 s"))
    rate: float = field(default=50.0, metadata=must(">= 0 1/s and < inf"))

    _told = "let down: "


@dataclass(frozen=True)
class ControllerSettings(Checked):
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
        max_iterations: work of one tick at most, in iterations of solvers; a program counts as a
            hundred of them besides. A better solution than the first is looked for with half.
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
    rest_margin: float = field(default=0.0, metadata=must(">= 0 and <= 0.5"))
    speed_blend: SpeedBlend = field(default_factory=SpeedBlend)
    warm_start: WarmStart = WarmStart.ACTIVE_SET
    solver: str = "daqp"
    tolerance: float = field(default=1e-7, metadata=must("> 0"))
    max_iterations: int = field(default=345, metadata=must("> 0"))
    acceleration_weight: float = field(default=1e-6, metadata=must("> 0"))
    force_weight: float = field(default=1e-4, metadata=must("> 0 and < inf"))
    contact_ramp: float = field(default=0.02, metadata=must(">= 0 s and < inf"))
    safety: LetDown = field(default_factory=LetDown)
    deadline: float | None = field(default=None, metadata=must("> 0 s"))
    disturbance: DisturbanceObserver | None = None
    state_hook: Callable[[Any], State] | None = None

    _told = "setting "

    def __post_init__(self) -> None:
        """Check time step, solver and ranges."""
        check_step(self.time_step, "setting time_step")
        require_known(ControlError, "QP solver", self.solver, SOLVERS)
        super().__post_init__()
