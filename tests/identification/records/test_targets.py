"""Logs without torque: the targets and the gains of the drives make it.

The plant is independent of the library; its drives follow a target by kp and kd.
"""

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from tests.conftest import Told
from tests.recover.plant import JOINTS, Lane, reference, simulate
from wbc.dynamics import link_torque, rotor_torque
from wbc.effects import (
    ActuationDelay,
    CoulombFriction,
    CurrentLimit,
    PayloadMass,
    RotorInertia,
    TransmissionEfficiency,
    ViscousFriction,
    load_robot,
)
from wbc.errors import LogError
from wbc.identification import diagnose
from wbc.identification.choice.candidate_columns import evidence
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.model.residual import condensed_residual
from wbc.identification.readings import check_robot
from wbc.identification.records.drives import drive_torques
from wbc.identification.records.preparation import prepare
from wbc.measurement import Log, save_log
from wbc.robot import Effect, Motion, Robot, robots_directory

GAINS = {"position_gain": np.array([120.0, 60.0]), "velocity_gain": np.array([7.0, 3.0])}


def with_gains(factor: float = 1.0) -> Robot:
    robot = load_robot("planar_leg_fixed").lossless()
    return robot.with_transmission(
        robot.transmission.replace(**{name: factor * gain for name, gain in GAINS.items()})
    )


LOSSES: dict[str, Any] = {"eta_f": (1.0, 0.8), "eta_b": (1.0, 0.75), "coulomb": (0.5, 0.0)}
LOGS = 2  # of each of two machines
Tables = list[dict[str, np.ndarray]]


LANES = [Lane(flaws, k, noise=k) for flaws in ({}, LOSSES) for k in range(LOGS)]


@pytest.fixture(scope="module")
def tables() -> Tables:
    """Return runs of a machine as drawn, then of one that loses power and rubs."""
    return simulate(LANES, duration=4.5, step=5e-4, rate=200.0)


def target_log(
    lane: Lane, table: dict[str, np.ndarray], late: tuple[float, float] = (0.0, 0.0), every: int = 1
) -> Log:
    """Return targets, which each drive follows some time [s] later, and motion; no torque."""
    table = {name: own[::every] for name, own in table.items()}
    columns = {name: own for name, own in table.items() if name.endswith(("velocity", "position"))}
    for j, joint in enumerate(JOINTS):
        wanted = reference(lane)(table["time"] + late[j])
        columns[f"{joint}.goal_position"] = wanted[0][j]
        columns[f"{joint}.target_velocity"] = wanted[1][j]
    return Log(table["time"], columns)


@pytest.fixture(scope="module")
def logs(tables: Tables) -> list[Log]:
    return [target_log(lane, table) for lane, table in zip(LANES, tables, strict=True)]


def test_targets_and_gains_make_the_torque_that_the_drive_was_told(
    tables: Tables, logs: list[Log]
) -> None:
    gears = with_gains().transmission
    told = np.stack([tables[0][f"{joint}.rotor_torque"] for joint in JOINTS], axis=1)
    error = drive_torques(logs[0], gears).torque - told
    # The plant's drives see no sensor noise: 3e-3 rad/s times kd over a ratio of 20, and 2e-3 N m.
    np.testing.assert_allclose(error.std(axis=0), [2.26e-3, 2.05e-3], rtol=0.1)
    assert np.abs(error).max() < 6.0 * 2.3e-3
    limited = gears.replace(torque_limit=np.array([0.05, 0.05]))
    assert np.abs(drive_torques(logs[0], limited).torque).max() == 0.05
    with pytest.raises(LogError, match=r"below \[gears\.hip\] in robot\.toml:\n +kp = "):
        drive_torques(logs[0], load_robot("planar_leg_fixed").transmission)


def test_a_coupled_motor_follows_the_target_of_its_own_motion() -> None:
    gears = load_robot("parallelogram_leg").transmission
    kp = np.arange(1.0, gears.size + 1.0)
    gears, error = gears.replace(position_gain=kp), 0.1 * kp
    columns = {f"{joint}.position": np.zeros(5) for joint in gears.joints}
    for joint, wanted in zip(gears.joints, error, strict=True):
        columns[f"{joint}.target_position"] = np.full(5, wanted)
    made = drive_torques(Log(np.linspace(0.0, 1.0, 5), columns), gears).torque[0]
    # Virtual work: the springs kp at the motors' outputs store 1/2 kp (D^-1 e)^2.
    psi = np.linalg.solve(gears.topology, error)
    np.testing.assert_allclose(made * gears.gear_ratio, kp * psi)


