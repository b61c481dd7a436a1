"""Sessions as rows of a table, and what such a table depends on."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from wbc.effects import load_robot
from wbc.identification.answer.diagnosis.diagnosis import Estimate
from wbc.identification.trend.measure import Quantity, Session, SessionResult, measure_session
from wbc.results import Column
from wbc.robot.fingerprint import fingerprint

_TEXT = Column(kind="text")
_NUMBER = Column("see the column unit")

SESSION_COLUMNS = {
    "machine": _TEXT,
    "date": _TEXT,
    "effect": _TEXT,
    "where": _TEXT,
    "parameter": _TEXT,
    "value": _NUMBER,
    "low": _NUMBER,
    "high": _NUMBER,
    "unit": _TEXT,
    "failure": _TEXT,
    "warnings": _TEXT,
}
"""A row per session and quantity; a session that failed has one row, with the reason."""


def work_key(work: str, sessions: Sequence[Session], **settings: Any) -> dict[str, Any]:
    """Return what the results of all sessions depend on; see `work_names` for their logs.

    The column map enters by path, size and time of the last change.
    """
    first = sessions[0]
    return {
        "work": work,
        "robot": fingerprint(load_robot(first.robot)),
        "lossless": first.lossless,
        "columns": _stamp(first.columns) if first.columns else None,
        "version": version("wbc"),
        **settings,
    }


def work_names(sessions: Sequence[Session]) -> tuple[str, ...]:
    """Return a name for the part of every session: which one it is, and of which logs.

    Logs enter by path, size and time of the last change, not by content: reading all logs of a
    fleet would take as long as the work.
    """
    return tuple(
        f"{_digest([s.machine, s.date])}-{_digest([_stamp(path) for path in s.paths])}"
        for s in sessions
    )


def _digest(what: Sequence[Any]) -> str:
    return hashlib.sha256(json.dumps(what).encode("utf-8")).hexdigest()[:24]


def _stamp(path: str) -> list[str | int]:
    file = Path(path.partition("#")[0])
    try:
        found = file.stat()
    except OSError:
        return [path]
    return [path, found.st_size, found.st_mtime_ns]


def measured_rows(session: Session) -> dict[str, Any]:
    """Return the rows of one session; what a worker runs."""
    result = measure_session(session)
    empty: tuple[Quantity, Estimate] = (("", "", ""), Estimate(np.nan, "1", np.nan, np.nan))
    entries = list(result.values.items()) or [empty]
    count = len(entries)
    return {
        "machine": [result.machine] * count,
        "date": [result.date] * count,
        "effect": [effect for (effect, _, _), _ in entries],
        "where": [where for (_, where, _), _ in entries],
        "parameter": [parameter for (_, _, parameter), _ in entries],
        "value": [estimate.value for _, estimate in entries],
        "low": [estimate.low for _, estimate in entries],
        "high": [estimate.high for _, estimate in entries],
        "unit": [estimate.unit for _, estimate in entries],
        "failure": [result.failure] * count,
        "warnings": ["\n".join(result.warnings)] * count,
    }


def stored_sessions(columns: Mapping[str, Any], sessions: Sequence[Session]) -> list[SessionResult]:
    """Return the sessions of a table."""
    values: list[dict[Quantity, Estimate]] = [{} for _ in sessions]
    failures, warnings = [""] * len(sessions), [""] * len(sessions)
    numbers = {(s.machine, s.date): number for number, s in enumerate(sessions)}
    for row, session in enumerate(zip(columns["machine"], columns["date"], strict=True)):
        number = numbers[session]
        failures[number] = columns["failure"][row]
        warnings[number] = columns["warnings"][row]
        if failures[number]:
            continue
        effect, where, parameter = (columns[name][row] for name in ("effect", "where", "parameter"))
        value, low, high = (float(columns[name][row]) for name in ("value", "low", "high"))
        values[number][effect, where, parameter] = Estimate(value, columns["unit"][row], low, high)
    return [
        SessionResult(s.machine, s.date, s.paths, values[k], failures[k], _lines(warnings[k]))
        for k, s in enumerate(sessions)
    ]


def _lines(text: str) -> tuple[str, ...]:
    return tuple(text.split("\n")) if text else ()
