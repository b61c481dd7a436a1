"""Scorecard, breakdowns and the worst cases as text."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from benchmarks.corpus.calibration import calibration_report
from benchmarks.corpus.scorecard import breakdown, score
from benchmarks.corpus.verdicts import Judged, judge_result


def report(results: Sequence[dict[str, Any]]) -> str:
    """Return the scorecard, the breakdowns, the cost, and what went wrong."""
    lines = [f"{'':36s}{'figure':>8s}{'of':>6s}   target"]
    lines += [f"{f.name:36s}{f.figure:8.2f}{f.of:6d}   {f.target}" for f in score(results)]
    lines += ["", "probabilities", calibration_report(results)]
    for title, key in _TABLES.items():
        lines += ["", f"right, by {title}"]
        lines += [f"  {f.name:34s}{f.figure:8.1f}{f.of:6d}" for f in breakdown(results, key)]
    seconds = [result["seconds"] for result in results]
    plants = sum(result["simulation_seconds"] for result in results)
    lines += [
        "",
        f"seconds per diagnosis: median {np.median(seconds):.1f}, largest {np.max(seconds):.1f}, "
        f"together {np.sum(seconds):.0f}; the plants took {plants:.0f}",
        "",
        "what went wrong",
    ]
    return "\n".join(lines + [line(r) for r in results if not judge_result(r).good])


def line(result: dict[str, Any]) -> str:
    """Return one line about a result; a mark in front where it is wrong."""
    judged = judge_result(result)
    found = ", ".join(_finding(entry) for entry in result["found"])
    sizes = "/".join(f"{cause['size']:.1f}" for cause in result["causes"])
    errors = f"{result.get('before', 0.0):.1f}->{result.get('after', 0.0):.2f}"
    return (
        f"{'  ' if judged.good else '! '}{result['number']:4d} {result['family']:8s} "
        f"{result['richness']:4s} {judged.kind:8s} {result['label'][:70]} [{sizes}]: "
        f"{result['verdict']} {errors} {found} ({result['seconds']:.1f} s)"
    )


def _finding(entry: dict[str, Any]) -> str:
    rivals = f" or {'/'.join(entry['alternatives'])}" if entry["alternatives"] else ""
    return f"{entry['effect']}@{entry['where']}{rivals}"


def _by_effect(judged: Judged) -> str | None:
    lone = judged.kind in ("one", "outside")
    return str(judged.result["causes"][0]["effect"]) if lone else None


def _by_size(judged: Judged) -> str | None:
    if judged.kind != "one" or judged.size == 0.0:  # no size is known of play
        return None
    low = max((edge for edge in (2.0, 5.0, 10.0, 30.0) if edge <= judged.size), default=1.0)
    return f"from {low:4.0f} floors"


_TABLES: dict[str, Callable[[Judged], str | None]] = {
    "what is hidden": lambda judged: judged.kind,
    "effect, alone": _by_effect,
    "size, alone": _by_size,
    "robot": lambda judged: str(judged.result["family"]),
}
