"""What must hold of every diagnosis, whatever the method."""

from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tests.columns import write_columns
from tests.moved import moved, swing
from wbc import load_robot
from wbc.effects import (
    ActuationDelay,
    CoulombFriction,
    CurrentLimit,
    Presliding,
    TorqueConstant,
    TorqueOffset,
    TransmissionEfficiency,
    ViscousFriction,
)
from wbc.identification import compare, diagnose
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.residual import condensed_residual
from wbc.measurement import Log, load_logs
from wbc.measurement.filters import turned
from wbc.robot import Effect, Robot

LEG = load_robot("planar_leg_fixed").lossless()
HIDDEN = [CoulombFriction("hip", 0.5), ViscousFriction("knee", 0.3)]
KINDS: list[type[Effect]] = [CoulombFriction, ViscousFriction, TransmissionEfficiency]
RUNS = tuple(swing(LEG.with_effects(*HIDDEN), k, float(k), seconds=4.0) for k in (1, 2, 3))


Numbers = dict[tuple[str, str, str], float]


def answer(logs: Sequence[Log]) -> Numbers:
    found = diagnose(LEG, logs, KINDS).findings
    return {(*f.effect.key, name): e.value for f in found for name, e in f.numbers.items()}


@cache
def usual() -> Numbers:
    """Return the answer to the runs as they are, which the tests hold theirs beside."""
    return answer(RUNS)


TRUTH = {
    ("coulomb_friction", "hip", "level"): 0.5,
    ("viscous_friction", "knee", "coefficient"): 0.3,
}


@pytest.mark.parametrize("count", [1, 2, 3])
def test_more_logs_never_turn_a_right_answer_wrong(count: int) -> None:
    found = usual() if count == len(RUNS) else answer(RUNS[:count])
    assert found == pytest.approx(TRUTH, rel=0.05)


def test_the_order_of_logs_and_columns_changes_nothing() -> None:
    turned = [log.select(reversed(log.names)) for log in reversed(RUNS)]
    assert answer(turned) == pytest.approx(usual(), rel=1e-3)


def test_copies_of_a_run_and_columns_that_no_cause_needs_change_nothing() -> None:
    more = [log.with_columns({"hip.temperature": np.full(len(log), 30.0)}) for log in RUNS]
    assert answer([*more, more[0]]) == pytest.approx(usual(), rel=1e-9)


def test_velocities_that_are_late_change_nothing() -> None:
    """Delays and frictions stood for the time that `wbc check` measures."""
    late, step = [], 2.0 * np.pi / 2**12
    for log in RUNS:
        moved = {}
        for joint in LEG.transmission.joints:
            velocity = np.interp(log.time - 0.012, log.time, log.column(f"{joint}.velocity"))
            coarse = step * np.round(log.column(f"{joint}.position") / step)
            moved |= {f"{joint}.velocity": velocity, f"{joint}.position": coarse}
        late.append(log.with_columns(moved))
    assert answer(late) == pytest.approx(TRUTH, rel=0.05)


def test_torques_that_are_all_late_change_nothing() -> None:
    """Drags of four joints stood for another clock; a delay of one joint is a cause."""
    arm = load_robot("staubli_tx40").lossless()
    waves = np.random.default_rng(0).uniform((0.05, 0.5, 0.0), (0.3, 6.0, 6.0), (6, 3, 3))
    run = moved(arm, np.arange(0.0, 8.0, 0.004), waves)
    names = [name for name in run.columns if name.endswith("torque")]
    usual, late, one = (
        compare(arm, [turned(run, shares, -0.005)]).error for shares in ([], names, names[:1])
    )
    assert late == pytest.approx(usual, rel=0.1)
    assert one > 1.4 * usual


