"""Diagnose cases of the corpus and keep every result in a file of its own."""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.corpus.case import Case
from benchmarks.corpus.draw import draw_case
from benchmarks.corpus.folder import write_folder
from benchmarks.corpus.record import Table, record_cases
from benchmarks.corpus.truth import truth_of
from wbc.effects import load_robot
from wbc.errors import WbcError
from wbc.files import write_text
from wbc.identification import diagnose
from wbc.measurement import Log
from wbc.robot import Robot

Result = dict[str, Any]
_TOUCHES = 5.0  # [N], five times the largest noise of the force sensors


def try_cases(
    numbers: Sequence[int],
    folder: Path,
    seed: int,
    withheld: bool = False,
) -> list[Result]:
    """Diagnose these cases and write the results.

    Args:
        numbers: of the cases.
        folder: of the results.
        seed: of the corpus.
        withheld: take the force sensors away; flags say which contacts touch.
    """
    cases = [draw_case(number, seed) for number in numbers]
    start = time.perf_counter()
    tables = record_cases([(case, case.excitations) for case in cases])
    spent = (time.perf_counter() - start) / len(cases)
    results = []
    for case, recorded in zip(cases, tables, strict=True):
        logs = [without_forces(log) if withheld else log for log in logs_of(recorded)]
        result = {**tried(case, logs, withheld), "simulation_seconds": spent}
        write_text(folder / f"{result['number']:04d}.json", json.dumps(result))
        results.append(result)
    return results


def logs_of(tables: Sequence[Table]) -> list[Log]:
    """Return the logs of recorded tables."""
    return [Log(t["time"], {k: v for k, v in t.items() if k != "time"}) for t in tables]


def without_forces(log: Log, flags: bool = True) -> Log:
    """Return a log as a robot without force sensors gives it.

    Args:
        log: with forces.
        flags: with `<contact>.active`, 1 where the force is well above its noise.
    """
    columns = {n: v for n, v in log.columns.items() if ".force." not in n}
    if flags:
        for name in log.contacts:
            axes = [log.column(n) for n in log.names if n.startswith(f"{name}.force.")]
            columns[f"{name}.active"] = (np.linalg.norm(axes, axis=0) > _TOUCHES).astype(float)
    return Log(log.time, columns, log.source)


def robot_of(case: Case) -> Robot:
    """Return the robot that the user of this case believes in, loaded from its folder."""
    with tempfile.TemporaryDirectory() as folder:
        return load_robot(str(write_folder(case.machine, Path(folder))))


def tried(case: Case, logs: Sequence[Log], withheld: bool = False) -> Result:
    """Diagnose a case; return the result held against its truth."""
    result, robot = described(case, withheld), robot_of(case)
    start = time.process_time()
    try:
        diagnosis = diagnose(robot, logs)
    except WbcError as error:
        return {**result, "verdict": "error", "message": str(error), "found": []}
    result["seconds"] = time.process_time() - start
    result |= {
        "verdict": diagnosis.verdict,
        "before": diagnosis.error.before,
        "after": diagnosis.error.after,
        "remainder": diagnosis.remainder,
        "found": [
            {
                "effect": finding.effect.name,
                "where": finding.effect.where,
                "alternatives": list(finding.rivals),
                # Of the cause or one that is not told from it: ties score as a group.
                "probability": finding.support.group_probability,
                "support": asdict(finding.support),
                "parameters": {
                    name: [estimate.value, estimate.low, estimate.high]
                    for name, estimate in finding.parameters.items()
                },
            }
            for finding in diagnosis.findings
        ],
    }
    return result


def described(case: Case, withheld: bool = False) -> Result:
    """Return what is hidden in a case, and how it was recorded."""
    truth = truth_of(case, withheld)
    return {
        "number": case.number,
        "family": case.machine.family,
        "richness": case.richness,
        "runs": [run.kind for run in case.excitations],
        "sensors": asdict(case.sensors),
        "label": case.label,
        "unlisted": case.unlisted,
        "flaws": [[f.effect, f.where, dict(f.values)] for f in case.flaws],
        "causes": [asdict(cause) for cause in truth.causes],
        "merged": [[list(pair), name] for pair, name in truth.merged],
        "unexplained": truth.unexplained,
        "seconds": 0.0,
    }
