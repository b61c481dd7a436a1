"""A fleet of machines diagnosed one by one: what each lacks, as one row of a table."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from wbc.effects import effect_class, load_robot
from wbc.errors import failure_text
from wbc.identification.answer.diagnose import diagnose
from wbc.identification.answer.diagnosis import Diagnosis
from wbc.identification.answer.words import verdict_sentence
from wbc.identification.records.record import output_names, output_units
from wbc.identification.trend.sessions import (
    Run,
    Session,
    in_table,
    lines_of,
    robot_and_logs,
    sessions_of,
)
from wbc.progress import Watch
from wbc.results import Column, read_results

_READ = ("machine", "date", "logs", "verdict", "sentence", "causes", "failure")
"""Columns that `FleetDiagnosis` holds; the diagnoses, 12 kB each, stay in the file."""
_LEVELS = ("before", "after", "attainable", "floor")


@dataclass(frozen=True)
class MachineDiagnosis:
    """What one session of one machine says.

    Attributes:
        machine: whose logs they are.
        date: ISO 8601.
        logs: paths.
        verdict: of the diagnosis, empty where it failed.
        sentence: the answer in words.
        causes: one text per cause: effect, place, probability that it is there, and what it cannot
            be told from.
        failure: why there is no diagnosis, empty otherwise.
    """

    machine: str
    date: str
    logs: tuple[str, ...]
    verdict: str
    sentence: str
    causes: tuple[str, ...]
    failure: str


@dataclass(frozen=True)
class FleetDiagnosis:
    """What the machines of a fleet lack.

    Attributes:
        machines: in order of machine and date.
        path: the table, with the errors of every output in N m or N beside each row and the whole
            diagnosis as JSON.
    """

    machines: tuple[MachineDiagnosis, ...]
    path: Path

    @property
    def verdicts(self) -> dict[str, int]:
        """How often each verdict was given, the most frequent one first."""
        return dict(Counter(m.verdict for m in self.machines if not m.failure).most_common())

    @property
    def failed(self) -> tuple[MachineDiagnosis, ...]:
        """Those that could not be diagnosed."""
        return tuple(m for m in self.machines if m.failure)

    @property
    def sentence(self) -> str:
        """How many machines lack something, as a person would say it."""
        count = len(self.machines)
        told = [f"{number} {verdict}" for verdict, number in self.verdicts.items()]
        told += [f"{len(self.failed)} not diagnosed"] if self.failed else []
        return f"{count} log set{'' if count == 1 else 's'}: {', '.join(told)}."

    def to_json(self) -> dict[str, Any]:
        """Return plain numbers, texts, lists and dictionaries."""
        return {
            "sentence": self.sentence,
            "verdicts": self.verdicts,
            "table": str(self.path),
            "machines": [asdict(machine) for machine in self.machines],
        }


def diagnose_fleet(
    robot: str,
    runs: Sequence[Run],
    out: str | Path,
    *,
    columns: str | None = None,
    lossless: bool = False,
    candidates: Sequence[str] | None = None,
    workers: int = 1,
    cluster: str | None = None,
    watch: Watch | None = None,
) -> FleetDiagnosis:
    """Diagnose every session of every machine; a row each, also for one that fails.

    A session is all logs of one machine with one date. A run that was killed goes on where it
    ended; the table is then the same to the last bit. So it is when the table grows: sessions
    that the file holds already are not diagnosed again unless their logs changed.

    Args:
        robot: name or path of the robot that all machines are held against.
        runs: the logs with machine and date.
        out: Parquet file of the rows.
        columns: path of a column map.
        lossless: start from perfect gears.
        candidates: names of the effects to consider; default all.
        workers: processes; -1 takes all cores.
        cluster: address of a Dask scheduler instead.
        watch: called with the log sets done and their total.

    Raises:
        IdentificationError: no run.
        EffectError: an unknown candidate.
        ResultsError: the file holds sessions that are not given, or the results of other work.
        ParallelError: workers is 0, or no cluster at the address.
    """
    sessions = sessions_of(robot, runs, columns, lossless)
    names = None if candidates is None else tuple(effect_class(name).name for name in candidates)
    work, settings = partial(diagnosed_row, names), {"candidates": names and list(names)}
    how: dict[str, Any] = {"workers": workers, "cluster": cluster, "watch": watch}
    path = in_table(Path(out), "diagnose", work, sessions, _columns(robot), settings, **how)
    return FleetDiagnosis(_stored(read_results(path, _READ)), path)


def diagnosed_row(candidates: Sequence[str] | None, session: Session) -> dict[str, Any]:
    """Return the row of one session; what a worker runs. Any error is a failure of it alone."""
    names = output_names(load_robot(session.robot))
    row: dict[str, Any] = {
        "machine": session.machine,
        "date": session.date,
        "logs": "\n".join(session.paths),
        **dict.fromkeys(("verdict", "causes", "sentence", "failure", "diagnosis"), ""),
        "explained": np.nan,
        **{f"{level}.{name}": np.nan for name in names for level in _LEVELS},
    }
    try:
        robot, logs = robot_and_logs(session)
        classes = None if candidates is None else [effect_class(name) for name in candidates]
        row |= _said(diagnose(robot, logs, classes))
    except Exception as error:  # whatever one machine does, the others are diagnosed
        row["failure"] = failure_text(error)
    return {name: [value] for name, value in row.items()}


def _said(found: Diagnosis) -> dict[str, Any]:
    causes = [
        f"{f.effect.name} at {f.effect.where}, probability {f.probability:.2f}"
        + "".join(f", or {rival}" for rival in f.rivals)
        for f in found.findings
    ]
    return {
        "verdict": found.verdict,
        "causes": "\n".join(causes),
        "sentence": verdict_sentence(found),
        "diagnosis": json.dumps(found.to_json()),
        "explained": found.explained,
        **{f"{level}.{o.output}": getattr(o, level) for o in found.outputs for level in _LEVELS},
    }


def _columns(robot: str) -> dict[str, Column]:
    loaded, text = load_robot(robot), Column(kind="text")
    outputs = zip(output_names(loaded), output_units(loaded), strict=True)
    return {
        **dict.fromkeys(("machine", "date", "logs", "verdict", "causes"), text),
        "explained": Column(),
        **{f"{level}.{name}": Column(unit) for name, unit in outputs for level in _LEVELS},
        **dict.fromkeys(("sentence", "failure", "diagnosis"), text),
    }


def _stored(columns: dict[str, Any]) -> tuple[MachineDiagnosis, ...]:
    rows = zip(*(columns[name] for name in _READ), strict=True)
    return tuple(
        MachineDiagnosis(machine, date, lines_of(logs), verdict, said, lines_of(causes), failure)
        for machine, date, logs, verdict, said, causes, failure in rows
    )
