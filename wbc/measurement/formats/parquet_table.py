"""Parquet files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from wbc.errors import LogError
from wbc.extras import needs
from wbc.measurement.formats.arrow_columns import batch_columns
from wbc.measurement.formats.table import CHUNK_ROWS, Chunk, Table

with needs("logs", "reading Parquet files"):
    import pyarrow as pa
    import pyarrow.parquet as pq


class ParquetTable(Table):
    """A Parquet file; only the columns asked for are read from disk."""

    def __init__(self, path: Path) -> None:
        """Read the schema.

        Raises:
            LogError: the file is missing, no Parquet or damaged.
        """
        self.path = path
        try:
            self._file = pq.ParquetFile(path)
        except (OSError, pa.ArrowException) as cause:
            raise _damaged(path, cause) from cause

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns."""
        return tuple(self._file.schema_arrow.names)

    @property
    def rows(self) -> int:
        """Number of rows."""
        return int(self._file.metadata.num_rows)

    def chunks(self, numbers: Sequence[str], keys: Sequence[str]) -> Iterator[Chunk]:
        """Yield pieces of the rows (see `Table.chunks`)."""
        wanted = list(dict.fromkeys([*numbers, *keys]))
        try:
            for batch in self._file.iter_batches(CHUNK_ROWS, columns=wanted, use_threads=False):
                yield batch_columns(batch, numbers, keys, str(self.path))
        except (OSError, pa.ArrowException) as cause:
            raise _damaged(self.path, cause) from cause


def _damaged(path: Path, cause: Exception) -> LogError:
    return LogError(
        f"cannot read '{path}' as Parquet: {cause}. The file is cut off or damaged, or of another "
        "format; copy it again, or export it as CSV."
    )