def test_a_delay_that_causes_take_back_is_none_of_all_torques() -> None:
    """Only causes that can be no time counted beside it: six delays stayed in a recorded arm."""
    arm = load_robot("staubli_tx40").lossless()
    sizes = zip(arm.transmission.joints, (9.0, 9.0, 4.0, 2.0, 2.0, 1.0), strict=True)
    rubs = [ViscousFriction(joint, coefficient=size) for joint, size in sizes]
    waves = np.random.default_rng(0).uniform((0.05, 0.5, 0.0), (0.3, 6.0, 6.0), (6, 3, 3))
    run = moved(arm.with_effects(*rubs), np.arange(0.0, 8.0, 0.004), waves)
    names = [name for name in run.columns if name.endswith("torque")]
    problem = EstimationProblem.from_logs(arm, [turned(run, names, 0.018)])
    delays = [ActuationDelay(joint, delay=0.018) for joint in arm.transmission.joints]
    retimed = problem.retimed(arm, [*rubs, *delays])
    assert retimed is not None
    assert retimed.lag == pytest.approx(-0.018, abs=5e-4)
    assert sum("All torques are" in text for text in retimed.warnings) == 1


def test_friction_that_builds_up_is_no_delay_of_all_torques() -> None:
    """It is late by itself: 54 ms were taken out, and delays of all drives stood for them."""
    arm = load_robot("staubli_tx40").lossless()
    sizes = zip(arm.transmission.joints, (9.0, 9.0, 4.0, 2.0, 2.0, 1.0), strict=True)
    bent = arm.with_effects(*(Presliding(j, level=size, length=0.02) for j, size in sizes))
    waves = np.random.default_rng(0).uniform((0.05, 0.5, 0.0), (0.3, 6.0, 6.0), (6, 3, 3))
    run = moved(bent, np.arange(0.0, 8.0, 0.004), waves)
    assert not any("motion" in warning for warning in compare(arm, [run]).warnings)


def test_friction_that_builds_up_over_a_fifth_of_a_milliradian_is_found() -> None:
    """Below 0.004 of the travel none was tried: plain fits with twenty names stood there."""
    bent, time = LEG.with_effects(Presliding("hip", level=0.5, length=2e-4)), np.arange(0, 8, 0.004)
    waves = np.random.default_rng(0).uniform((0.2, 0.5, 0.0), (0.4, 2.0, 6.0), (2, 2, 2, 3))
    logs = [moved(bent, time, own, seed=k) for k, own in enumerate(waves)]
    (found,) = diagnose(LEG, logs, [*KINDS, Presliding]).findings
    assert found.effect.key == ("presliding", "hip")
    assert found.certain
    assert found.effect.values["length"] == pytest.approx(2e-4, rel=0.2)


def test_repeats_never_lower_the_noise_floor() -> None:
    """What an encoder's steps do repeats with the motion, and cancels between two such runs."""
    coarse, step = [], 2.0 * np.pi / 2**12
    for seed, run in enumerate(RUNS[:2]):
        names = [f"{j}.position" for j in LEG.transmission.joints]
        columns = {name: step * np.round(run.column(name) / step) for name in names}
        noise = 1e-6 * np.random.default_rng(seed).standard_normal(len(run))
        columns["hip.rotor_torque"] = run.column("hip.rotor_torque") + noise
        coarse.append(run.with_columns(columns))
    torque = coarse[0].column("knee.rotor_torque")
    repeat = coarse[0].with_columns({"knee.rotor_torque": torque * (1.0 + 1e-9)})
    alone = {o.output: o.floor for o in compare(LEG, coarse).outputs}
    repeated = {o.output: o.floor for o in compare(LEG, [*coarse, repeat]).outputs}
    assert all(repeated[name] > 0.95 * alone[name] for name in alone)


def test_repeats_are_paired_by_time_not_by_a_count_of_rows() -> None:
    """A repeat with one row less was no repeat: its scatter said nothing of the noise."""
    first, names = RUNS[0], [f"{joint}.rotor_torque" for joint in LEG.transmission.joints]
    wave = 0.05 * np.sin(2.0 * first.time)
    again = first.with_columns({name: first.column(name) + wave for name in names})
    whole = compare(LEG, [first, again, RUNS[1]])
    shorter = compare(LEG, [first, again[:-3], RUNS[1]])
    for one, other in zip(whole.outputs, shorter.outputs, strict=True):
        assert other.floor == pytest.approx(one.floor, rel=0.05)


