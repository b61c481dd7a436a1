"""Which parameters of a linear model its logs tell, and what each stands for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.arrays import FloatArray
from wbc.dynamics import inertial_parameters
from wbc.robot import Robot

_DEPENDENT = 1e-5  # of a column, that must be left beside those before it
_NOTHING = 1e-6  # coefficients between columns of one length, that rounding makes
_SHOWN = 1e-3  # coefficients that are written out
_LONGEST = 3  # terms of a combination that are written out

# In pinocchio's order of a link's ten parameters.
_LINK = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
_UNITS = ("kg", *["kg m"] * 3, *["kg m^2"] * 6)


def link_names(robot: Robot) -> list[tuple[str, str, float]]:
    """Return name, unit and value as drawn of all parameters of the links, in order."""
    values = inertial_parameters(robot)
    names = [
        (f"{name} {body}", unit)
        for body in robot.bodies
        for name, unit in zip(_LINK, _UNITS, strict=True)
    ]
    return [(*name, float(value)) for name, value in zip(names, values, strict=True)]


def base_columns(matrix: FloatArray) -> tuple[list[int], FloatArray]:
    """Return the columns that do not depend on those before, and what the others are of them.

    Args:
        matrix: (rows, n).

    Returns:
        numbers of the k independent columns, and (k, n - k) coefficients: each other column is
        the sum of these with the coefficients of its own.
    """
    size = np.sqrt(np.sum(matrix**2, axis=0))
    felt = size > 1e-9 * size.max(initial=1e-300)
    scaled = matrix / np.where(felt, size, 1.0)
    basis = np.zeros((len(matrix), 0))
    kept = []
    for k in np.flatnonzero(felt):
        rest = scaled[:, k] - basis @ (basis.T @ scaled[:, k])
        rest -= basis @ (basis.T @ rest)  # twice is enough
        length = float(np.linalg.norm(rest))
        if length > _DEPENDENT:
            kept.append(int(k))
            basis = np.column_stack([basis, rest / length])
    others = [k for k in range(matrix.shape[1]) if k not in kept]
    mixing = np.linalg.lstsq(scaled[:, kept], scaled[:, others], rcond=None)[0]
    mixing[np.abs(mixing) < _NOTHING] = 0.0
    mixing = mixing * np.where(felt[others], size[others], 0.0) / size[kept][:, None]
    return kept, np.asarray(mixing)


def combination(coefficients: FloatArray, names: Sequence[str]) -> str:
    """Return the terms of a combination as text, the largest first."""
    order = np.argsort(-np.abs(coefficients))
    terms = [f"{coefficients[k]:+.3g} {names[k]}" for k in order if abs(coefficients[k]) > _SHOWN]
    more = [f"and {len(terms) - _LONGEST} more"] if len(terms) > _LONGEST else []
    return " ".join([*terms[:_LONGEST], *more])
