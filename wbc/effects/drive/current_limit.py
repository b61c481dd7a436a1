"""A drive that cannot give what it was asked for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects.joint_effect import JointEffect
from wbc.robot import Evidence, Motion, Parameter, Robot, Screen, SearchOffer


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
    if stated and any(_follows_target(motion, column) for motion in evidence.motions):
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

    limit: float

    name = "current_limit"
    parameters = (Parameter("limit", "N m", 1e6, 1e-3, 1e6, 1.0),)
    explanation = (
        "The drive limits its current, or the motor saturates: beyond a certain torque the "
        "motor gives less than the log says."
    )
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


def _follows_target(motion: Motion, column: int) -> bool:
    """Whether the torque of a gear was made of a target and what its drive measures."""
    own = motion.feedback_torque
    return own is not None and bool(np.any(own[..., column]))
