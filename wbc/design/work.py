"""Running a study in chunks: processes on one computer, or the workers of a Dask cluster."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from pathlib import Path

from wbc.arrays import FloatArray
from wbc.design.study import Study, describe_columns
from wbc.design.table import DesignTable
from wbc.errors import DesignError
from wbc.parallel import run_jobs
from wbc.progress import Watch

ANALYTIC_CHUNK = 16384  # designs: about 0.3 s of work, 3 MB of results
SIMULATED_CHUNK = 8  # designs: 1 to 30 s of work, so that little is lost when a run is killed

Columns = dict[str, FloatArray]
Chunk = tuple[int, int, int]


def run_study(
    study: Study,
    path: str | Path,
    *,
    workers: int = 1,
    cluster: str | None = None,
    chunk: int | None = None,
    watch: Watch | None = None,
) -> Path:
    """Evaluate every design of a study and write the table; resumes what a killed run left.

    The table is the same to the last bit for any number of workers, on a cluster, and after any
    number of interruptions: chunks have fixed ends and are joined in order.

    Args:
        study: what to evaluate.
        path: the Parquet file.
        workers: processes on this computer; 1 works in this process, -1 takes all cores.
        cluster: address of a Dask scheduler instead, for example "tcp://10.0.0.1:8786".
        chunk: designs per part; part of what must be equal to resume.
        watch: called with the designs done and their total, now and after every part.

    Raises:
        DesignError: the file belongs to another study, no cluster at the address.
        DynamicsError, TransmissionError: a value outside its range.
    """
    size = chunk or (SIMULATED_CHUNK if study.simulations else ANALYTIC_CHUNK)
    if size < 1:
        raise DesignError(f"chunk must be at least 1, got {size}.")
    study.designs(0, 1)  # wrong values show before anything is written
    ends = [(i, start, min(start + size, study.size)) for i, start in _starts(study.size, size)]
    key = {**study.key(), "chunk": size}
    table = DesignTable(Path(path), key, describe_columns(study), len(ends))
    done = table.begin()
    count = sum(stop - start for i, start, stop in ends if i in done)
    left = [one for one in ends if one[0] not in done]
    if watch:
        watch(count, study.size)
    for number, columns in run_jobs(
        partial(evaluate_chunk, study), left, workers=workers, cluster=cluster
    ):
        table.add(number, columns)
        count += len(columns["design"])
        if watch:
            watch(count, study.size)
    return table.finish()


def evaluate_chunk(study: Study, chunk: Chunk) -> tuple[int, Columns]:
    """Return a chunk's number and its part of the table; what a worker runs."""
    number, start, stop = chunk
    return number, study.evaluate(start, stop)


def _starts(total: int, size: int) -> Iterable[tuple[int, int]]:
    return enumerate(range(0, total, size))
