"""Logs whose columns hold something else than their names say, and logs with holes."""

from __future__ import annotations

import numpy as np
import pytest

from sims.excitation import record_with
from wbc.effects import CoulombFriction, load_robot
from wbc.identification import compare, diagnose
from wbc.measurement import Log, LogSource

LEG = load_robot("planar_leg_fixed").lossless()


@pytest.fixture(scope="module")
def runs() -> list[Log]:
    """Two runs of a leg whose hip rubs."""
    logs = record_with(LEG, [CoulombFriction("hip", 0.6)], duration=5.0)[:2]
    return [log.with_source(LogSource(path=f"run{k}.csv")) for k, log in enumerate(logs)]


def _without(log: Log, start: float, stop: float) -> Log:
    """Return a log without the samples of start <= time < stop [s]."""
    kept = (log.time < start) | (log.time >= stop)
    columns = {name: values[kept] for name, values in log.columns.items()}
    return Log(log.time[kept], columns, log.source)


def test_a_hole_in_a_log_hides_no_cause(runs: list[Log]) -> None:
    holed = [_without(log, 1.8, 2.2) for log in runs]
    comparison, whole = compare(LEG, holed), compare(LEG, runs)
    assert len(comparison.series) == 4
    for seen, expected in zip(comparison.outputs, whole.outputs, strict=True):
        assert seen.rms == pytest.approx(expected.rms, rel=0.15)
    diagnosis = diagnose(LEG, holed)
    assert [(e.name, e.where) for e in diagnosis.effects] == [("coulomb_friction", "hip")]
    for warnings in (comparison.warnings, diagnosis.warnings):
        assert len(warnings) == 2
        assert warnings[0].startswith("run0.csv: samples are missing for 0.402 s at 1.800 s.")


def test_honest_logs_are_compared_without_a_word(runs: list[Log]) -> None:
    uneven = np.random.default_rng(0).uniform(-0.4, 0.4, len(runs[0])) * 0.002
    jittery = Log(runs[0].time + uneven, runs[0].columns)
    for logs in (runs, [jittery], [_without(runs[0], 2.0, 2.009)]):
        assert compare(LEG, logs).warnings == ()
