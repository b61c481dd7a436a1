"""Torque that arrives late."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects.joint_effect import JointEffect
from wbc.robot import Memory, Motion, Parameter, Robot


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

    delay: float

    name = "actuation_delay"
    parameters = (Parameter("delay", "s", 0.0, 0.0, 0.2, 0.005),)
    explanation = (
        "Bus, filter and current loop take time: the motor follows the torque that was asked "
        "for a moment ago."
    )
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
