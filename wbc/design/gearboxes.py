"""Catalogues of gearboxes, and efficiencies by load and speed: tables with their sources."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from pathlib import Path

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import DesignError, unknown_name

SHIPPED = Path(__file__).with_name("gearboxes.csv")
_TEXTS = ("name", "kind", "source")
_NUMBERS = ("reduction", "forward_efficiency", "backward_efficiency", "gear_inertia")


@dataclass(frozen=True)
class Gearbox:
    """One row of the catalogue.

    Attributes:
        name: unique in the table.
        kind: planetary, cycloidal, strain wave, direct drive, ...
        reduction: N.
        forward_efficiency, backward_efficiency: the motor drives the joint, the joint the motor.
        gear_inertia: of the gearbox at the motor's shaft [kg m^2]; it adds to the rotor's.
        source: where the numbers stand.

    A number that no source gives is None.
    """

    name: str
    kind: str
    reduction: float | None
    forward_efficiency: float | None
    backward_efficiency: float | None
    gear_inertia: float | None
    source: str

    @property
    def unknown(self) -> tuple[str, ...]:
        """Names of the numbers that no source gives."""
        return tuple(name for name in _NUMBERS if getattr(self, name) is None)


def read_gearboxes(path: str | Path | None = None) -> dict[str, Gearbox]:
    """Return the catalogue by name: the one that is shipped, or a CSV of the same columns.

    Raises:
        DesignError: no such file, other columns, a number that is none, a row without a source.
    """
    place = Path(path) if path else SHIPPED
    rows, wanted = _rows(place, "the catalogue"), {*_TEXTS, *_NUMBERS}
    if not rows or set(rows[0]) != wanted:
        raise DesignError(f"the catalogue '{place}' needs the columns {', '.join(sorted(wanted))}.")
    boxes = [_row(row, f"'{place}', line {number}") for number, row in enumerate(rows, 2)]
    found = {box.name: box for box in boxes}
    if len(found) < len(boxes):
        raise DesignError(f"the catalogue '{place}' holds a name twice.")
    return found


def _rows(place: Path, what: str) -> list[dict[str, str]]:
    """Return the rows of a CSV by column.

    Raises:
        DesignError: no such file, or none of text.
    """
    try:
        return list(csv.DictReader(place.read_text(encoding="utf-8").splitlines()))
    except (OSError, UnicodeDecodeError) as cause:
        raise DesignError(f"{what} '{place}' cannot be read: {cause}.") from cause


def choose_gearboxes(names: str, catalogue: Mapping[str, Gearbox]) -> tuple[Gearbox, ...]:
    """Return the gearboxes of `NAME,NAME,...`; `all` stands for those with a forward efficiency.

    Raises:
        DesignError: an unknown name.
    """
    if names == "all":
        return tuple(box for box in catalogue.values() if box.forward_efficiency is not None)
    chosen = []
    for name in names.split(","):
        if name.strip() not in catalogue:
            raise DesignError(unknown_name("gearbox", name.strip(), catalogue))
        chosen.append(catalogue[name.strip()])
    return tuple(chosen)


def _row(row: Mapping[str, str], place: str) -> Gearbox:
    numbers: dict[str, float | None] = {}
    for name in _NUMBERS:
        text = (row[name] or "").strip()
        try:
            numbers[name] = float(text) if text else None
        except ValueError as cause:
            raise DesignError(f"{place}: {name}: '{text}' is not a number.") from cause
        if not isfinite(numbers[name] or 0.0):
            raise DesignError(f"{place}: {name}: '{text}' is no finite number; leave it empty.")
    if not (row["name"] or "").strip() or not (row["source"] or "").strip():
        raise DesignError(f"{place}: a gearbox needs a name and the source of its numbers.")
    return Gearbox(
        name=row["name"].strip(), kind=row["kind"].strip(), source=row["source"].strip(), **numbers
    )


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
        from scipy.interpolate import RegularGridInterpolator  # which few studies need

        # An axis of one value gets a second place with the same efficiencies.
        axes = [a if len(a) > 1 else (*a, a[0] + 1.0) for a in (self.load, self.speed)]
        table = np.stack([self.forward, self.backward], axis=-1)
        more = [(0, len(a) - n) for a, n in zip(axes, table.shape, strict=False)]
        grid = RegularGridInterpolator(axes, np.pad(table, [*more, (0, 0)], mode="edge"))
        found = grid((inside, np.full(inside.shape, rate)))
        return np.asarray(found[..., 0]), np.asarray(found[..., 1])


def read_efficiency_table(path: str | Path) -> EfficiencyTable:
    """Return the table of a CSV with load, forward_efficiency, backward_efficiency, maybe speed.

    Raises:
        DesignError: no such file, other columns, no full grid, an efficiency outside its range.
    """
    place = Path(path)
    rows = _rows(place, "--efficiency")
    try:
        found = [[float(row.get(name) or 0.0) for name in _NAMES] for row in rows]
    except ValueError as cause:
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
