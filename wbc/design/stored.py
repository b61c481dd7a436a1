"""Reading the table of a study: whole, in pieces for its front, or thinned for a picture."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from wbc.arrays import FloatArray
from wbc.design.pareto import Objective, over_gait, pareto_front
from wbc.results import read_results, results_in_pieces, rows_of

_PIECE = 65536  # rows that are read at a time: 11 MB of 21 columns


def read_designs(path: str | Path) -> dict[str, FloatArray]:
    """Return the columns of a study's table.

    Raises:
        ResultsError: no such file, or not a table of results.
    """
    return {name: np.asarray(x, dtype=np.float64) for name, x in read_results(path).items()}


def best_designs(
    path: str | Path, objectives: Sequence[Objective], instants: int = 0
) -> dict[str, FloatArray]:
    """Return the columns of the Pareto front of a study's table, best in the first objective first.

    The table is read in pieces, so that memory grows with the front and not with the study.

    Args:
        path: the Parquet file.
        objectives: what designs are judged by; see `pareto_front`.
        instants: of the gait, whose worst one counts (`over_gait`); 0 without a gait.

    Raises:
        ResultsError: no such file, or not a table of results.
        DesignError: no objective.
    """
    best: dict[str, FloatArray] = {}
    for piece in _whole_designs(path, max(instants, 1)):
        rows = over_gait(piece, instants, objectives) if instants else piece
        both = _joined(best, rows)
        front = pareto_front(both, objectives)
        best = {name: values[front] for name, values in both.items()}
    return best


def sampled_designs(
    path: str | Path, count: int, objectives: Sequence[Objective], instants: int = 0
) -> dict[str, FloatArray]:
    """Return at most `count` designs of a study's table, evenly spread; all if there are no more.

    Args:
        path: the Parquet file.
        count: how many designs fit into a picture.
        objectives: whose worst instant counts where there is a gait.
        instants: of the gait; 0 without one.

    Raises:
        ResultsError: no such file, or not a table of results.
    """
    width = max(instants, 1)
    every = max(-(-rows_of(path) // (width * count)), 1)
    kept: dict[str, FloatArray] = {}
    for piece in _whole_designs(path, width):
        chosen = piece["design"] // width % every == 0
        rows = {name: values[chosen] for name, values in piece.items()}
        kept = _joined(kept, over_gait(rows, instants, objectives) if instants else rows)
    return kept


def _whole_designs(path: str | Path, instants: int) -> Iterator[dict[str, FloatArray]]:
    """Yield the rows of a table in pieces that cut through no design's instants."""
    left: dict[str, FloatArray] = {}
    for read in results_in_pieces(path, _PIECE):
        piece = _joined(left, {name: np.asarray(x, dtype=np.float64) for name, x in read.items()})
        whole = len(piece["design"]) // instants * instants
        yield {name: values[:whole] for name, values in piece.items()}
        left = {name: values[whole:] for name, values in piece.items()}


def _joined(first: dict[str, FloatArray], second: dict[str, FloatArray]) -> dict[str, FloatArray]:
    if not first:
        return second
    return {name: np.concatenate([first[name], values]) for name, values in second.items()}
