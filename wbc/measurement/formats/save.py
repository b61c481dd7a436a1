"""Writing logs to files, whole or not at all."""

from __future__ import annotations

from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from wbc.errors import LogError
from wbc.extras import needs
from wbc.files import atomic_write
from wbc.measurement.log import Log
from wbc.measurement.schema import TIME


def save_log(log: Log, path: str | Path) -> Path:
    """Write a log; reading the file gives back the same numbers, bit by bit.

    Args:
        log: what to write.
        path: `.csv`, `.parquet` or `.npz`.

    Returns:
        The path.

    Raises:
        LogError: another suffix, or the file cannot be written.
    """
    writers = {".csv": _write_csv, ".parquet": _write_parquet, ".npz": _write_npz}
    suffix = Path(path).suffix.lower()
    if suffix not in writers:
        raise LogError(f"'{path}': logs are written as {', '.join(writers)}.")
    try:
        return atomic_write(path, lambda file: writers[suffix](log, file))
    except OSError as cause:
        raise LogError(f"cannot write '{path}': {cause}.") from cause


def _table(log: Log) -> Any:
    with needs("logs", "writing CSV and Parquet files"):
        import pyarrow as pa
    return pa.table({TIME: log.time, **log.columns})


def _write_csv(log: Log, file: BinaryIO) -> None:
    table, names = _table(log), [TIME, *log.names]
    file.write((",".join(_quoted(name) for name in names) + "\n").encode("utf-8"))
    import pyarrow.csv as pc

    pc.write_csv(table, file, pc.WriteOptions(include_header=False))


def _quoted(name: str) -> str:
    if not any(mark in name for mark in ',"\n'):
        return name
    return '"' + name.replace('"', '""') + '"'


def _write_parquet(log: Log, file: BinaryIO) -> None:
    table = _table(log)
    import pyarrow.parquet as pq

    pq.write_table(table, file)


def _write_npz(log: Log, file: BinaryIO) -> None:
    np.savez_compressed(file, allow_pickle=False, **{TIME: log.time, **log.columns})
