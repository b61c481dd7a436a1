"""Catalogues of gearboxes: tables with their sources."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from pathlib import Path

from wbc.errors import DesignError, require_known

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
    wanted = {*_TEXTS, *_NUMBERS}
    try:
        rows = list(csv.DictReader(place.read_text(encoding="utf-8").splitlines()))
    except (OSError, UnicodeDecodeError) as cause:
        raise DesignError(f"the catalogue '{place}' cannot be read: {cause}.") from cause
    if not rows or set(rows[0]) != wanted:
        raise DesignError(f"the catalogue '{place}' needs the columns {', '.join(sorted(wanted))}.")
    boxes = [_row(row, f"'{place}', line {number}") for number, row in enumerate(rows, 2)]
    found = {box.name: box for box in boxes}
    if len(found) < len(boxes):
        raise DesignError(f"the catalogue '{place}' holds a name twice.")
    return found


def choose_gearboxes(names: str, catalogue: Mapping[str, Gearbox]) -> tuple[Gearbox, ...]:
    """Return the gearboxes of `NAME,NAME,...`; `all` stands for those with a forward efficiency.

    Raises:
        DesignError: an unknown name.
    """
    if names == "all":
        return tuple(box for box in catalogue.values() if box.forward_efficiency is not None)
    chosen = []
    for name in names.split(","):
        require_known(DesignError, "gearbox", name.strip(), catalogue)
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
