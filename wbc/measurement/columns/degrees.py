"""Which columns of a joint turn with its encoder, and the map for a log in degrees."""

from __future__ import annotations

from collections.abc import Sequence

from wbc.measurement.columns.map_table import Mend
from wbc.measurement.log import Log

_UNITS = {
    "position": "deg",
    "velocity": "deg/s",
    "acceleration": "deg/s^2",
    "target_position": "deg",
    "target_velocity": "deg/s",
}


def encoder_columns(log: Log, joint: str) -> list[str]:
    """Return the columns of a joint that turn with its encoder."""
    return [name for quantity in _UNITS if (name := f"{joint}.{quantity}") in log.columns]


def in_degrees(log: Log, joints: Sequence[str]) -> Mend:
    """Return what a column map says of joints whose encoder columns are in degrees."""
    return {
        "columns": {
            name: {"unit": _UNITS[name.removeprefix(f"{joint}.")]}
            for joint in joints
            for name in encoder_columns(log, joint)
        }
    }
