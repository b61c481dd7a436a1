"""Inertias of a model file that no body can have: named with the link and the axis."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import RobotError

_ROUNDING = 1e-6  # of the largest principal value: digits of a printed matrix
_AXES = "xyz"


def check_inertias(path: Path) -> tuple[str, ...]:
    """Check the inertias about the centre of mass that a URDF or MJCF file states.

    Returns:
        Notes on links whose largest principal value is more than the sum of the others, which no
        distribution of mass has, though a controller can live with it.

    Raises:
        RobotError: an inertia that is not positive definite; a link would gain energy by turning.
    """
    notes = []
    for link, inertia in _stated(path):
        values, axes = np.linalg.eigh(inertia)
        limit = _ROUNDING * float(np.abs(values).max())
        principal = ", ".join(f"{value:.4g}" for value in values)
        if values[0] < -limit:
            axis = axes[:, 0] * np.sign(axes[np.argmax(np.abs(axes[:, 0])), 0])
            along = ", ".join(f"{part:.2f}" for part in axis)
            raise RobotError(
                f"{path}: the inertia of link '{link}' is not positive definite: its principal "
                f"values are {principal} kg m^2, the negative one about the axis ({along}). "
                "Correct its six numbers: a sign, the frame, or a product of inertia too large."
            )
        if values[2] > values[0] + values[1] + limit:
            notes.append(
                f"{path.name}: the inertia of link '{link}' is that of no body: of its principal "
                f"values {principal} kg m^2 the largest exceeds the sum of the others."
            )
    return tuple(notes)


def _stated(path: Path) -> Iterator[tuple[str, FloatArray]]:
    """Yield (link, inertia (3, 3)) of a file; parts that an MJCF includes are not looked at."""
    try:
        root = ET.parse(path).getroot()
    except (ET.ParseError, OSError):
        return
    for link in root.iter("link" if path.suffix == ".urdf" else "body"):
        for element in link.findall("inertial"):
            stated = element.find("inertia") if path.suffix == ".urdf" else element
            if stated is None:
                continue
            inertia = np.zeros((3, 3))
            full = [float(number) for number in stated.get("fullinertia", "").split()]
            for k, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))):
                key = f"i{_AXES[i]}{_AXES[j]}"
                value = full[k] if len(full) == 6 else float(stated.get(key, 0.0))
                inertia[i, j] = inertia[j, i] = value
            yield link.get("name", ""), inertia