def test_true_gains_leave_noise_only_and_wrong_ones_are_a_wrong_scale(logs: list[Log]) -> None:
    assert {f.kind for f in check_robot(logs[0], load_robot("planar_leg_fixed"))} == {
        "no_drive_gains"
    }
    assert not check_robot(logs[0], with_gains())
    found = diagnose(with_gains(), logs[:LOGS])
    assert found.verdict == "none"
    assert max(output.after for output in found.outputs) < 0.02
    wrong = diagnose(with_gains(0.8), logs[:LOGS])
    assert {e.key for e in wrong.robot.effects} == {("torque_constant", j) for j in JOINTS}
    for effect in wrong.robot.effects:
        assert effect.values["factor"] == pytest.approx(1.25, rel=0.01)


def test_drives_that_are_not_late_alike_are_late_and_nothing_else(tables: Tables) -> None:
    """Rotor inertias of what the times miss were certain beside the two delays."""
    log = target_log(LANES[0], tables[0], late=(0.004, 0.0046))
    found = diagnose(with_gains(), [log])
    assert {f.effect.name for f in found.findings if f.certain} <= {"actuation_delay"}


def late_log(robot: Robot, delay: float, seen: float, lag: float, rubbing: float) -> Log:
    """Return targets and positions of drives with these times [s].

    Args:
        rubbing: viscous friction at the hip [N m s/rad].
    """
    time = np.arange(0.0, 12.0, 0.004)
    rates = np.array([[3.1, 7.3, 12.1], [2.3, 8.7, 13.9]])

    def motion(at: np.ndarray, slow: float = 0.0) -> Motion:
        waves = (
            -0.25j * np.exp(1j * np.multiply.outer(at, rates)) / rates / (1.0 + 1j * rates * slow)
        )
        q, v, a = (np.sum(waves * (1j * rates) ** k, axis=2).real for k in range(3))
        return Motion(np.array([0.4, -0.8]) + q, v, a)

    gears, now, late = robot.transmission, motion(time), motion(time - seen)
    made = rotor_torque(robot, now, link_torque(robot, now))[0] * gears.gear_ratio
    made[:, 0] += rubbing * now.velocity[:, 0]
    braking = gears.velocity_gain * motion(time - seen, lag).velocity
    wanted = late.position + (made + braking) / gears.position_gain
    noise = np.random.default_rng(0).normal(scale=1e-5, size=now.position.shape)
    columns = {}
    for k, joint in enumerate(JOINTS):
        columns[f"{joint}.position"] = now.position[:, k] + noise[:, k]
        told = CubicSpline(time - delay, wanted[:, k])
        columns[f"{joint}.target_position"] = told(np.minimum(time, time[-1] - delay))
    return Log(time, columns)


@pytest.mark.parametrize(
    ("delay", "seen", "lag", "rubbing"),
    [(0.016, 0.008, 0.0, 0.0), (0.0035, 0.0015, 0.0026, 0.4), (0.001, 0.003, 0.0026, 0.4)],
)
def test_late_drives_do_not_rub(delay: float, seen: float, lag: float, rubbing: float) -> None:
    """Friction below zero stood for what they see late, friction of all for a late target."""
    robot = with_gains()
    log = late_log(robot, delay, seen, lag, rubbing)
    found = EstimationProblem.from_logs(robot, [log])
    known = found.robot.transmission
    np.testing.assert_allclose(known.target_delay, delay, atol=4e-5)
    np.testing.assert_allclose(known.feedback_delay, seen, atol=4e-5)
    np.testing.assert_allclose(np.nan_to_num(known.velocity_lag), lag, atol=4e-5)
    assert rubbing or np.sqrt(found.first).max() < 1.0


@pytest.mark.parametrize(("body", "mass"), [("shin", 0.3), ("thigh", 0.6)])
def test_a_payload_is_no_time_of_the_drives(body: str, mass: float) -> None:
    """Its inertia stood for the filter, and rotor inertias for what the wrong filter left."""
    robot = with_gains()
    log = late_log(PayloadMass(body, mass).change(robot), 0.0035, 0.0015, 0.0026, 0.0)
    known = EstimationProblem.from_logs(robot, [log]).robot.transmission
    np.testing.assert_allclose(known.velocity_lag, 0.0026, atol=2e-4)
    np.testing.assert_allclose(known.target_delay, 0.0035, atol=2e-4)
    np.testing.assert_allclose(known.feedback_delay, 0.0015, atol=2e-4)


