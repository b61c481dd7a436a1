"""Columns of a file, read and written without the library."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

Columns = dict[str, np.ndarray]


def read_columns(path: Path) -> Columns:
    with path.open(encoding="utf-8") as file:
        names = file.readline().strip().split(",")
        return dict(zip(names, np.loadtxt(file, delimiter=",", unpack=True), strict=True))


def write_columns(columns: Mapping[str, np.ndarray], path: Path) -> Path:
    rows = np.column_stack(list(columns.values()))
    np.savetxt(path, rows, "%.12g", ",", header=",".join(columns), comments="")
    return path
