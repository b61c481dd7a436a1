"""Results of many jobs: parts that appear whole, joined into one Parquet file at the end.

While jobs run, `FILE.parts/` holds the key of the work and one Parquet file per finished job. A
part is written to a temporary name and renamed, so that a killed run leaves whole parts only; the
next run with the same key does the rest. At the end the parts are joined in order and removed.

Where parts have names, a table also grows: jobs that are in the finished file already are not done
again, and the file is replaced by one with all of them.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO, Literal, TypeVar

import numpy as np

from wbc.errors import ResultsError
from wbc.extras import needs
from wbc.files import atomic_write, write_text
from wbc.parallel import run_jobs
from wbc.progress import Watch

_KEY = b"wbc.results"
_ROWS = b"wbc.results.rows"  # of every part by name, in order, where parts have names
_GROUP = 16384  # rows from which a group of the file is closed
_KINDS = {"number": "float64", "count": "int64", "text": "string"}  # names of pyarrow

Columns = Mapping[str, Any]
"""Column -> values (n,) of the rows of one part."""

_Job = TypeVar("_Job")


@dataclass(frozen=True)
class Column:
    """What a column holds.

    Attributes:
        unit: of its numbers, written beside the column; "1" for none.
        kind: of its values.
    """

    unit: str = "1"
    kind: Literal["number", "count", "text"] = "number"


@dataclass(frozen=True)
class ResultTable:
    """Where the results of many jobs go.

    Attributes:
        path: the Parquet file at the end.
        key: what the results depend on; plain numbers, texts, lists and dictionaries.
        columns: by name, in order.
        parts: how many there will be, one per job, each with at least one row.
        names: of the parts, where the table may grow by more jobs: unlike, letters and digits with
            one "-" in it. What is left of it says which thing a part is about, the rest what it
            depends on: a part of the same thing that depends on something else is done anew.
    """

    path: Path
    key: Mapping[str, Any]
    columns: Mapping[str, Column]
    parts: int
    names: Sequence[str] = ()

    @property
    def folder(self) -> Path:
        """Of the parts while the work goes on."""
        return self.path.with_name(self.path.name + ".parts")

    def begin(self) -> set[int]:
        """Return the parts that are there already; all of them for a finished table.

        Raises:
            ResultsError: the file or the parts belong to other work, or the file has parts of
                things that are not named any more.
        """
        stored = self._stored()
        if stored is not None and list(stored) == list(self.names):
            return set(range(self.parts))
        there = set(stored or ())
        self._require_all_of(there)
        known = self.folder / "key.json"
        if known.exists():
            if json.loads(known.read_text("utf-8")) != self.key:
                raise self._foreign(self.folder)
        else:
            write_text(known, json.dumps(self.key, indent=1))
        there |= {part.stem for part in self.folder.glob("*.parquet")}
        return {number for number in range(self.parts) if self._name(number) in there}

    def add(self, part: int, columns: Columns) -> None:
        """Write one part, whole or not at all."""
        _, pq = _pyarrow()
        table = self._table(columns)
        atomic_write(self._part(part), lambda file: pq.write_table(table, file))

    def finish(self) -> Path:
        """Join the parts in order into the file and remove them."""
        stored = self._stored()
        if stored is None or list(stored) != list(self.names):
            atomic_write(self.path, partial(self._join, stored or {}))
        shutil.rmtree(self.folder, ignore_errors=True)
        return self.path

    def _join(self, stored: Mapping[str, int], file: BinaryIO) -> None:
        """Write all parts in order; those without a file of their own are in the table before.

        Metadata of Parquet grow with its row groups: small parts share one.
        """
        pa, pq = _pyarrow()
        schema = self._schema()
        before = _parts_of(self.path, stored)
        with pq.ParquetWriter(file, schema) as writer:
            waiting: list[Any] = []
            rows = dict[str, int]()
            for number in range(self.parts):
                name, place = self._name(number), self._part(number)
                part = pq.read_table(place) if place.exists() else before(name)
                waiting.append(part.replace_schema_metadata(None))
                rows[name] = part.num_rows
                if sum(table.num_rows for table in waiting) >= _GROUP or number == self.parts - 1:
                    writer.write_table(pa.concat_tables(waiting).cast(schema))
                    waiting = []
            metadata = {_KEY: json.dumps(self.key, sort_keys=True)}
            if self.names:
                metadata[_ROWS] = json.dumps(rows)
            writer.add_key_value_metadata(metadata)

    def _stored(self) -> dict[str, int] | None:
        """Return the rows of every part in the file, in order; None without a file.

        Raises:
            ResultsError: the file belongs to other work.
        """
        if not self.path.exists():
            return None
        metadata = _metadata(self.path)
        if json.loads(metadata[_KEY]) != self.key:
            raise self._foreign(self.path)
        return dict(json.loads(metadata.get(_ROWS, b"{}")))

    def _require_all_of(self, stored: set[str]) -> None:
        """Check that the work names every thing that the file has rows of."""
        now = {name.partition("-")[0] for name in self.names}
        gone = {name.partition("-")[0] for name in stored} - now
        if gone:
            raise ResultsError(
                f"'{self.path}' holds {len(gone)} results of what is not given now. Give all of "
                "it again (a table grows, it does not shrink), or choose another --out."
            )

    def _name(self, number: int) -> str:
        return self.names[number] if self.names else f"{number:08d}"

    def _part(self, number: int) -> Path:
        return self.folder / f"{self._name(number)}.parquet"

    def _schema(self) -> Any:
        pa, _ = _pyarrow()
        return pa.schema(
            [
                pa.field(
                    name, pa.type_for_alias(_KINDS[column.kind]), metadata={"unit": column.unit}
                )
                for name, column in self.columns.items()
            ]
        )

    def _table(self, columns: Columns) -> Any:
        pa, _ = _pyarrow()
        schema = self._schema()
        arrays = [
            pa.array(
                list(columns[name]) if column.kind == "text" else np.asarray(columns[name]),
                from_pandas=False,
            ).cast(schema.field(name).type)
            for name, column in self.columns.items()
        ]
        return pa.Table.from_arrays(arrays, schema=schema)

    def _foreign(self, place: Path) -> ResultsError:
        return ResultsError(
            f"'{place}' holds the results of other work (other input, settings or version of wbc). "
            "Choose another --out, or delete it."
        )


def fill_table(
    table: ResultTable,
    function: Callable[[_Job], Columns],
    jobs: Sequence[_Job],
    *,
    workers: int = 1,
    cluster: str | None = None,
    watch: Watch | None = None,
    sizes: Sequence[int] | None = None,
) -> Path:
    """Do the jobs whose parts are missing, write each part as it comes, and finish the table.

    The file is the same to the last bit for any number of workers, on a cluster, and after any
    number of interruptions: the parts are joined in the order of the jobs.

    Args:
        table: one part per job.
        function: of a module; returns the rows of one job.
        jobs: all of them.
        workers: processes on this computer; 1 works in this process, -1 takes all cores.
        cluster: address of a Dask scheduler instead.
        watch: called with what is done and the total: now, and after every part.
        sizes: of each job as `watch` counts them; 1 each when left out.

    Raises:
        ResultsError: the file or its parts belong to other work.
        ParallelError: workers is 0, or no cluster at the address.
    """
    sizes = sizes or [1] * len(jobs)
    done, total = table.begin(), sum(sizes)
    count = sum(sizes[number] for number in done)
    if watch:
        watch(count, total)
    left = [(number, job) for number, job in enumerate(jobs) if number not in done]
    for number, columns in run_jobs(
        partial(_numbered, function), left, workers=workers, cluster=cluster
    ):
        table.add(number, columns)
        count += sizes[number]
        if watch:
            watch(count, total)
    return table.finish()


def _parts_of(path: Path, stored: Mapping[str, int]) -> Callable[[str], Any]:
    """Return a function that takes a part out of a file, by its name."""
    if not stored:
        return dict[str, Any]().__getitem__
    _, pq = _pyarrow()
    table = pq.read_table(path)
    starts = dict(zip(stored, np.cumsum([0, *stored.values()]).tolist(), strict=False))
    return lambda name: table.slice(starts[name], stored[name])


def _numbered(
    function: Callable[[_Job], Columns], numbered: tuple[int, _Job]
) -> tuple[int, Columns]:
    number, job = numbered
    return number, function(job)


def read_results(path: str | Path, names: Sequence[str] | None = None) -> dict[str, Any]:
    """Return the columns of a table of results: arrays (n,) of numbers, lists of texts.

    Args:
        path: of the table.
        names: of the columns that are read; all when left out. Only these take memory.

    Raises:
        ResultsError: no such file, or not a table of results.
    """
    _metadata(Path(path))
    pa, pq = _pyarrow()
    return _plain_columns(pa, pq.read_table(path, columns=None if names is None else list(names)))


def _plain_columns(pa: Any, table: Any) -> dict[str, Any]:
    return {
        name: column.to_pylist() if column.type == pa.string() else column.to_numpy()
        for name, column in zip(table.column_names, table.columns, strict=True)
    }


def results_in_pieces(path: str | Path, rows: int) -> Iterator[dict[str, Any]]:
    """Yield the columns of a table of results, at most `rows` rows at a time, in order.

    Raises:
        ResultsError: no such file, or not a table of results.
    """
    _metadata(Path(path))
    pa, pq = _pyarrow()
    with pq.ParquetFile(path) as file:
        # `iter_batches` reads ahead: 150 bytes per row of the whole file (pyarrow 26).
        for number in range(file.metadata.num_row_groups):
            group = file.read_row_group(number, use_threads=False)
            for start in range(0, group.num_rows, rows):
                yield _plain_columns(pa, group.slice(start, rows))


def rows_of(path: str | Path) -> int:
    """Return the number of rows of a table of results.

    Raises:
        ResultsError: no such file, or not a table of results.
    """
    _metadata(Path(path))
    _, pq = _pyarrow()
    return int(pq.read_metadata(path).num_rows)


def _metadata(path: Path) -> dict[bytes, bytes]:
    """Return what a table of results says of itself."""
    pa, pq = _pyarrow()
    try:
        stored = pq.read_metadata(path).metadata or {}
    except (OSError, pa.ArrowInvalid) as cause:
        raise ResultsError(f"'{path}' cannot be read as Parquet: {cause}.") from cause
    if _KEY not in stored:
        raise ResultsError(f"'{path}' is no table of results; choose another --out.")
    return dict(stored)


def _pyarrow() -> tuple[Any, Any]:
    """Return pyarrow and its module for Parquet; only tables of results need them."""
    with needs("design", "a table of results"):
        import pyarrow as pa
        import pyarrow.parquet as pq
    return pa, pq
