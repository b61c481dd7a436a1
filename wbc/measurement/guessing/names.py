"""What the name of a foreign column suggests: quantity, unit, and whose it is."""

from __future__ import annotations

import re
from dataclasses import dataclass

from wbc.measurement.columns.units import LOG_UNITS
from wbc.measurement.schema import JOINT_QUANTITIES, split_column

_UNITS = {
    "rad": "rad",
    "deg": "deg",
    "rpm": "rpm",
    "turn": "turn",
    "turns": "turn",
    "ms": "ms",
    "us": "us",
    "ns": "ns",
    "s": "s",
    "sec": "s",
    "seconds": "s",
    "nm": "N m",
    "mnm": "mN m",
    "ncm": "N cm",
    "n": "N",
    "a": "A",
    "ma": "mA",
    "v": "V",
    "m": "m",
    "mm": "mm",
    "c": "deg C",
    "rad s": "rad/s",
    "deg s": "deg/s",
    "m s": "m/s",
    "mm s": "mm/s",
    "n m": "N m",
}
_QUANTITIES = {
    "time": ("time", "t", "stamp", "timestamp", "clock"),
    "position": ("q", "pos", "position", "theta", "phi", "angle", "ang"),
    "velocity": ("v", "dq", "qd", "vel", "velocity", "w", "omega", "speed", "qdot"),
    "motor_torque": ("tau", "torque", "trq", "effort", "force"),
    "current": ("i", "cur", "current", "amp", "amps"),
    "temperature": ("temp", "temperature"),
}
_OF_UNITS = {
    "rad": "position",
    "deg": "position",
    "turn": "position",
    "rad/s": "velocity",
    "deg/s": "velocity",
    "m/s": "velocity",
    "mm/s": "velocity",
    "rpm": "velocity",
    "N m": "motor_torque",
    "mN m": "motor_torque",
    "A": "current",
    "mA": "current",
}
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
    spaced = re.sub(r"([a-z])([A-Z])", r"\1 \2", name)
    tokens = [t.lower() for t in re.findall(r"[A-Za-z]+|[0-9]+", spaced)]
    unit, left = _unit(tokens)
    quantity, rest = _quantity(left)
    if quantity and unit and not _fits(quantity, unit):
        unit = ""
        quantity, rest = _quantity(tokens)
    if not quantity and unit in _OF_UNITS:
        quantity = _OF_UNITS[unit]
    if quantity and _TARGETS & set(rest):
        quantity = f"target_{quantity}" if quantity in ("position", "velocity") else ""
    owner = "_".join(t for t in rest if t not in _FILL | _TARGETS)
    return NameGuess(name, quantity, unit, owner, bool({"motor", "rotor"} & set(rest)))


def _fits(quantity: str, unit: str) -> bool:
    kinds = ("s",) if quantity == "time" else JOINT_QUANTITIES[quantity]
    return LOG_UNITS[unit][0] in kinds


def _unit(tokens: list[str]) -> tuple[str, list[str]]:
    """Return (unit, the other words); a unit stands at the end."""
    for count in (2, 1):
        said = " ".join(tokens[-count:])
        if len(tokens) > count and said in _UNITS:
            return _UNITS[said], tokens[:-count]
    return "", tokens


def _quantity(tokens: list[str]) -> tuple[str, list[str]]:
    for quantity, words in _QUANTITIES.items():
        for k, token in enumerate(tokens):
            if token in words:
                return quantity, tokens[:k] + tokens[k + 1 :]
    return "", tokens
