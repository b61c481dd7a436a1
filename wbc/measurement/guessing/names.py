"""What the name of a foreign column suggests: quantity, unit, and whose it is."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from wbc.measurement.columns.units import LOG_UNITS
from wbc.measurement.schema import JOINT_QUANTITIES, split_column

_KINDS = {"s", *(unit for units in JOINT_QUANTITIES.values() for unit in units)} - {"1"}
_NAMED = [unit for unit, (kind, _) in LOG_UNITS.items() if kind in _KINDS]
_UNITS = {
    **{unit.lower().replace("/", " ").replace("^", " "): unit for unit in _NAMED},
    **{unit.lower().replace(" ", ""): unit for unit in _NAMED if "/" not in unit},
    **{"turns": "turn", "sec": "s", "seconds": "s", "c": "deg C"},
}
"""Words of a name in lower case -> the unit that they name."""

_QUANTITIES = {
    "time": ("time", "t", "stamp", "timestamp", "clock"),
    "position": ("q", "pos", "position", "theta", "phi", "angle", "ang"),
    "velocity": ("v", "dq", "qd", "vel", "velocity", "w", "omega", "speed", "qdot"),
    "motor_torque": ("tau", "torque", "trq", "effort", "force"),
    "current": ("i", "cur", "current", "amp", "amps"),
    "temperature": ("temp", "temperature"),
}
_OF_KINDS = {
    "rad": "position",
    "rad/s": "velocity",
    "m/s": "velocity",
    "N m": "motor_torque",
    "A": "current",
}
"""What a unit measures -> the quantity that a name without one means."""
_TARGETS = {"cmd", "ref", "des", "desired", "target", "goal", "command", "commanded", "set"}
_FILL = {"meas", "measured", "act", "actual", "reported", "joint", "motor", "rotor", "state", "est"}


@dataclass(frozen=True)
class NameGuess:
    """What a name suggests.

    Attributes:
        name: of the foreign column.
        quantity: of the schema, `time`, or empty where nothing is suggested.
        unit: as a column map names it; empty where none is suggested.
        owner: what is left of the name: a joint, by name or number.
        rotor: whether the name speaks of the motor or rotor.
    """

    name: str
    quantity: str
    unit: str
    owner: str
    rotor: bool = False


def guess_name(name: str) -> NameGuess:
    """Return what a name suggests; a name of the schema says what it is."""
    native = split_column(name)
    if native is not None:
        return NameGuess(name, native[1], "", native[0])
    unit, left = _unit(name)
    quantity, rest = _quantity(left)
    if not quantity and unit:
        quantity = _OF_KINDS.get(LOG_UNITS[unit][0], "")
    if unit and not _fits(quantity, unit):
        unit = ""  # a word that only looks like one: the v of hip_v
        quantity, rest = _quantity(_words(name))
    if quantity and _TARGETS & set(rest):
        quantity = f"target_{quantity}" if quantity in ("position", "velocity") else ""
    owner = "_".join(t for t in rest if t not in _FILL | _TARGETS)
    return NameGuess(name, quantity, unit, owner, bool({"motor", "rotor"} & set(rest)))


def joints_of(owners: Sequence[str], joints: Sequence[str]) -> tuple[dict[str, str], set[str]]:
    """Return owner -> joint, by name where names agree, else by place; and which by name."""
    named: dict[str, str] = {}
    for owner in owners:
        words = set(owner.lower().split("_")) - {""}
        fitting = [
            joint
            for joint in joints
            if joint not in named.values()
            and (joint == owner or (words and words <= set(joint.lower().split("_"))))
        ]
        if len(fitting) == 1:
            named[owner] = fitting[0]
    by_name = set(named)
    left = [joint for joint in joints if joint not in named.values()]
    for owner in owners:
        if owner not in named and left:
            named[owner] = left.pop(0)
    return named, by_name


def _fits(quantity: str, unit: str) -> bool:
    kinds = ("s",) if quantity == "time" else JOINT_QUANTITIES.get(quantity, ())
    return LOG_UNITS[unit][0] in kinds


def _words(name: str) -> list[str]:
    """Return the words and numbers of a name in lower case; `hipVel` is two words."""
    spaced = re.sub(r"([a-z])([A-Z])", r"\1 \2", name)
    return [word.lower() for word in re.findall(r"[A-Za-z]+|[0-9]+", spaced)]


def _unit(name: str) -> tuple[str, list[str]]:
    """Return (unit, the other words); a unit stands at the end.

    The capital of `mNm` or `mA` begins no word.
    """
    for found in (list(re.finditer(r"[A-Za-z]+|[0-9]+", name)), None):
        words = [match[0].lower() for match in found] if found else _words(name)
        for count in (3, 2, 1):
            said = " ".join(words[-count:])
            if len(words) > count and said in _UNITS:
                left = _words(name[: found[-count].start()]) if found else words[:-count]
                return _UNITS[said], left
    return "", _words(name)


def _quantity(tokens: list[str]) -> tuple[str, list[str]]:
    for quantity, words in _QUANTITIES.items():
        for k, token in enumerate(tokens):
            if token in words:
                return quantity, tokens[:k] + tokens[k + 1 :]
    return "", tokens
