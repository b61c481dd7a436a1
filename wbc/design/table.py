"""The table of a study: parts that appear whole, joined into one Parquet file at the end.

While a study runs, `FILE.parts/` holds its key and one Parquet file per finished chunk. A part is
written to a temporary name and renamed, so that a killed run leaves whole parts only; the next run
with the same key evaluates the rest. At the end the parts are joined in order and removed.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import DesignError
from wbc.extras import needs
from wbc.files import atomic_write, write_text

with needs("design", "the table of a design study"):
    import pyarrow as pa
    import pyarrow.parquet as pq

_KEY = b"wbc.study"


@dataclass(frozen=True)
class DesignTable:
    """Where the results of one study go.

    Attributes:
        path: the Parquet file at the end.
        key: what the results depend on.
        units: column -> unit, written beside each column.
        chunks: how many parts there will be.
    """

    path: Path
    key: Mapping[str, Any]
    units: Mapping[str, str]
    chunks: int

    @property
    def parts(self) -> Path:
        """Folder of the parts while the study runs."""
        return self.path.with_name(self.path.name + ".parts")

    def begin(self) -> set[int]:
        """Return the chunks that are there already; all of them for a finished table.

        Raises:
            DesignError: the file or the parts belong to another study.
        """
        if self.path.exists():
            if _stored_key(self.path) != self.key:
                raise self._foreign(self.path)
            return set(range(self.chunks))
        known = self.parts / "study.json"
        if known.exists():
            if json.loads(known.read_text("utf-8")) != self.key:
                raise self._foreign(self.parts)
        else:
            write_text(known, json.dumps(self.key, indent=1))
        found = {int(part.stem) for part in self.parts.glob("[0-9]*.parquet")}
        return {number for number in found if number < self.chunks}

    def add(self, chunk: int, columns: Mapping[str, FloatArray]) -> None:
        """Write the part of one chunk, whole or not at all."""
        table = self._table(columns)
        atomic_write(self._part(chunk), lambda file: pq.write_table(table, file))

    def finish(self) -> Path:
        """Join the parts in order into the file and remove them."""
        if self.path.exists():
            return self.path
        atomic_write(self.path, self._join)
        shutil.rmtree(self.parts)
        return self.path

    def _join(self, file: BinaryIO) -> None:
        writer: Any = None
        for chunk in range(self.chunks):
            part = pq.read_table(self._part(chunk))
            if writer is None:
                key = json.dumps(self.key, sort_keys=True).encode("utf-8")
                schema = part.schema.with_metadata({_KEY: key})
                writer = pq.ParquetWriter(file, schema)
            writer.write_table(part.replace_schema_metadata(writer.schema.metadata))
        writer.close()

    def _part(self, chunk: int) -> Path:
        return self.parts / f"{chunk:08d}.parquet"

    def _table(self, columns: Mapping[str, FloatArray]) -> Any:
        fields = [
            pa.field(
                name, pa.int64() if name == "design" else pa.float64(), metadata={"unit": unit}
            )
            for name, unit in self.units.items()
        ]
        arrays = [
            pa.array(np.asarray(columns[field.name]), from_pandas=False).cast(field.type)
            for field in fields
        ]
        return pa.Table.from_arrays(arrays, schema=pa.schema(fields))

    def _foreign(self, place: Path) -> DesignError:
        return DesignError(
            f"'{place}' holds another study (other sweeps, robot or version of wbc). Choose "
            "another --out, or delete it."
        )


def read_designs(path: str | Path) -> dict[str, FloatArray]:
    """Return the columns of a study's table.

    Raises:
        DesignError: no such file, or not a table of designs.
    """
    _stored_key(Path(path))
    table = pq.read_table(path)
    return {name: table.column(name).to_numpy().astype(np.float64) for name in table.column_names}


def _stored_key(path: Path) -> Any:
    try:
        stored = pq.read_schema(path).metadata or {}
    except (OSError, pa.ArrowInvalid) as cause:
        raise DesignError(f"'{path}' cannot be read as Parquet: {cause}.") from cause
    if _KEY not in stored:
        raise DesignError(f"'{path}' is no table of designs; choose another --out.")
    return json.loads(stored[_KEY])
