"""Logs whose columns hold something else than their names say, and logs with holes."""

from dataclasses import replace

import numpy as np
import pytest

from tests.moved import without_rows
from wbc.effects import CoulombFriction, load_robot
from wbc.identification import compare, diagnose
from wbc.identification.readings import SuspiciousLogError
from wbc.identification.records.not_judged import moving_bases
from wbc.measurement import Log, LogSource
from wbc.sim.excitation import record_with

LEG = load_robot("planar_leg_fixed").lossless()


@pytest.fixture(scope="module")
def runs() -> list[Log]:
    """Two runs of a leg whose hip rubs."""
    logs = record_with(LEG, [CoulombFriction("hip", 0.6)], duration=5.0)[:2]
    return [replace(log, source=LogSource(path=f"run{k}.csv")) for k, log in enumerate(logs)]


def test_a_hole_in_a_log_hides_no_cause(runs: list[Log]) -> None:
    holed = [without_rows(log, (901, 1101)) for log in runs]
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
    for logs in (runs, [jittery], [without_rows(runs[0], (1000, 1005))]):
        assert compare(LEG, logs).warnings == ()


SWAPPED = ("hip", "knee"), ("knee", "hip")


@pytest.mark.parametrize("column", ["base.position.z", "base.orientation.y", "base_z.position"])
def test_a_base_that_moves_is_told_to_a_robot_that_believes_it_fixed(
    runs: list[Log], column: str
) -> None:
    time = runs[0].time
    noise = 1e-3 * np.random.default_rng(0).standard_normal(time.size)
    held = [log.with_columns({column: 0.5 + noise}) for log in runs]
    assert compare(LEG, held).warnings == ()
    free = held[1].with_columns({column: 0.5 + noise + 0.01 * np.sin(3.0 * time)})
    (warning,) = compare(LEG, [held[0], free]).warnings
    place = column.removesuffix(".position")
    assert warning.startswith(f"run1.csv: the base moves ({place} by 0.02")
    assert "'planar_leg_fixed' is fixed" in warning
    assert [*moving_bases(load_robot("planar_leg"), [free])] == []


def test_motor_torques_are_exchanged_across_gears_that_differ(runs: list[Log]) -> None:
    gears = replace(LEG.transmission, gear_ratio=np.array([20.0, -10.0]))
    wrong = []
    for log in runs:
        torques = {f"{a}.motor_torque": 20.0 * log.column(f"{b}.rotor_torque") for a, b in SWAPPED}
        names = [name for name in log.names if "torque" not in name]
        wrong.append(log.select(names).with_columns(torques))
    with pytest.raises(SuspiciousLogError, match=r"^the torques of hip and knee are exchanged"):
        compare(replace(LEG, transmission=gears), wrong)
