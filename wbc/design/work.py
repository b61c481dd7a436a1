"""Running a study in chunks: processes on one computer, or the workers of a Dask cluster."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from wbc.arrays import FloatArray
from wbc.design.study import Study, describe_columns
from wbc.errors import DesignError
from wbc.progress import Watch
from wbc.results import Column, ResultTable, fill_table

ANALYTIC_CHUNK = 16384  # designs: about 0.3 s of work, 3 MB of results
SIMULATED_CHUNK = 8  # designs: 1 to 30 s of work, so that little is lost when a run is killed

Chunk = tuple[int, int]
"""First design, and the one after the last."""


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
        ResultsError: the file belongs to another study.
        ParallelError: workers is 0, or no cluster at the address.
        DynamicsError, TransmissionError: a value outside its range.
    """
    size = chunk or (SIMULATED_CHUNK if study.simulations else ANALYTIC_CHUNK)
    if size < 1:
        raise DesignError(f"chunk must be at least 1, got {size}.")
    study.designs(0, 1)  # wrong values show before anything is written
    chunks = [(start, min(start + size, study.size)) for start in range(0, study.size, size)]
    columns = {
        name: Column(unit, "count" if name == "design" else "number")
        for name, unit in describe_columns(study).items()
    }
    table = ResultTable(Path(path), {**study.key(), "chunk": size}, columns, len(chunks))
    work = partial(evaluate_chunk, study)
    sizes = [stop - start for start, stop in chunks]
    return fill_table(
        table, work, chunks, workers=workers, cluster=cluster, watch=watch, sizes=sizes
    )


def evaluate_chunk(study: Study, chunk: Chunk) -> dict[str, FloatArray]:
    """Return the part of the table of one chunk; what a worker runs."""
    return study.evaluate(*chunk)
