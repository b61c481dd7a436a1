"""LeRobot datasets: a folder of Parquet files with vectors, and a file that names their parts."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc.errors import LogError
from wbc.extras import needs
from wbc.measurement.formats.table import CHUNK_ROWS, Chunk, Table
from wbc.measurement.schema import TIME

with needs("logs", "reading LeRobot datasets"):
    import pyarrow as pa
    import pyarrow.parquet as pq

INFO = Path("meta") / "info.json"
_VECTORS = {
    "observation.state": "position",
    "observation.velocity": "velocity",
    "observation.effort": "motor_torque",
    "action": "target_position",
}
_ENDINGS = (".pos", ".position", ".vel", ".velocity", ".effort", ".torque")
_CLOCK, _EPISODE = "timestamp", "episode_index"


class LeRobotTable(Table):
    """The episodes of a dataset as columns `time`, `<joint>.position`, ... and `episode_index`.

    `observation.state` is read as positions, `action` as target positions, `observation.velocity`
    and `observation.effort` as their names say. The clock starts anew with every episode: a column
    map splits them (`rows.split = "episode_index"`). The format states no units of angles: most
    datasets hold degrees or shares of the range, which a map must say.
    """

    def __init__(self, path: Path) -> None:
        """Read the names of the parts and find the files.

        Raises:
            LogError: no description, no data, or no vector of positions.
        """
        self.path = path
        try:
            info = json.loads((path / INFO).read_text(encoding="utf-8"))
            features: Mapping[str, Any] = info["features"]
        except (OSError, ValueError, KeyError, TypeError) as cause:
            raise LogError(f"cannot read '{path / INFO}': {cause!r}.") from cause
        self._files = sorted((path / "data").rglob("*.parquet"))
        if not self._files:
            raise LogError(f"'{path}' has no Parquet file in its folder data.")
        self._places = {
            f"{joint}.{quantity}": (vector, k)
            for vector, quantity in _VECTORS.items()
            for k, joint in enumerate(_parts(features.get(vector)))
        }
        if not any(name.endswith(".position") for name in self._places):
            raise LogError(
                f"'{path}': no feature 'observation.state' with a name for every part; there are: "
                f"{', '.join(features)}."
            )

    @property
    def names(self) -> tuple[str, ...]:
        """`time`, the parts of the vectors, and the number of the episode."""
        return (TIME, *self._places, _EPISODE)

    @property
    def rows(self) -> int:
        """Number of rows of all episodes."""
        return sum(pq.ParquetFile(file).metadata.num_rows for file in self._files)

    def chunks(self, numbers: Sequence[str], keys: Sequence[str]) -> Iterator[Chunk]:
        """Yield pieces of the rows (see `Table.chunks`)."""
        wanted = list(dict.fromkeys([*numbers, *keys]))
        stored = {name: self._stored(name) for name in wanted}
        read = list(dict.fromkeys(column for column, _ in stored.values()))
        try:
            for file in self._files:
                for batch in pq.ParquetFile(file).iter_batches(CHUNK_ROWS, columns=read):
                    yield {
                        name: _values(batch.column(batch.schema.get_field_index(column)), part)
                        .astype(np.str_ if name in keys else np.float64)
                        for name, (column, part) in stored.items()
                    }  # fmt: skip
        except (OSError, ValueError, IndexError, pa.ArrowException) as cause:
            raise LogError(f"cannot read the dataset '{self.path}': {cause}.") from cause

    def _stored(self, name: str) -> tuple[str, int | None]:
        """Return the column of the files and the part of it that holds a column of ours."""
        if name == TIME:
            return _CLOCK, None
        return self._places.get(name, (name, None))


def _parts(feature: Any) -> list[str]:
    """Return the names of the parts of a vector, without what they measure; none if unnamed."""
    names = feature.get("names") if isinstance(feature, dict) else None
    if isinstance(names, dict):
        names = next((value for value in names.values() if isinstance(value, list)), None)
    if not isinstance(names, list):
        return []
    return [_joint(str(name)) for name in names]


def _joint(name: str) -> str:
    for ending in _ENDINGS:
        if name.endswith(ending):
            return name.removesuffix(ending)
    return name


def _values(column: Any, part: int | None) -> NDArray[Any]:
    """Return a column of a batch, or one part of a column of vectors."""
    if part is None:
        return np.asarray(column.to_numpy(zero_copy_only=False))
    width, rest = divmod(len(column.flatten()), max(len(column), 1))
    if rest or part >= width:
        raise ValueError(f"a vector of {width} parts holds no part {part}")
    return np.asarray(column.flatten().to_numpy(zero_copy_only=False)).reshape(-1, width)[:, part]
