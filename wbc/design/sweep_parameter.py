"""What a study varies: a parameter of the gears, a link or a joint, and over which values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import DesignError, unknown_name

# Name in a study -> unit, and the field of the transmission.
_PARAMETERS = {
    "reduction": ("1", "gear_ratio"),
    "forward_efficiency": ("1", "forward_efficiency"),
    "backward_efficiency": ("1", "backward_efficiency"),
    "rotor_inertia": ("kg m^2", "rotor_inertia"),
    "rotor_friction": ("N m", "rotor_coulomb_friction"),
    "torque_limit": ("N m", "torque_limit"),
    "length": ("m", ""),
    "mass": ("kg", ""),
    "joint": ("rad or m", ""),
    "gearbox": ("1", ""),
    "time": ("s", ""),
}
GEAR_PARAMETERS = {name: field for name, (_, field) in _PARAMETERS.items() if field}
LINK_PARAMETERS = ("length", "mass")
NAMES = (*GEAR_PARAMETERS, *LINK_PARAMETERS, "joint")
LISTED = ("gearbox", "time")  # by the number in a catalogue, by the instant of a gait
DEFAULT_COUNT = 9  # values on a grid of a range that names no number: a table to read, not to trust


@dataclass(frozen=True)
class SweepParameter:
    """One parameter of a study.

    Attributes:
        name: one of `NAMES`, or of `LISTED` where a study makes it.
        place: joint of a gear (all gears alike when empty), link, or joint.
        low, high: the range; equal to the ends of `values` where those are given.
        count: number of values on a grid.
        logarithmic: whether a grid and random samples are even in the logarithm.
        values: the values themselves where they were listed, else empty.
    """

    name: str
    place: str
    low: float
    high: float
    count: int = DEFAULT_COUNT
    logarithmic: bool = False
    values: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        """Check the range."""
        if self.name not in (*NAMES, *LISTED):
            raise DesignError(unknown_name("parameter", self.name, NAMES))
        if self.name in (*LINK_PARAMETERS, "joint") and not self.place:
            what = "joint" if self.name == "joint" else "link"
            raise DesignError(f"{self.name}: name the {what}, as in {self.name}.NAME=LOW:HIGH.")
        if not (np.isfinite(self.low) and np.isfinite(self.high) and self.low <= self.high):
            raise DesignError(f"{self.column}={self.low:g}:{self.high:g} is no range.")
        if self.count < 1:
            raise DesignError(f"{self.column}: the number of values must be at least 1.")
        if self.logarithmic and self.low <= 0.0:
            raise DesignError(f"{self.column}: a logarithmic range must start above 0.")

    @property
    def column(self) -> str:
        """Name of the parameter's column in the table."""
        return f"{self.name}.{self.place}" if self.place else self.name

    @property
    def unit(self) -> str:
        """Unit of the values."""
        return _PARAMETERS[self.name][0]

    @property
    def grid(self) -> FloatArray:
        """The values of a grid (count,)."""
        if self.values:
            return np.array(self.values)
        if self.count == 1:
            return np.array([self.low])
        spaced = np.geomspace if self.logarithmic else np.linspace
        return np.asarray(spaced(self.low, self.high, self.count))

    def at(self, share: FloatArray) -> FloatArray:
        """Return the values at shares in [0, 1) of the range."""
        if self.values:
            places = np.minimum((share * len(self.values)).astype(np.int_), len(self.values) - 1)
            return np.asarray(np.array(self.values)[places])
        if self.logarithmic:
            return np.asarray(self.low * (self.high / self.low) ** share)
        return np.asarray(self.low + (self.high - self.low) * share)


def parse_sweep(text: str) -> SweepParameter:
    """Return the parameter of `NAME[.PLACE]=LOW:HIGH[:COUNT][:log]` or `NAME[.PLACE]=V,V,...`.

    Raises:
        DesignError: text of another form, an unknown name, no range.
    """
    left, equals, right = text.partition("=")
    name, _, place = left.strip().partition(".")
    if name in LISTED:
        raise DesignError(unknown_name("parameter", name, NAMES))
    form = "use NAME=LOW:HIGH, NAME=LOW:HIGH:COUNT, NAME=LOW:HIGH:COUNT:log or NAME=V,V,..."
    if not equals or not right.strip():
        raise DesignError(f"--sweep '{text}': {form}.")
    try:
        if ":" not in right:
            values = tuple(float(value) for value in right.split(","))
            return SweepParameter(name, place, min(values), max(values), len(values), values=values)
        parts = right.split(":")
        logarithmic = parts[-1].strip() == "log"
        numbers = parts[:-1] if logarithmic else parts
        if len(numbers) not in (2, 3):
            raise DesignError(f"--sweep '{text}': {form}.")
        low, high = float(numbers[0]), float(numbers[1])
        count = int(numbers[2]) if len(numbers) == 3 else DEFAULT_COUNT
    except ValueError as cause:
        raise DesignError(f"--sweep '{text}': {cause}; {form}.") from cause
    return SweepParameter(name, place, low, high, count, logarithmic)
