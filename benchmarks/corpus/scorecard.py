"""The scorecard: the figures that have a target, and where they come from."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from benchmarks.corpus.verdicts import (
    Judged,
    first_right,
    intervals,
    invented,
    judge_result,
)

# Found by search over a grid, or angles that mean the same once per turn.
_SHAPES = {
    ("joint_spring", "rest"),
    ("torque_ripple", "order"),
    ("torque_ripple", "phase"),
    ("stribeck_friction", "speed"),
    ("presliding", "length"),
    ("load_presliding", "length"),
    ("load_stribeck_friction", "speed"),
    ("thermal_viscous_friction", "rate"),
    ("voltage_scaling", "nominal"),
    ("thermal_drift", "time_constant"),
    ("joint_compliance", "damping"),
    ("backlash", "stiffness"),
    ("backlash", "damping"),
}


class Figure(NamedTuple):
    """One figure of the scorecard, out of so many cases; shares in percent."""

    name: str
    figure: float
    of: int
    target: str = ""


def score(results: Sequence[dict[str, Any]]) -> list[Figure]:
    """Return the figures of these results."""
    judged = [judge_result(result) for result in results]
    one = _of(judged, "one")
    outside = _of(judged, "outside")
    two = [j for j in _of(judged, "two") if all(c["felt"] for c in j.result["causes"])]
    listed = _of(judged, "one", "two", "three")
    alone = [j for j in one if j.names == 1]
    rows = [row for j in judged for row in intervals(j)]
    plain = [row for row in rows if (row[0], row[1]) not in _SHAPES]
    named = [j.names for j in one if j.names]
    return [
        _share("truth in the named set", [j.covered for j in one], ">= 98 %"),
        _share("first name right, set of one", [first_right(j.result) for j in alone], ">= 95 %"),
        Figure("mean set size", float(np.mean(named)) if named else np.nan, len(named), "<= 1.5"),
        _share("false alarm", [_said(j) != "none" for j in _of(judged, "nothing")], "<= 2 %"),
        _share("outside called unknown", [_said(j) == "unknown" for j in outside], ">= 90 %"),
        _share("two effects both found", [j.covered for j in two], ">= 85 %"),
        _share("90 % intervals cover", [r[4] <= r[2] <= r[5] for r in plain], "85-95 %"),
        _share("three effects all found", [j.covered for j in _of(judged, "three")]),
        _share("below the floor: none or right", [j.covered for j in _of(judged, "below")]),
        _share("all and only the truth, in place", [j.placed for j in listed]),
        _share("an effect invented", [invented(j.result) for j in listed]),
        _share("listed called unknown", [_said(j) == "unknown" for j in listed]),
        _share("refused with an error", [_said(j) == "error" for j in judged]),
    ]


def breakdown(
    results: Sequence[dict[str, Any]], key: Callable[[Judged], str | None]
) -> list[Figure]:
    """Return the share of right answers per group of a key; None leaves a case out."""
    groups: dict[str, list[bool]] = {}
    for judged in map(judge_result, results):
        name = key(judged)
        if name is not None:
            groups.setdefault(name, []).append(judged.good)
    return [_share(name, hits) for name, hits in sorted(groups.items())]


def _of(judged: Sequence[Judged], *kinds: str) -> list[Judged]:
    return [j for j in judged if j.kind in kinds]


def _said(judged: Judged) -> str:
    return str(judged.result["verdict"])


def _share(name: str, hits: Iterable[bool], target: str = "") -> Figure:
    values = list(hits)
    return Figure(name, 100.0 * float(np.mean(values)) if values else np.nan, len(values), target)