@pytest.mark.parametrize(("body", "mass", "joint"), [("shin", 0.3, "hip"), ("thigh", 0.6, "knee")])
def test_a_lossy_gear_and_a_payload_are_no_times(body: str, mass: float, joint: str) -> None:
    """Both moved the filter of the velocities, and rotor inertias made up for it."""
    robot = with_gains()
    hidden = robot.with_effects(TransmissionEfficiency(joint, 0.85, 0.8))
    log = late_log(PayloadMass(body, mass).change(hidden), 0.0035, 0.0015, 0.0026, 0.0)
    found = diagnose(robot, [log])
    assert {e.key for e in found.robot.effects} == {
        ("transmission_efficiency", joint),
        ("payload_mass", body),
    }
    np.testing.assert_allclose(found.robot.transmission.velocity_lag, 0.0026, atol=2e-4)


def test_times_of_a_drive_make_viscous_friction_but_neither_dry_nor_inertia() -> None:
    """All were doubted that are as small as what a drive makes whose target is late by itself."""
    robot = with_gains()
    problem = EstimationProblem.from_logs(robot, [late_log(robot, 0.0035, 0.0015, 0.0026, 0.0)])
    inertia = float(robot.transmission.reflected_inertia[1]) + 0.01

    def untimely(effect: Effect) -> float:
        added = condensed_residual(problem.robot.with_effects(effect), problem.records)
        change = (added - problem.residual) @ problem.whitening
        return problem.untimely(change, np.full(2, 0.01))

    assert untimely(ViscousFriction("knee", 60.0 * 2e-4)) < 6.0
    assert untimely(CoulombFriction("knee", 60.0 * 2e-4)) > 20.0
    assert untimely(RotorInertia("knee", inertia)) > 20.0


def test_a_hidden_loss_and_friction_are_named_from_targets(tables: Tables) -> None:
    """At 50 Hz, too: no drive that is late by times of its own makes dry friction."""
    pairs = zip(LANES[LOGS:], tables[LOGS:], strict=True)
    found = diagnose(with_gains(), [target_log(*pair, every=4) for pair in pairs])
    assert all(finding.certain for finding in found.findings)
    named = {(e.name, e.where): e for e in found.robot.effects}
    assert set(named) == {("transmission_efficiency", "knee"), ("coulomb_friction", "hip")}
    gear, friction = named["transmission_efficiency", "knee"], named["coulomb_friction", "hip"]
    assert gear.values["forward_efficiency"] == pytest.approx(0.8, abs=0.01)
    assert friction.values["level"] == pytest.approx(0.5, abs=0.02)


def test_init_asks_for_gains_where_the_files_hold_targets(
    tmp_path: Path, logs: list[Log], told: Told
) -> None:
    names = [f"{joint}.{kind}" for joint in JOINTS for kind in ("position", "goal_position")]
    run = save_log(logs[0].select(names), tmp_path / "run.csv")
    text = (robots_directory() / "planar_leg_fixed" / "robot.toml").read_text(encoding="utf-8")
    model = robots_directory() / "planar_leg_fixed" / tomllib.loads(text)["model"]
    said = told("init", model, run, "--out", out := tmp_path / "leg")
    assert "no torque but targets" in said
    gears = load_robot(out / "robot.toml").transmission
    assert gears.joints == JOINTS
    assert np.isfinite(gears.position_gain).all()
    written = (out / "robot.toml").read_text(encoding="utf-8")
    assert written.count("guess: not in the model file; look it up; it scales every torque") == 2


def test_a_measured_current_is_within_any_limit() -> None:
    gears = with_gains().transmission.replace(torque_constant=np.array([0.1, 0.1]))
    robot, time = with_gains().with_transmission(gears), np.linspace(0.0, 2.0, 401)
    for channel, offered in (("current", False), ("rotor_torque", True)):
        columns = {f"{joint}.{channel}": np.cos(9.0 * time) for joint in JOINTS}
        columns |= {f"{j}.position": np.sin(r * time) for j, r in zip(JOINTS, (3, 5), strict=True)}
        shown = evidence(robot, prepare(robot, [Log(time, columns)]))
        screens = CurrentLimit.search.screens
        assert [bool(screens(CurrentLimit, robot, j, shown)) for j in JOINTS] == [offered] * 2


def test_only_the_target_comes_late() -> None:
    robot, time = with_gains(), np.linspace(0.0, 1.0, 101)
    told, own = np.sin(7.0 * time), np.cos(11.0 * time)
    feedback = np.stack([own, own], axis=1)
    motion = Motion(*np.zeros((3, 101, 2)), time, feedback_torque=feedback)
    both, delay = feedback + told[:, None], ActuationDelay("hip", 0.02)
    late = delay.drive(robot, motion, both)
    np.testing.assert_allclose(late[2:, 0], told[:-2] + own[2:], atol=1e-12)
    np.testing.assert_allclose(late[:, 1], both[:, 1])
    back = delay.drive_inverse(robot, motion, late)
    np.testing.assert_allclose(back[2:-2], both[2:-2], atol=1e-12)
