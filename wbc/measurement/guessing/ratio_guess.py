"""Gear ratios that a log tells: it holds the motion of a joint on both sides of its gear."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wbc.arrays import FloatArray
from wbc.measurement.columns.units import LOG_UNITS
from wbc.measurement.formats.open_table import open_table
from wbc.measurement.formats.table import Table
from wbc.measurement.guessing.names import NameGuess, guess_name, joints_of

_PLACES = ("velocity", "position")
_EXPLAINED = 0.99
"""Share of the motor's motion that the joint's must explain: play, flexible gears and noise leave
little, and at this share the ratio is off by no more than a hundredth."""
_DIRECT = 0.1
"""How close to 1 a ratio may be: a motor's motion is often reported in units of the joint, and then
it tells no ratio."""


@dataclass(frozen=True)
class RatioGuess:
    """A gear ratio from the rows of a log.

    Attributes:
        value: turns of the motor per turn of the joint, without sign.
        source: the columns that tell it.
    """

    value: float
    source: str


def guess_ratios(path: str | Path, joints: Sequence[str]) -> Mapping[str, RatioGuess]:
    """Return the gear ratios of those joints whose motion a log holds on both sides of the gear.

    Names say which column is the motor's (`knee_motor_vel` beside `knee_vel`). Nothing is said
    where only one of the two names its unit: then the ratio may be a matter of units.

    Args:
        path: a log.
        joints: of the robot, with one degree of freedom.
    """
    table = open_table(Path(path))
    guesses = [g for g in map(guess_name, table.names) if g.quantity in _PLACES]
    own = {(g.owner, g.quantity): g for g in guesses if not g.rotor}
    named, _ = joints_of(list(dict.fromkeys(owner for owner, _ in own)), joints)
    found: dict[str, RatioGuess] = {}
    for quantity in _PLACES:
        for rotor in guesses:
            joint = own.get((rotor.owner, quantity))
            name = named.get(rotor.owner)
            if not rotor.rotor or rotor.quantity != quantity or joint is None or name is None:
                continue
            if (value := _ratio(table, rotor, joint)) and name not in found:
                found[name] = RatioGuess(value, f"'{rotor.name}' over '{joint.name}' in the log")
    return found


def _ratio(table: Table, rotor: NameGuess, joint: NameGuess) -> float:
    """Return how many times one column follows the other; 0 where the rows do not tell."""
    if bool(rotor.unit) != bool(joint.unit):
        return 0.0
    x, y = (_in_log_units(table, column) for column in (joint, rotor))
    known = np.isfinite(x) & np.isfinite(y)
    if known.sum() < 3 or np.ptp(x[known]) == 0.0:
        return 0.0
    x, y = (values[known] - np.mean(values[known]) for values in (x, y))
    slope = float(x @ y / (x @ x))
    if not slope or float(np.sum((y - slope * x) ** 2)) > (1.0 - _EXPLAINED) * float(y @ y):
        return 0.0
    # Read from the motor, whose encoder turns N times further: its noise counts the least.
    ratio = abs(float(y @ y) / float(x @ y))
    return float(f"{ratio:.4g}") if abs(ratio - 1.0) > _DIRECT else 0.0


def _in_log_units(table: Table, column: NameGuess) -> FloatArray:
    values = np.concatenate([chunk[column.name] for chunk in table.chunks([column.name], [])])
    return np.asarray(values * (LOG_UNITS[column.unit][1] if column.unit else 1.0))
