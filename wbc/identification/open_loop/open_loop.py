"""The open-loop error: the robot simulated from measured states, without looking at the log again.

The residual says which torque is missing; this says what that does to the motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import LogError, SimulationError
from wbc.identification.open_loop.simulated import SimulatedLog
from wbc.identification.records.preparation import prepare
from wbc.measurement import Log, cut_at_gaps
from wbc.robot import Robot

HORIZONS = (0.1, 0.5, 2.0)
"""Times after the start at which positions are compared [s]."""

_STARTS = 12  # over all logs: an rms of as many independent errors is known within 20 %
_APART = 0.5  # [s] between starts at least; closer ones say the same


@dataclass(frozen=True, eq=False)
class OpenLoop:
    """Position errors of a robot that was simulated from measured states.

    Attributes:
        joints: names of the joints with a position, j of them.
        units: of their positions, rad or m.
        horizons: times after a start [s], h of them.
        error: (j, h) rms of simulated minus measured position; NaN where the logs are too short,
            infinite where a simulation ended before.
        moved: (j, h) rms of how far the joint moved in that time: the error of a joint that stays.
        starts: (h,) how many starts each column holds.
        reason: why nothing could be simulated; empty if it could.
    """

    joints: tuple[str, ...]
    units: tuple[str, ...]
    horizons: tuple[float, ...]
    error: FloatArray
    moved: FloatArray
    starts: tuple[int, ...]
    reason: str = ""

    def to_json(self) -> dict[str, Any]:
        """Return plain numbers, texts, lists and dictionaries."""
        return {
            "horizons": list(self.horizons),
            "starts": list(self.starts),
            "joints": {
                joint: {
                    "unit": unit,
                    "error": [_finite(x) for x in error],
                    "moved": [_finite(x) for x in moved],
                }
                for joint, unit, error, moved in zip(
                    self.joints, self.units, self.error, self.moved, strict=True
                )
            },
            "reason": self.reason,
        }


def open_loop(robot: Robot, logs: Sequence[Log], horizons: Sequence[float] = HORIZONS) -> OpenLoop:
    """Return how far `robot` strays from logs when it is simulated from their states.

    From starts spread evenly over the logs, the plant of `wbc.sim` runs with what the log says the
    drives were told: the recorded torque, or the law of the drive with the recorded target, which
    then sees the simulated motion. Forces at contacts are those recorded. A delay of targets
    (`actuation_delay`) delays the whole torque here, the drive's own measurement with it.

    Args:
        robot: with its effects.
        logs: at least one.
        horizons: times after a start at which positions are compared [s].

    Returns:
        The errors; with `reason` and NaN where nothing can be simulated (contacts whose forces
        nobody recorded, a joint without torque, links without inertia).

    Raises:
        IdentificationError: no log, or a log that lacks what the robot needs.
    """
    pieces, _ = cut_at_gaps(logs)
    names = robot.single_joints
    table = np.full((len(names), len(horizons)), np.nan)
    nothing = OpenLoop(
        joints=names,
        units=tuple("m" if _slides(robot, name) else "rad" for name in names),
        horizons=tuple(horizons),
        error=table,
        moved=table,
        starts=(0,) * len(horizons),
    )
    try:
        records = prepare(robot.without_effects().lossless(), pieces)
        simulated = [
            SimulatedLog.of(robot, log, record) for log, record in zip(pieces, records, strict=True)
        ]
    except (LogError, SimulationError) as error:
        return _because(nothing, str(error))
    misses: list[FloatArray] = []
    moves: list[FloatArray] = []
    for log, start in _starts(simulated, max(horizons)):
        missed, moved = log.missed(start, horizons)
        misses.append(missed)
        moves.append(moved)
    if not misses:
        return _because(nothing, f"no log is longer than {min(horizons):g} s beside its ends.")
    return OpenLoop(
        nothing.joints,
        nothing.units,
        nothing.horizons,
        error=_rms(np.stack(misses)),
        moved=_rms(np.stack(moves)),
        starts=tuple(int(n) for n in (~np.isnan(np.stack(moves)[:, 0])).sum(axis=0)),
    )


def _because(nothing: OpenLoop, reason: str) -> OpenLoop:
    return OpenLoop(
        nothing.joints,
        nothing.units,
        nothing.horizons,
        nothing.error,
        nothing.moved,
        nothing.starts,
        reason,
    )


def _starts(logs: Sequence[SimulatedLog], longest: float) -> list[tuple[SimulatedLog, float]]:
    """Return logs with times of their start [s], spread evenly over all that is long enough."""
    total = sum(log.length for log in logs)
    found = []
    for log in logs:
        room = max(log.length - longest, 0.0)
        wished = max(1, round(_STARTS * log.length / total)) if total > 0.0 else 0
        count = min(wished, 1 + int(room / _APART))
        found += [(log, log.first + room * (k + 0.5) / count) for k in range(count)]
    return found


def _rms(values: FloatArray) -> FloatArray:
    """Return the root mean square (j, h) of what is known of (starts, j, h)."""
    known = ~np.isnan(values)
    count = known.sum(axis=0)
    total = np.where(known, values, 0.0) ** 2
    return np.where(count > 0, np.sqrt(total.sum(axis=0) / np.maximum(count, 1)), np.nan)


def _slides(robot: Robot, joint: str) -> bool:
    kind = robot.model.joints[robot.model.getJointId(joint)].shortname()
    return kind.startswith("JointModelP") and not kind.startswith("JointModelPlanar")


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
