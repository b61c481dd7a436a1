"""Files of columns: the binary formats, which reader a file needs, and how a log is written."""

from __future__ import annotations

import hashlib
import os
import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from csv import writer
from importlib.util import find_spec
from io import StringIO
from itertools import product
from pathlib import Path
from typing import Any, BinaryIO
from zipfile import BadZipFile
from zlib import error as ZlibError  # noqa: N812

import numpy as np
from numpy.typing import NDArray

from wbc.errors import EXTRAS, LogError, needs, require_known
from wbc.files import atomic_write
from wbc.measurement.column_map import RowChoice, say_so
from wbc.measurement.log import Log
from wbc.measurement.schema import TIME, is_column
from wbc.measurement.tables import Table, columns_of, read_text_file

_TEXT = (".csv", ".tsv", ".txt", ".dat", ".data", ".log", ".asc")
_FORMATS = ".csv (also .csv.gz, .tsv, .txt, .dat), .parquet, .npz, .mcap, .db3, or a rosbag2 folder"
_WRITTEN = (".csv", ".parquet", ".npz")
_DAMAGE = (OSError, BadZipFile, ValueError, EOFError, ZlibError)
_COPIES = 6  # of a file that reading holds in memory: bytes, text, and the parsed columns
_MOST_TURNS = 64  # motors of a robot


def open_table(path: Path, rows: RowChoice) -> Table:
    """Read a file by its suffix; rows of one stamp that take turns become one row.

    Args:
        path: file, or folder of a rosbag2 recording.
        rows: what a column map says of topic, header and splitting.

    Raises:
        LogError: no such file, a format that is not read, or a file that is not what it says.
    """
    parts = _files(path)
    if len(parts) > 1:
        first, *others = (open_table(part, rows) for part in parts)
        return _joined(path, first, others)
    table = _read(path, rows.topic, rows.header)
    return table if rows.split else _side_by_side(table)


def _read(path: Path, topic: str, header: Sequence[str]) -> Table:
    """Return the table that a file holds."""
    if not path.exists():
        raise LogError(f"no log at '{path}'.")
    suffix = (Path(path.stem) if path.suffix.lower() == ".gz" else path).suffix.lower()
    if suffix in (".mcap", ".db3") or (path.is_dir() and (path / "metadata.yaml").is_file()):
        return read_bag(path, topic)
    if path.is_dir():
        way = "give the files in it, of a LeRobot dataset the Parquet files in its folder data."
        raise LogError(f"'{path}' is a folder, but no rosbag2 recording (no metadata.yaml); {way}")
    if (size := path.stat().st_size) == 0:
        raise LogError(f"'{path}' is empty.")
    if size * _COPIES > memory():
        raise LogError(f"'{path}' is too large for the memory: cut it, or keep every n-th row.")
    if suffix in (".parquet", ".pq"):
        return _read_parquet(path)
    if suffix == ".npz":
        return _read_npz(path)
    if suffix in _TEXT:
        return read_text_file(path, header)
    raise LogError(f"'{path}': the format '{suffix}' is not read; there are {_FORMATS}.")


def memory() -> int:
    """Return the memory of this machine [bytes]."""
    return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")


