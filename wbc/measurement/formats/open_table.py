"""Opening a file of any format that holds columns."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path

from wbc.errors import LogError
from wbc.measurement.formats.bag_table import BagTable
from wbc.measurement.formats.npz_table import NpzTable
from wbc.measurement.formats.table import Table

_FORMATS = ".csv (also .csv.gz), .parquet, .npz, .mcap, .db3, or the folder of a rosbag2 recording"


def open_table(path: Path, topic: str = "", header: Sequence[str] = ()) -> Table:
    """Open a file by its suffix.

    Args:
        path: file, or folder of a rosbag2 recording.
        topic: JointState topic of a bag, empty for the only one.
        header: names of the columns of a CSV file without a header line.

    Raises:
        LogError: no such file, a format that is not read, or a file that is not what it says.
    """
    if not path.exists():
        raise LogError(f"no log at '{path}'.")
    suffix = path.suffix.lower()
    if suffix == ".gz":
        suffix = Path(path.stem).suffix.lower()
    if suffix in (".mcap", ".db3") or (path.is_dir() and (path / "metadata.yaml").is_file()):
        return BagTable(path, topic)
    if path.is_dir():
        raise LogError(f"'{path}' is a folder, and no rosbag2 recording (no metadata.yaml).")
    if path.stat().st_size == 0:
        raise LogError(f"'{path}' is empty.")
    if suffix in (".parquet", ".pq"):
        # pyarrow is no part of a bare installation.
        from wbc.measurement.formats.parquet_table import ParquetTable

        return ParquetTable(path)
    if suffix == ".npz":
        return NpzTable(path)
    if suffix in (".csv", ".txt", ".tsv"):
        from wbc.measurement.formats.csv_table import CsvTable

        return CsvTable(path, header)
    raise LogError(f"'{path}': the format '{suffix}' is not read; there are {_FORMATS}.")


def digest(path: Path) -> str:
    """Return the SHA-256 of a file, or of the files of a folder in order of their names."""
    if path.is_file():
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    total = hashlib.sha256()
    for part in sorted(p for p in path.iterdir() if p.is_file()):
        total.update(digest(part).encode("ascii"))
    return total.hexdigest()
