"""Joints whose columns were taken for one another."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from wbc.arrays import FloatArray, frozen
from wbc.identification.agreement import Agreement, agreement
from wbc.identification.model.residual import condensed_residual
from wbc.identification.records.record import Record
from wbc.identification.silent_drives import reported_torque
from wbc.robot import Motion

_FITS = 0.95  # correlation of report and need that an exchange must reach, and a good name has
_GAIN = 2.5  # times by which the reports may then be too large or too small
_BETTER = 4.0  # times by which the exchange lowers what is left unexplained of both


def swapped_joints(records: Sequence[Record], agreements: Sequence[Agreement]) -> list[str]:
    """Return a warning for every pair of joints of which columns seem to be exchanged.

    So it seems where both reports follow what the motion needs once the positions, the torques or
    both are exchanged, and do not as they are named.

    Args:
        records: the logs.
        agreements: of each.
    """
    found: dict[tuple[tuple[int, int], str], list[tuple[str, FloatArray]]] = {}
    for record, given in zip(records, agreements, strict=True):
        lost = np.flatnonzero(given.correlation < _FITS)
        for pair in combinations(map(int, lost), 2):
            named = given.correlation[list(pair)]
            fits = [
                (other.correlation[list(pair)], what)
                for what, other in _exchanged(record, pair)
                if _explains(other, given, pair)
            ]
            if fits:
                then, what = max(fits, key=lambda fit: float(fit[0].min()))
                found.setdefault((pair, what), []).append((record.name, np.stack([named, then])))
    joints = records[0].robot.transmission.joints
    return [
        _warning((joints[a], joints[b]), what, seen, len(records))
        for ((a, b), what), seen in found.items()
    ]


def _exchanged(record: Record, pair: tuple[int, int]) -> Iterator[tuple[str, Agreement]]:
    """Yield what is exchanged between two joints, and how reports follow needs then."""
    ratio = record.robot.transmission.gear_ratio[list(pair)]
    for where in ("", "positions"):
        moved = record if not where else record.along(_motion_swapped(record, pair))
        residual = condensed_residual(record.robot, [moved])
        if where:
            yield where, agreement(moved, residual)
        needed = reported_torque(moved) - residual
        what = "positions and torques" if where else "torques"
        # Columns of rotor torques were exchanged, or of motor torques (N times those).
        for side in {1.0, float(ratio[1] / ratio[0])}:
            torque = _swapped(record.torque, pair)
            scaled = np.ones(torque.shape[1])
            scaled[list(pair)] = side, 1.0 / side
            crossed = replace(moved, torque=torque * scaled)
            yield what, agreement(crossed, reported_torque(crossed) - needed)


def _explains(other: Agreement, given: Agreement, pair: tuple[int, int]) -> bool:
    rows = list(pair)
    left, before = (1.0 - a.correlation[rows] ** 2 for a in (other, given))
    return bool(
        np.all(other.correlation[rows] > _FITS)
        and np.all(np.abs(np.log(np.maximum(other.gain[rows], 1e-300))) < np.log(_GAIN))
        and np.all(_BETTER * left < before)
    )


def _motion_swapped(record: Record, pair: tuple[int, int]) -> Motion:
    robot, motion = record.robot, record.motion
    names = [robot.transmission.joints[k] for k in pair]
    places = (robot.position_index(names[0]), robot.position_index(names[1]))
    speeds = (robot.velocity_index(names[0]), robot.velocity_index(names[1]))
    return motion.replace(
        position=_swapped(motion.position, places),
        velocity=_swapped(motion.velocity, speeds),
        acceleration=_swapped(motion.acceleration, speeds),  # type: ignore[arg-type]
    )


def _swapped(values: FloatArray, pair: tuple[int, int]) -> FloatArray:
    """Return a copy of `values` (N, k) with two columns exchanged."""
    exchanged = values.copy()
    exchanged[:, pair] = values[:, pair[::-1]]
    return frozen(exchanged)


def _warning(
    joints: tuple[str, str], what: str, seen: Sequence[tuple[str, FloatArray]], count: int
) -> str:
    first, second = joints
    where = "" if len(seen) == count else f" in {', '.join(name for name, _ in seen)}"
    named, then = np.mean([correlations for _, correlations in seen], axis=0)
    return (
        f"the {what} of {first} and {second} are exchanged{where}? If so, the reported torques "
        f"follow what the motion needs (correlation {then[0]:.2f} and {then[1]:.2f} instead of "
        f"{named[0]:.2f} and {named[1]:.2f}). Check the names of the columns, or map them "
        "(--columns MAP.toml)."
    )