def _side_by_side(table: Table) -> Table:
    """Return a table with a row for each stamp, where a file has one for each motor of a stamp.

    A column names the motor, by number or by name: from row to row it takes the same values in
    turn, while the clock stands. Columns are then called `NAME_VALUE`. Channels of ours stay: rows
    of one joint that share a stamp are of several runs.
    """
    clock = next(iter(table.clocks), "")
    stamps = np.asarray(table.columns[clock]) if clock else np.arange(2)
    told = any(is_column(name) for name in table.names if name != TIME)
    others = [name for name in table.names if name != clock]
    for name in others if not told and stamps.size > 1 and stamps[0] == stamps[1] else ():
        cells = np.asarray(table.columns[name])
        turn = list(dict.fromkeys(cells[:_MOST_TURNS].tolist()))
        n, rows = len(turn), table.rows - table.rows % max(len(turn), 1)
        if cells.dtype.kind not in "iuOU" or n < 2 or rows <= n:
            continue
        stands = np.array_equal(stamps[:rows], np.repeat(stamps[:rows:n], n))
        if stands and np.array_equal(cells[:rows], np.tile(turn, rows // n)):
            columns, units = {clock: stamps[:rows:n]}, dict(table.units)
            for other, (k, one) in product([o for o in others if o != name], enumerate(turn)):
                columns[f"{other}_{one}"] = np.asarray(table.columns[other])[k:rows:n]
                units |= {f"{other}_{one}": table.units[other]} if other in table.units else {}
            said = f"rows take turns by {name} ({', '.join(map(str, turn))}): put side by side."
            return Table(table.path, columns, units, (*table.notes, said))
    return table


def _files(path: Path) -> list[Path]:
    """Return the files of `A+B`, which are one run on one clock."""
    parts = [Path(part) for part in str(path).split("+")]
    return parts if all(part.exists() for part in parts) else [path]


def _joined(path: Path, first: Table, others: Sequence[Table]) -> Table:
    """Return the rows of a table with the last row of others that was not later.

    Columns of the others get what their file is called before their own name, without what both
    files are called: of run1.state.csv and run1.control.csv, `control_positions_0`.

    Raises:
        LogError: a table without a column that looks like a clock.
    """
    for timeless in (table.path for table in (first, *others) if not table.clocks):
        raise LogError(f"{timeless}: no column looks like a clock, so nothing can be put beside.")
    columns, notes = dict(first.columns), list(first.notes)
    time = first.numbers(first.clocks[0])
    called = (Path(table.path.name.removesuffix(".gz")).stem for table in (first, *others))
    ours, *words = (re.findall("[A-Za-z0-9]+", name) for name in called)
    for table, theirs in zip(others, words, strict=True):
        clock = table.clocks[0]
        rows = np.searchsorted(table.numbers(clock), time, side="right") - 1
        prefix = "_".join(word for word in theirs if word not in ours) or "other"
        for name in table.names:
            if name != clock and table.holds_numbers(name):
                values = table.numbers(name)[np.maximum(rows, 0)]
                columns[f"{prefix}_{name}"] = np.where(rows < 0, np.nan, values)
        notes.append(f"columns of '{table.path.name}' were put beside, by {clock}.")
    return Table(path, columns, first.units, tuple(notes))


def digest(path: Path) -> str:
    """Return the SHA-256 of a file, or of the digests of all files that a log is read from."""
    each = []
    for part in (one for own in _files(path) for one in (own, *sorted(own.rglob("*")))):
        if part.is_file():
            with part.open("rb") as file:
                each.append(hashlib.file_digest(file, "sha256").hexdigest())
    return each[0] if path.is_file() else hashlib.sha256("".join(each).encode("ascii")).hexdigest()


def _read_parquet(path: Path) -> Table:
    with needs("logs", "reading Parquet files"):
        import pyarrow as pa
        import pyarrow.parquet as pq
    try:
        table = pq.ParquetFile(path).read()
    except (OSError, pa.ArrowException) as cause:
        way = "Is it damaged, or of another format? Copy it again, or export it as CSV."
        raise LogError(f"cannot read '{path}' as Parquet: {cause}. {way}") from cause
    return Table(path, columns_of(dict(zip(table.column_names, table.columns, strict=True)), path))


def _read_npz(path: Path) -> Table:
    """Read an archive of arrays, never unpickled: (N,) and (N, n); others are passed over."""
    try:
        with np.load(path, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
    except _DAMAGE as cause:
        said = "it holds Python objects; only arrays of numbers are read"
        text = said if "allow_pickle" in str(cause) else str(cause)
        raise LogError(f"cannot read '{path}' as NPZ: {text}.") from cause
    own = [len(a) for name, a in arrays.items() if a.ndim and is_column(name)]
    if len(set(own)) > 1:
        listed = ", ".join(f"{name} {len(a)}" for name, a in arrays.items() if a.ndim)
        raise LogError(f"'{path}': the arrays differ in length: {listed}.")
    lengths = own or [len(a) for a in arrays.values() if a.ndim in (1, 2)]
    rows = max(set(lengths), key=lengths.count, default=0)
    kept = {}
    for name, array in arrays.items():
        turned = array.T if array.ndim == 2 and rows == array.shape[1] != len(array) else array
        if turned.ndim and len(turned) == rows:
            kept[name] = turned[:, 0] if turned.shape[1:] == (1,) else turned
            if turned.ndim > 2:
                shapes = f"{array.shape}, expected (rows,) or (rows, columns)"
                raise LogError(f"'{path}': '{name}' has shape {shapes}.")
    others = [f"{name} {arrays[name].shape}" for name in arrays if name not in kept]
    notes = [f"arrays without {rows} rows were passed over: {', '.join(others)}."] if others else ()
    return Table(path, columns_of(kept, path), notes=tuple(notes))


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
    suffix = Path(path).suffix.lower()
    if suffix not in _WRITTEN:
        raise LogError(f"'{path}': logs are written as {', '.join(_WRITTEN)}.")
    columns = {TIME: log.time, **log.columns}
    try:
        return atomic_write(path, lambda file: _write(columns, suffix, file))
    except OSError as cause:
        raise LogError(f"cannot write '{path}': {cause}.") from cause


def _write(columns: Mapping[str, NDArray[Any]], suffix: str, file: BinaryIO) -> None:
    if suffix == ".npz":
        np.savez_compressed(file, allow_pickle=False, **columns)
        return
    with needs("logs", "writing CSV and Parquet files"):
        import pyarrow as pa
        import pyarrow.csv as pc
        import pyarrow.parquet as pq
    table = pa.table(columns)
    if suffix == ".parquet":
        pq.write_table(table, file)
        return
    head = StringIO()  # pyarrow puts every name in quotes
    writer(head, lineterminator="\n").writerow(columns)
    file.write(head.getvalue().encode("utf-8"))
    pc.write_csv(table, file, pc.WriteOptions(include_header=False))


_TYPE = "sensor_msgs/msg/JointState"
_FIELDS = ("position", "velocity", "effort")


def read_bag(path: Path, topic: str) -> Table:
    """Read one JointState topic as columns `time`, `<joint>.position`, `.velocity` and `.effort`.

    `time` is the header's stamp in seconds since the first message (the recorder's stamp where
    headers carry none).

    Args:
        path: rosbag2 folder, or its MCAP or SQLite file.
        topic: which JointState topic, empty for the only one.

    Raises:
        LogError: `rosbags` is not installed, the bag is unreadable, there is no such topic, or a
            message lacks joints of the first.
    """
    if find_spec("rosbags") is None:
        way = f"install it with: pip install {' '.join(EXTRAS['rosbags'])}"
        raise LogError(f"reading the bag '{path}' needs the package rosbags; {way}")
    rows, stamps = list[list[float]](), list[int]()
    joints, fields = list[str](), list[str]()
    with _opened(path) as bag:
        chosen = _topic(bag, path, topic)
        wanted = [c for c in bag.connections if c.topic == chosen]
        for connection, received, raw in bag.messages(connections=wanted):
            message = bag.deserialize(raw, connection.msgtype)
            own = message.header.stamp
            stamps.append(own.sec * 10**9 + own.nanosec or received)
            place = {str(name): k for k, name in enumerate(message.name)}
            joints = joints or [*place]
            fields = fields or [f for f in _FIELDS if len(getattr(message, f)) == len(joints)]
            missing = [joint for joint in joints if joint not in place]
            if missing or any(len(getattr(message, f)) != len(place) for f in fields):
                after = f"at {(stamps[-1] - stamps[0]) * 1e-9:.6f} s"
                lacks = f"{', '.join(missing) or 'values'} of the first one"
                way = "If several publishers share the topic, record them on topics of their own."
                raise LogError(f"{path}: the message of '{chosen}' {after} lacks {lacks}. {way}")
            rows.append([float(getattr(message, f)[place[j]]) for j in joints for f in fields])
    if not rows:
        raise LogError(f"{path}: topic '{chosen}' holds no message.")
    names = [f"{joint}.{field}" for joint in joints for field in fields]
    time = np.array([stamp - stamps[0] for stamp in stamps]) * 1e-9
    return Table(path, {TIME: time, **dict(zip(names, np.array(rows).T.copy(), strict=True))})


def _topic(bag: Any, path: Path, topic: str) -> str:
    topics = list(dict.fromkeys(c.topic for c in bag.connections if c.msgtype == _TYPE))
    if not topics:
        there = ", ".join(f"{c.topic} ({c.msgtype})" for c in bag.connections) or "no topic"
        raise LogError(f"{path}: no topic of type {_TYPE}, which a log is read from, but {there}.")
    if not topic and len(topics) > 1:
        way = say_so({"rows": {"topic": topics[0]}}, "choose one, such as the first,")
        raise LogError(f"{path} has several JointState topics ({', '.join(topics)}); {way}")
    chosen = topic or topics[0]
    require_known(LogError, "JointState topic", chosen, topics, str(path))
    return chosen


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Open a bag; damage that shows then or later becomes a LogError."""
    from rosbags.highlevel import AnyReader, AnyReaderError
    from rosbags.rosbag2 import ReaderError
    from rosbags.serde import SerdeError
    from rosbags.typesys import Stores, get_typestore

    # The parser of the bag asserts and unpacks where a file is cut off.
    damage = (OSError, AnyReaderError, ReaderError, SerdeError, struct.error, AssertionError)
    try:
        types = get_typestore(Stores.ROS2_HUMBLE)
        with AnyReader([path], default_typestore=types) as bag:
            yield bag
    except damage as cause:
        said = f"cannot read the bag '{path}': {str(cause) or type(cause).__name__}."
        way = "Was the recording cut off? The tools of its format can often repair the index."
        raise LogError(f"{said} {way}") from cause
