"""Arrow columns as NumPy arrays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc.errors import LogError
from wbc.extras import needs
from wbc.measurement.formats.table import Chunk

with needs("logs", "reading CSV and Parquet files"):
    import pyarrow as pa
    import pyarrow.compute as pc


def batch_columns(batch: Any, numbers: Sequence[str], keys: Sequence[str], label: str) -> Chunk:
    """Return the columns of a record batch: numbers as float64 (empty cells NaN), keys as text.

    Raises:
        LogError: a column of numbers holds something else.
    """
    columns: dict[str, NDArray[Any]] = {}
    for name in numbers:
        column = batch.column(batch.schema.get_field_index(name))
        kind = column.type
        if not (
            pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_boolean(kind)
        ):
            raise LogError(f"{label}: column '{name}' holds {kind} instead of numbers.")
        values = pc.cast(column, pa.float64(), safe=False).to_numpy(zero_copy_only=False)
        columns[name] = np.asarray(values, dtype=np.float64)
    for name in keys:
        column = batch.column(batch.schema.get_field_index(name))
        columns[name] = np.asarray([str(value) for value in column.to_pylist()], dtype=np.str_)
    return columns
