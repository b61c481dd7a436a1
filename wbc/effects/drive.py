"""What a drive does with the torque it was asked for, and the inertia of its rotor."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import final

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects.joint_effect import GearNumbers, JointEffect, ScaledDrive
from wbc.robot import Evidence, Memory, Motion, Robot, Screen, SearchOffer, Usual, number

# Drives are off by ten to thirty per cent; a factor of two and more is a wrong unit or column.
_USUAL = Usual(1.0, 1.0, 0.2, factor=True)


@final
@dataclass(frozen=True)
class TorqueConstant(ScaledDrive):
    """The drive delivers factor times the torque that it reports.

    Attributes:
        factor: delivered / reported torque.
    """

    factor: float = field(metadata=number("1", 1.0, 0.2, 5.0, 0.1, usual=_USUAL))

    explanation = (
        "The torque constant in the drive is wrong, or the motor saturates: every torque is "
        "off by the same factor, in both directions of power."
    )
    experiment = (
        "Hang a known weight on the joint and hold it still from above and from below: the "
        "mean torque is off by the factor."
    )

    def factor_at(self, robot: Robot, motion: Motion) -> float:
        """Return the factor."""
        return self.factor


@final
@dataclass(frozen=True)
class TorqueOffset(JointEffect):
    """The drive delivers its reported torque plus a constant.

    Attributes:
        offset: delivered minus reported, on the motor output side [N m].
    """

    offset: float = field(metadata=number("N m", 0.0, -10000.0, 10000.0, 0.2))

    explanation = (
        "A current sensor has a zero error, or a constant load such as a tensioned cable is "
        "not in the model."
    )
    experiment = "Hold the joint unloaded, coming from both sides: the mean torque is not zero."

    def rotor_torque(self, robot: Robot, motion: Motion) -> FloatArray:
        """Return offset / N on the rotor, (..., m) [N m]."""
        ratio = robot.transmission.gear_ratio[self.gear(robot)]
        return self.on_rotor(robot, motion, self.offset / ratio)


@final
@dataclass(frozen=True)
class RotorInertia(GearNumbers):
    """The rotor's inertia, as it is felt behind the reduction.

    Attributes:
        reflected_inertia: N^2 I_r [kg m^2] at the motor output; replaces the robot's value.
    """

    reflected_inertia: float = field(metadata=number("kg m^2", 0.0, 0.0, 10000.0, 0.02))

    numbers = (("reflected_inertia", "rotor_inertia", 2),)
    explanation = "The rotor, amplified by the gear ratio squared, is heavier than the model says."
    experiment = (
        "Shake the joint fast with small strokes about a pose that carries no load: the extra "
        "torque follows the acceleration."
    )
    search = SearchOffer(expected=1.0)


def _screens(
    kind: type[CurrentLimit], robot: Robot, where: str, evidence: Evidence
) -> tuple[Screen, ...]:
    """Return one screen per limit that reported or needed torques suggest.

    Where a drive saturates most of the time, its report lies far above the limit, and what
    the motion needed lies just below it.

    None where a target and the law of its drive make the torque: the law holds the limit that
    the robot states, so that nothing was reported which a lower one could clip. What a clip
    explains there is what the law leaves out, such as how a target is held and how late it
    comes (on a Go2's targets ten limits of 0.7 to 2 N m, each "certain", of stated 24 and 45).

    None where the drive reports a current either: that is what flowed, within any limit. What
    a clip explains there is something else (the search for TIAGo's arm took four limits in the
    place of losses in its gears and of rotors, and did not end in 150 CPU seconds).
    """
    column, row = robot.transmission.index(where), robot.velocity_index(where)
    stated = bool(np.isfinite(robot.transmission.torque_limit[column]))
    fed_back = [motion.feedback_torque for motion in evidence.motions]
    if stated and any(own is not None and np.any(own[..., column]) for own in fed_back):
        return ()
    if evidence.currents is not None and evidence.currents[column]:
        return ()
    ratio = float(robot.transmission.gear_ratio[column])
    reported = [torque[:, column] * ratio for torque in evidence.reported]
    missing = [torque[:, row] for torque in evidence.unexplained]
    needed = [r - np.sign(ratio) * m for r, m in zip(reported, missing, strict=True)]
    seen, used = (np.abs(np.concatenate(parts)) for parts in (reported, needed))
    limits = [
        *np.quantile(seen, (0.5, 0.7, 0.8, 0.87, 0.93, 0.97, 0.99, 0.997)),
        *np.quantile(used, (0.3, 0.5, 0.7, 0.85, 0.95)),
    ]
    return tuple(
        Screen.fixed({"limit": float(limit)})
        for limit in np.unique(limits)
        if 1e-3 < limit < seen.max()
    )


@final
@dataclass(frozen=True)
class CurrentLimit(JointEffect):
    """The delivered torque is clipped although the log shows what was asked for.

    A torque that a log holds as a current is not clipped: a limit lies before the measurement.

    Attributes:
        limit: largest torque delivered, at the motor output [N m].
    """

    limit: float = field(metadata=number("N m", 1e6, 1e-3, 1e6, 1.0))

    explanation = "The drive or its motor saturates: beyond a torque it gives less than it reports."
    experiment = (
        "Ask for slowly growing torques against a fixed stop with a force sensor: beyond the "
        "limit the force no longer follows."
    )
    search = SearchOffer(screens=_screens)

    def drive(self, robot: Robot, motion: Motion, torque: FloatArray) -> FloatArray:
        """Return the clipped torque of this gear, (..., m)."""
        limit = np.full(robot.transmission.size, np.inf)
        column = self.gear(robot)
        limit[column] = self.limit / np.abs(robot.transmission.gear_ratio[column])
        return np.clip(torque, -limit, limit)


@final
@dataclass(frozen=True)
class ActuationDelay(JointEffect):
    """The drive delivers its reported torque `delay` later.

    Along a log the torque is that of `delay` earlier. A simulator carries the torque that is on
    its way: what it delivers over a step is the mean of the command over the same time `delay`
    earlier, and nothing before the first command. A lone sample without past passes unchanged,
    because a controller cannot undo a delay. Of a drive that follows a target, the target comes
    late: what the drive makes of its own measurement does not.

    Attributes:
        delay: [s].
    """

    delay: float = field(metadata=number("s", 0.0, 0.0, 0.2, 0.005))

    explanation = "Bus, filter and current loop take time: the motor follows an earlier torque."
    experiment = (
        "Shake the joint fast with a torque of two frequencies: the error grows with frequency "
        "and follows the rate of change of the torque."
    )

    def first_memory(self, robot: Robot) -> FloatArray:
        """Return the torque on its way, rows (since how long [s], torques [N m]): none."""
        return np.array([[np.max(self.delay), *np.zeros(np.size(self.delay))]])

    def next_memory(self, robot: Robot, motion: Motion, torque: FloatArray) -> FloatArray:
        """Return the torque on its way (p, 1 + k) after a step; what has arrived is forgotten."""
        if motion.memory is None:
            return self.first_memory(robot)
        sent = np.vstack((motion.memory.value, [0.0, *np.ravel(torque[self.gear(robot)])]))
        sent[:, 0] += motion.memory.step
        arrived = int((sent[1:, 0] >= np.max(self.delay)).sum())
        return sent[arrived:]

    def drive(self, robot: Robot, motion: Motion, torque: FloatArray) -> FloatArray:
        """Return the torque of `delay` earlier for this gear, (..., m)."""
        if motion.memory is not None:
            result, gear = np.array(torque), self.gear(robot)
            result[gear] = self._arriving(motion.memory, np.ravel(torque[gear])).reshape(
                np.shape(self.delay)
            )
            return result
        return self._shifted(robot, motion, torque, -1.0)

    def drive_inverse(self, robot: Robot, motion: Motion, torque: FloatArray) -> FloatArray:
        """Return the torque of `delay` later for this gear, (..., m)."""
        return self._shifted(robot, motion, torque, 1.0)

    def _arriving(self, memory: Memory, torque: FloatArray) -> FloatArray:
        """Return the mean (k,) of the command (steps, the last one now) over a step, delayed."""
        starts = np.concatenate((-memory.value[:, 0], [0.0, memory.step]))
        starts[0] = -np.inf
        held = np.vstack((memory.value[:, 1:], torque))
        passed = np.clip(starts[:, None], -np.ravel(self.delay), memory.step - np.ravel(self.delay))
        return np.asarray(np.sum(np.diff(passed, axis=0) * held, axis=0) / memory.step)

    def _shifted(self, robot: Robot, motion: Motion, torque: FloatArray, way: float) -> FloatArray:
        if motion.time is None or np.ndim(motion.time) != 1:
            return torque
        result = np.array(torque)
        own = np.zeros_like(torque) if motion.feedback_torque is None else motion.feedback_torque
        for column, delay in zip(np.ravel(self.gear(robot)), np.ravel(self.delay), strict=True):
            late = torque[:, column] - own[:, column]
            shifted = np.interp(motion.time + way * delay, motion.time, late)
            result[:, column] = shifted + own[:, column]
        return result
