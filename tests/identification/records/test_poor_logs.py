"""Logs that say little, or that must not be believed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from scipy.signal import butter, sosfiltfilt

from tests.outside import outside
from tests.recover.plant import Lane, recorded
from wbc.effects import CoulombFriction, load_robot
from wbc.identification import compare, diagnose
from wbc.identification.answer.diagnose import about_silent
from wbc.identification.answer.words import verdict_sentence
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.records.filters import low_passed, quantisation_level
from wbc.identification.records.not_judged import reported_torque
from wbc.measurement import Log, SuspiciousLogError, load_logs

ROBOT = load_robot("planar_leg_fixed").lossless()
JOINTS = ("hip", "knee")


@pytest.fixture(scope="module")
def runs() -> list[Log]:
    """Two runs of a leg whose hip rubs, and one of a leg whose hip rubs more."""
    rubs, more = {"coulomb": (0.6, 0.0)}, {"coulomb": (0.75, 0.0)}
    return recorded(Lane(rubs, 3, noise=1), Lane(rubs, 4, noise=2), Lane(more, 4, noise=7))


@pytest.fixture
def friction(runs: list[Log]) -> list[Log]:
    return runs[:2]


def _standing(torque_error: float) -> Log:
    """Return a log of a leg that is held at one pose."""
    random = np.random.default_rng(0)
    count, pose = 2000, np.array([0.3, -0.6])
    gravity = pin.computeGeneralizedGravity(ROBOT.model, ROBOT.model.createData(), pose)
    columns: dict[str, np.ndarray] = {}
    for k, joint in enumerate(JOINTS):
        columns[f"{joint}.position"] = pose[k] + 2e-5 * random.standard_normal(count)
        columns[f"{joint}.velocity"] = 3e-3 * random.standard_normal(count)
        torque = gravity[k] / 20.0 + torque_error
        columns[f"{joint}.rotor_torque"] = torque + 2e-3 * random.standard_normal(count)
    return Log(0.002 * np.arange(count), columns)


@pytest.mark.parametrize("error", [0.0, 0.05])
def test_where_nothing_moves_nothing_is_named_and_the_log_is_stopped(error: float) -> None:
    with pytest.raises(SuspiciousLogError, match=r"no joint moves.*Record the robot in motion"):
        diagnose(ROBOT, [_standing(error)])


@pytest.mark.parametrize("noise", [(2e-5, 3e-3), (1e-5, 1e-3)])
def test_a_joint_that_holds_still_does_not_rub_against_its_noise(
    noise: tuple[float, float],
) -> None:
    """Between the limits of its friction a held joint may carry any torque, here none."""
    random, time = np.random.default_rng(1), 0.004 * np.arange(1500)
    swing = 0.6 * np.sin(5.0 * time) * np.array([[0.0], [1.0]])
    rate, rise = np.gradient(swing, 0.004, axis=1), -25.0 * swing
    data = ROBOT.model.createData()
    pose = np.array([[0.6], [-0.3]]) + swing
    torque = np.array(
        [pin.rnea(ROBOT.model, data, *x) for x in zip(pose.T, rate.T, rise.T, strict=True)]
    ).T
    torque = (torque + ROBOT.transmission.reflected_inertia[:, None] * rise) / 20.0
    columns: dict[str, np.ndarray] = {}
    for k, joint in enumerate(JOINTS):
        drawn = random.standard_normal((3, time.size))
        columns[f"{joint}.position"] = pose[k] + noise[0] * drawn[0]
        columns[f"{joint}.velocity"] = rate[k] + noise[1] * drawn[1]
        columns[f"{joint}.rotor_torque"] = torque[k] + 2e-3 * drawn[2]
    log = Log(time, columns)
    rubbing = ROBOT.with_effect(CoulombFriction("hip", 0.6))
    assert compare(rubbing, [log]).error == pytest.approx(compare(ROBOT, [log]).error, rel=0.02)


def test_drives_that_report_only_noise_are_named_first(friction: list[Log]) -> None:
    random = np.random.default_rng(5)
    noise = {f"{j}.rotor_torque": 2e-3 * random.standard_normal(len(friction[0])) for j in JOINTS}
    diagnosis = diagnose(ROBOT, [friction[0].with_columns(noise)])
    assert diagnosis.silent == JOINTS
    assert diagnosis.verdict == "unknown"
    assert not diagnosis.findings
    sentence = verdict_sentence(diagnosis)
    assert sentence.endswith("the drives of hip and knee report only noise.")
    assert "N m" not in sentence
    assert diagnosis.next_experiment.startswith("The drives of hip and knee report only noise")
    assert "correct its column" in diagnosis.next_experiment
    assert diagnosis.warnings[-1].startswith("hip, knee: no drive reports more than noise")


def test_noise_as_large_as_what_the_motion_needs_is_set_aside_too(
    friction: list[Log],
) -> None:
    random = np.random.default_rng(5)
    deaf = []
    for log in friction:
        noise = random.standard_normal(len(log))
        needed = log.column("knee.rotor_torque").std()
        deaf.append(log.with_columns({"knee.rotor_torque": 4.0 * needed * noise}))
    problem = EstimationProblem.from_logs(ROBOT, deaf)
    reported = np.concatenate([reported_torque(record)[:, 1] for record in problem.records])
    assert np.std(reported) > 0.5 * np.std(reported - problem.residual[:, 1])
    assert problem.silent == ("knee",)
    (both,) = about_silent(("hip", "knee"))
    assert both.startswith("hip, knee: the torques that their drives report")
    # What friction adds to an honest report hides no share of the load.
    assert EstimationProblem.from_logs(ROBOT, friction).silent == ()


def test_logs_of_two_machines_are_seen_to_disagree(runs: list[Log]) -> None:
    diagnosis = diagnose(ROBOT, [runs[0], runs[2]], [CoulombFriction])
    texts = [text for finding in diagnosis.findings for text in finding.warnings]
    assert any("the logs disagree on level" in text for text in texts)
    agreeing = diagnose(ROBOT, runs[:2], [CoulombFriction])
    texts = [text for finding in agreeing.findings for text in finding.warnings]
    assert not any("disagree" in text for text in texts)


def test_slow_steps_of_an_encoder_are_noise_at_low_frequencies() -> None:
    rate, step = 500.0, 1e-3
    t = np.arange(20000) / rate
    slow = 0.05 * np.sin(0.3 * t)
    error = np.round(slow / step) * step - slow
    level = quantisation_level(np.round(slow / step)[:, None] * step, rate)[0]
    assert error.var() == pytest.approx(step**2 / 12.0, rel=0.1)
    crossings = 4.0 * 0.05 * 0.3 / (2.0 * np.pi) / step
    assert level == pytest.approx(step**2 / 6.0 / max(crossings, 10.0), rel=0.2)
    assert (
        quantisation_level(
            (slow + 1e-4 * np.random.default_rng(0).standard_normal(t.size))[:, None], rate
        )[0]
        < 1e-12
    )


def test_a_flying_robot_needs_no_contact_forces() -> None:
    flying = replace(load_robot("planar_leg").lossless(), contacts=())
    count = 1000
    t = np.arange(count) * 0.004
    random = np.random.default_rng(1)
    columns = {}
    for name in flying.single_joints:
        phase = random.uniform(0.0, 6.0)
        columns[f"{name}.position"] = 0.2 * np.sin(5.0 * t + phase)
        columns[f"{name}.velocity"] = 1.0 * np.cos(5.0 * t + phase)
    columns["base_z.position"] = 10.0 - 0.5 * 9.81 * t**2
    columns["base_z.velocity"] = -9.81 * t
    for joint in JOINTS:
        columns[f"{joint}.rotor_torque"] = 0.01 * random.standard_normal(count)
    assert len(compare(flying, [Log(t, columns)]).outputs) == 5


@pytest.mark.parametrize("order", [2, 4])
def test_a_low_pass_takes_no_noise_floor_away(order: int) -> None:
    """Floors of 1e-7 N m were left, and residuals of 47,000 noise floors."""
    (log,) = load_logs([outside("practice_leg/case00a.csv")])
    as_recorded = compare(ROBOT, [log]).floor.values
    found = compare(ROBOT, [_low_passed(log, 8.0, order)])
    assert any("a low-pass took their noise away" in text for text in found.warnings)
    ratio = found.floor.values / as_recorded
    assert np.all((ratio > 0.2) & (ratio < 5.0)), ratio


def test_an_arm_that_was_low_passed_has_a_floor_near_what_its_repeats_scatter_by() -> None:
    """Its runs differ by 0.2 N m at the larger joints; floors of 1e-5 N m were stated."""
    torques = np.load(outside("kuka_lwr4/lwr1.npz"))["torques"]
    passed, density = low_passed(torques, 200.0)
    assert np.all((passed > 1.0) & (passed < 3.0))
    floor = np.sqrt(density * passed)
    assert np.all((floor > 0.01) & (floor < 0.5)), floor
    noisy = torques + 0.2 * np.random.default_rng(0).standard_normal(torques.shape)
    assert np.all(low_passed(noisy, 200.0)[0] == np.inf)


def test_a_position_that_is_the_integral_of_the_velocity_changes_nothing() -> None:
    """A motor that stands still seemed to move: 0.16 N m were left in place of 0.07."""
    folder = outside("tmotor_ak80")
    robot = load_robot(str(folder / "robot.toml")).lossless()
    left = []
    for runs, columns in ((folder, folder / "current.toml"), (folder / "with_position", None)):
        files = [runs / f"{name}.parquet" for name in ("sysid_1", "sysid_2", "opposing_2")]
        found = compare(robot, load_logs(files, columns or runs / "columns.toml"))
        assert any("motor in" in text and "stand still" in text for text in found.warnings)
        left.append([(output.rms, output.floor) for output in found.outputs])
    np.testing.assert_allclose(left[0], left[1], rtol=1e-6)


def _low_passed(log: Log, cutoff: float, order: int) -> Log:
    """Return a log whose channels went through a Butterworth filter, forward and backward."""
    sections = butter(order, cutoff, fs=1.0 / log.sample_time, output="sos")
    columns = {name: sosfiltfilt(sections, values) for name, values in log.columns.items()}
    return Log(log.time, columns)
