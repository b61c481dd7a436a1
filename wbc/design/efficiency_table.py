"""Efficiencies that depend on load and speed, as a table; used at the load that a gear holds."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from wbc.arrays import FloatArray
from wbc.errors import DesignError

_NAMES = ("load", "speed", "forward_efficiency", "backward_efficiency")


@dataclass(frozen=True)
class EfficiencyTable:
    """Efficiencies on a full grid of load and speed, linear in between, constant beyond its ends.

    Attributes:
        load: (L,) size of the torque at the gear's output [N m], rising.
        speed: (S,) size of the output speed [rad/s], rising; one value where it plays no part.
        forward, backward: L rows of S efficiencies.
    """

    load: tuple[float, ...]
    speed: tuple[float, ...]
    forward: tuple[tuple[float, ...], ...]
    backward: tuple[tuple[float, ...], ...]

    def at(self, load: FloatArray, speed: float) -> tuple[FloatArray, FloatArray]:
        """Return forward and backward efficiency for output torques of any shape [N m]."""
        inside = np.clip(np.abs(load), self.load[0], self.load[-1])
        rate = np.clip(abs(speed), self.speed[0], self.speed[-1])
        return self._read(self.forward, inside, rate), self._read(self.backward, inside, rate)

    def _read(
        self, values: tuple[tuple[float, ...], ...], load: FloatArray, speed: float
    ) -> FloatArray:
        table = np.array(values)
        if len(self.speed) == 1:
            return np.asarray(np.interp(load, self.load, table[:, 0]))
        if len(self.load) == 1:
            return np.full(load.shape, np.interp(speed, self.speed, table[0]))
        grid = RegularGridInterpolator((self.load, self.speed), table)
        points = np.stack([load, np.full(load.shape, speed)], axis=-1)
        return np.asarray(grid(points))


def read_efficiency_table(path: str | Path) -> EfficiencyTable:
    """Return the table of a CSV with load, forward_efficiency, backward_efficiency, maybe speed.

    Raises:
        DesignError: no such file, other columns, no full grid, an efficiency outside its range.
    """
    place = Path(path)
    try:
        rows = list(csv.DictReader(place.read_text(encoding="utf-8").splitlines()))
        found = [[float(row.get(name) or 0.0) for name in _NAMES] for row in rows]
    except (OSError, UnicodeDecodeError, ValueError) as cause:
        raise DesignError(f"--efficiency '{place}' cannot be read: {cause}.") from cause
    if not rows or not {"load", *_NAMES[2:]} <= set(rows[0]):
        raise DesignError(
            f"--efficiency '{place}' needs the columns load [N m], forward_efficiency, "
            "backward_efficiency, and speed [rad/s] where they depend on it."
        )
    load, speed = (tuple(sorted({row[k] for row in found})) for k in (0, 1))
    grid = {(row[0], row[1]): row[2:] for row in found}
    if len(grid) != len(found) or len(grid) != len(load) * len(speed) or min(load + speed) < 0.0:
        raise DesignError(
            f"--efficiency '{place}': give every load >= 0 with every speed >= 0, each pair once."
        )
    forward, backward = (tuple(tuple(grid[a, b][k] for b in speed) for a in load) for k in (0, 1))
    values = np.array([forward, backward])
    if not (np.all(values[0] > 0.0) and np.all(values <= 1.0)):
        raise DesignError(f"--efficiency '{place}': efficiencies lie in (0, 1], backward <= 1.")
    return EfficiencyTable(load, speed, forward, backward)
