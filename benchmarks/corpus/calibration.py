"""Whether probabilities are what they say: of the causes stated at p, a share p must be true."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import binomtest

from benchmarks.corpus.verdicts import CERTAIN, FLOORS, certain_names, is_true

_EDGES = (0.0, 0.05, 0.2, 0.5, 0.8, 0.95, 1.0 + 1e-9)
_LEVEL = 0.9  # of the binomial intervals


class Bin(NamedTuple):
    """Causes stated with a probability in one range.

    `stated` is their mean probability, `true` the share that is hidden or stands for what is,
    `low` and `high` the ends of its 90 % interval (Clopper-Pearson).
    """

    stated: float
    true: float
    low: float
    high: float
    count: int


def reliability(results: Sequence[dict[str, Any]]) -> list[Bin]:
    """Return the causes of these results by their stated probability."""
    rows = [
        (entry["probability"], is_true(result, entry))
        for result in results
        for entry in result["found"]
        if entry.get("probability") is not None
    ]
    stated = np.array([p for p, _ in rows])
    true = np.array([t for _, t in rows], dtype=float)
    bins = []
    for low, high in pairwise(_EDGES):
        inside = (stated >= low) & (stated < high)
        count, hits = int(inside.sum()), int(true[inside].sum())
        if count:
            ends = binomtest(hits, count).proportion_ci(_LEVEL)
            bins.append(Bin(float(stated[inside].mean()), hits / count, *ends, count))
    return bins


def reached(results: Sequence[dict[str, Any]]) -> tuple[int, int]:
    """Return how many large causes without stand-ins are certain, and how many there are."""
    hits = total = 0
    for result in results:
        names = certain_names(result)
        merged = {name for pair, _ in result["merged"] for name in pair}
        for cause in result["causes"]:
            alone = (
                not cause["stand_ins"] and not cause.get("equals") and cause["effect"] not in merged
            )
            outside = result["unlisted"] and cause is result["causes"][-1]
            if cause["size"] >= FLOORS and cause["felt"] and alone and not outside:
                total += 1
                hits += cause["effect"] in names
    return hits, total


def calibration_report(results: Sequence[dict[str, Any]]) -> str:
    """Return the table of stated and true shares."""
    lines = [f"{'stated':>8s}{'true':>8s}{'90 % interval':>18s}{'of':>6s}"]
    for b in reliability(results):
        span = f"{b.low:.2f} to {b.high:.2f}"
        lines.append(f"{b.stated:8.2f}{b.true:8.2f}{span:>18s}{b.count:6d}")
    hits, total = reached(results)
    lines.append(
        f"causes of {FLOORS:.0f} floors or more without a stand-in that reach {CERTAIN}: "
        f"{hits} of {total}"
    )
    return "\n".join(lines)