def test_the_rounding_of_stamps_does_not_raise_the_noise_floor() -> None:
    """A last stamp that came early took a sample away: filters ended otherwise."""
    first, floors = RUNS[0], []
    for seed in (0, 2):  # only the last stamp of the second is early
        late = 2e-5 * np.random.default_rng(seed).standard_normal(len(first))
        again = Log(np.round(first.time + late, 5), dict(first.columns))
        floors.append([o.floor for o in compare(LEG, [first, again, RUNS[1]]).outputs])
    assert floors[1] == pytest.approx(floors[0], rel=0.2)


def test_a_joint_that_carries_next_to_nothing_gets_no_statement() -> None:
    """Whatever its drive reports is as large as its noise: any cause there explains noise."""
    random = np.random.default_rng(2)
    logs = [
        log.with_columns({"knee.rotor_torque": 0.02 * random.standard_normal(len(log))})
        for log in RUNS[:2]
    ]
    found = diagnose(LEG, logs, [*KINDS, TorqueConstant, TorqueOffset])
    assert not [f for f in found.findings if f.effect.where == "knee"]
    assert found.silent == ("knee",)


def test_what_a_drive_takes_away_of_the_noise_is_no_evidence() -> None:
    """A current limit stood for the losses of a calf: it clips the noise of a torque, too.

    Two runs of one motion differ by their noise alone.
    """
    rates = np.array([[2.3, 5.1], [3.1, 6.7]])
    waves = np.stack([np.full((2, 2), 0.35), rates, rates[:, ::-1]], axis=-1)
    time = np.arange(0.0, 30.0, 4e-3)
    logs = [moved(LEG, time, waves, (2e-6, 3e-4, 0.2), seed=seed) for seed in (1, 2)]
    problem = EstimationProblem.from_logs(LEG, logs)
    limited, scaled = (
        problem.fit([own], iterations=0)
        for own in (CurrentLimit("knee", 0.3), TorqueConstant("knee", 0.8))
    )

    def noise(robot: Robot) -> np.ndarray:
        one, other = (condensed_residual(robot, [record]) for record in problem.records)
        return np.mean(((one - other) @ problem.whitening) ** 2, axis=0) / 2.0

    gone = noise(LEG) - noise(limited.robot)
    assert gone[1] > 0.5
    np.testing.assert_allclose(problem.quieter(limited)[0], gone, atol=0.2)
    np.testing.assert_allclose(problem.quieter(scaled), 0.0, atol=1e-3)


def test_units_and_the_side_of_the_gear_change_nothing(tmp_path: Path) -> None:
    """Degrees, and millinewton metres behind the gear, told by a map."""
    units = {"position": ("deg", 180.0 / np.pi), "velocity": ("deg/s", 180.0 / np.pi)}
    units["rotor_torque"] = ("mN m", 1e3 * LEG.transmission.gear_ratio[0])  # of both gears
    lines, files = ["[columns]"], []
    for name in RUNS[0].names:
        ours, unit = name.replace("rotor", "motor"), units[name.partition(".")[2]][0]
        lines.append(f'"{ours}" = {{ from = "{name.replace(".", "_")}", unit = "{unit}" }}')
    (tmp_path / "columns.toml").write_text("\n".join(lines))
    for k, log in enumerate(RUNS):
        theirs = {"time": log.time}
        for name, values in log.columns.items():
            theirs[name.replace(".", "_")] = units[name.partition(".")[2]][1] * values
        files.append(write_columns(theirs, tmp_path / f"run{k}.csv"))
    assert answer(load_logs(files, tmp_path / "columns.toml")) == pytest.approx(usual(), rel=1e-6)
