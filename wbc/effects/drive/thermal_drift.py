"""A motor that weakens as it warms up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects.joint_effect import ScaledDrive
from wbc.robot import Evidence, Motion, Parameter, Robot, Screen, SearchOffer, Usual, usual_cost

_LEAST = 0.05  # share of the torque that is always left

# Windings of motors from a finger's to an arm's size warm up in 2 to 60 s, their housings in
# minutes to an hour (makers' data sheets); a longer time is a steady drift.
_WARMS_UP_IN = Usual(5.0, 1e5, 0.4, factor=True)  # [s]
# Magnets lose 0.1 (rare earths) to 0.2 % (ferrite) of their torque per kelvin; windings of a motor
# that is fed a voltage lose 0.4 %. A motor that was warm and cools down gains some of it back.
_LOST = Usual(0.0, 0.2, 0.15)


def _screens(
    kind: type[ThermalDrift], robot: Robot, where: str, evidence: Evidence
) -> tuple[Screen, ...]:
    """Return one screen per time constant, from a tenth of the log's length to ten times."""
    times = [motion.time for motion in evidence.motions if motion.time is not None]
    if not times:
        return ()
    length = max(float(time[-1] - time[0]) for time in times)

    def screen(tau: float) -> Screen:
        unit = {"rate": 1e-5, "time_constant": tau}
        return Screen((unit,), lambda c: {"rate": 1e-5 * float(c[0]), "time_constant": tau})

    return tuple(screen(float(np.clip(s * length, 1.0, 1e5))) for s in (0.1, 0.4, 2.0, 10.0))


def _implausibility(effect: ThermalDrift, robot: Robot, motions: Sequence[Motion]) -> float:
    """Return what the time constant costs, and the torque lost at the end of the logs."""
    lost = max((effect.rate * float(np.max(effect._warm(m, 0.5))) for m in motions), key=_LOST.cost)
    return usual_cost(effect) + _LOST.cost(lost)


@final
@dataclass(frozen=True)
class ThermalDrift(ScaledDrive):
    """The delivered torque falls as the motor warms up: 1 - rate tau (1 - exp(-t/tau)).

    t counts from the start of the log; a simulator carries the warmth from step to step, so that a
    motor stays warm where a run is taken up again. A negative rate is a motor that grows
    stronger; a time constant much longer than the log is a steady drift.

    Attributes:
        rate: share of the torque lost per second at the start [1/s].
        time_constant: tau [s].
    """

    rate: float
    time_constant: float

    name = "thermal_drift"
    parameters = (
        Parameter("rate", "1/s", 0.0, -0.5, 0.5, 0.005),
        Parameter("time_constant", "s", 60.0, 1.0, 1e5, 10.0, shape=True, usual=_WARMS_UP_IN),
    )
    explanation = (
        "Magnets and windings lose torque as they warm up: the same motion asks for more and "
        "more reported torque."
    )
    experiment = (
        "Repeat one loaded motion for several minutes and log the motor's temperature: the "
        "torque drifts with it and comes back after a pause."
    )
    search = SearchOffer(screens=_screens, implausibility=_implausibility)

    def first_memory(self, robot: Robot) -> FloatArray:
        """Return how warm the motors are, as the drift's warm seconds (k,): cold."""
        return np.zeros(np.size(self.rate))

    def next_memory(self, robot: Robot, motion: Motion, torque: FloatArray) -> FloatArray:
        """Return the warm seconds (k,) at the end of a step."""
        return np.ravel(self._warm(motion, 1.0))

    def factor_at(self, robot: Robot, motion: Motion) -> FloatArray:
        """Return the share of the torque that is left, (...)."""
        return np.maximum(1.0 - self.rate * self._warm(motion, 0.5), _LEAST)

    def _warm(self, motion: Motion, share: float) -> FloatArray:
        """Return w, dw/dt = 1 - w/tau, from w = 0: along a log, or `share` of a step onward."""
        if motion.memory is not None:
            time = np.asarray(share * motion.memory.step)
            start = np.reshape(motion.memory.value, np.shape(self.rate))
        else:
            none = np.zeros(motion.velocity.shape[:-1])
            time = none if motion.time is None else np.asarray(motion.time)
            time, start = time.reshape((*time.shape, *(1,) * np.ndim(self.rate))), np.zeros(())
        gone = -np.expm1(-time / self.time_constant)
        return np.asarray(start + (self.time_constant - start) * gone)
