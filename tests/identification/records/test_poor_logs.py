"""Logs that say little, that move only some joints, or that must not be believed."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from tests.moved import moved
from tests.outside import outside
from tests.recover.plant import recorded
from wbc.arrays import FloatArray
from wbc.effects import CoulombFriction, TorqueOffset, ViscousFriction, load_robot
from wbc.effects.position_torques import strongest_orders
from wbc.errors import IdentificationError, LogError
from wbc.identification import compare, diagnose
from wbc.identification.answer.diagnose import about_silent
from wbc.identification.answer.words import verdict_sentence
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.readings import SuspiciousLogError, find_suspicions
from wbc.identification.records.channels import read_channels
from wbc.identification.records.filters import Bandwidth, low_passed
from wbc.identification.records.not_judged import reported_torque
from wbc.identification.records.preparation import away_from_impacts
from wbc.measurement import Log, LogSource, load_logs
from wbc.measurement.checks import resting_joints
from wbc.sim import Plane, Plant, SimState, simulate
from wbc.sim.excitation import ENCODER, MultiSine

ROBOT = load_robot("planar_leg_fixed").lossless()
JOINTS = ("hip", "knee")


@pytest.fixture(scope="module")
def friction() -> list[Log]:
    """Two runs of a leg whose hip rubs."""
    return [recorded()[name] for name in ("rubbing hip", "rubbing hip, moved otherwise")]


def _still(angle: float) -> tuple[float, float, float]:
    """Return the sine of a joint that stays at an angle [rad]."""
    return angle, 0.0, 0.5 * np.pi


@pytest.mark.parametrize("error", [0.0, 0.05])
def test_where_nothing_moves_nothing_is_named_and_the_log_is_stopped(error: float) -> None:
    log = moved(ROBOT, 0.002 * np.arange(2000), [[_still(0.3)], [_still(-0.6)]])
    torques = {f"{j}.rotor_torque": error + log.column(f"{j}.rotor_torque") for j in JOINTS}
    with pytest.raises(SuspiciousLogError, match=r"no joint moves.*Record the robot in motion"):
        diagnose(ROBOT, [log.with_columns(torques)])


@pytest.mark.parametrize("noise", [(2e-5, 3e-3), (1e-5, 1e-3)])
def test_a_joint_that_holds_still_does_not_rub_against_its_noise(noise: tuple) -> None:
    """Between the limits of its friction a held joint may carry any torque, here none."""
    waves = [[_still(0.6), (0.0, 5.0, 0.0)], [_still(-0.3), (0.6, 5.0, 0.0)]]
    log = moved(ROBOT, 0.004 * np.arange(1500), waves, (*noise, 2e-3), seed=1)
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
    assert sentence.endswith("report torques that do not follow their motion.")
    assert "N m" not in sentence
    assert diagnosis.next_experiment.startswith("The drives of hip and knee report torques that")
    assert "correct its column" in diagnosis.next_experiment
    assert "no drive reports more" in diagnosis.warnings[-1]


def test_noise_as_large_as_what_the_motion_needs_is_set_aside_too(friction: list[Log]) -> None:
    random, name, deaf = np.random.default_rng(5), "knee.rotor_torque", []
    for log in friction:
        noise = 4.0 * log.column(name).std() * random.standard_normal(len(log))
        deaf.append(log.with_columns({name: noise}))
    problem = EstimationProblem.from_logs(ROBOT, deaf)
    reported = np.concatenate([reported_torque(record)[:, 1] for record in problem.records])
    assert np.std(reported) > 0.5 * np.std(reported - problem.residual[:, 1])
    assert problem.silent == ("knee",)
    (both,) = about_silent(("hip", "knee"))
    assert both.startswith("hip, knee: the torque reported there")
    # What friction adds to an honest report hides no share of the load.
    assert EstimationProblem.from_logs(ROBOT, friction).silent == ()


def test_reports_that_follow_links_of_other_inertias_are_judged() -> None:
    """Two joints of an arm whose masses are guessed were said not to follow their motion."""
    folder = "strangers/01_kuka_sign"
    robot = load_robot(outside(f"{folder}/robot.toml")).lossless()
    logs = load_logs([outside(f"{folder}/k{k}.csv") for k in (1, 2, 3)])
    assert EstimationProblem.from_logs(robot, logs).silent == ()


def test_logs_of_two_machines_are_seen_to_disagree(friction: list[Log]) -> None:
    other = [friction[0], recorded()["hip that rubs more"]]
    for logs, disagree in ((other, True), (friction, False)):
        found = diagnose(ROBOT, logs, [CoulombFriction]).findings
        texts = [text for finding in found for text in finding.warnings]
        assert any("the logs disagree on level" in text for text in texts) == disagree


def test_a_flying_robot_needs_no_contact_forces() -> None:
    flying = replace(load_robot("planar_leg").lossless(), contacts=())
    t, random, columns = np.arange(1000) * 0.004, np.random.default_rng(1), {}
    for name in flying.single_joints:
        phase = random.uniform(0.0, 6.0)
        columns[f"{name}.position"] = 0.2 * np.sin(5.0 * t + phase)
        columns[f"{name}.velocity"] = 1.0 * np.cos(5.0 * t + phase)
    columns["base_z.position"], columns["base_z.velocity"] = 10.0 - 0.5 * 9.81 * t**2, -9.81 * t
    columns |= {f"{joint}.rotor_torque": 0.01 * random.standard_normal(1000) for joint in JOINTS}
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


RUBS = {"hip": 0.5, "knee": 0.3}
BRAKE = 200.0  # [N m]
SWAP = {"hip": "knee", "knee": "hip"}


def braked(moving: str, seed: int, noise: int) -> Log:
    """Return a log of a leg that moves one joint while a brake holds the other."""
    levels = RUBS | {SWAP[moving]: BRAKE}
    real = ROBOT.with_effects(*(CoulombFriction(j, level=level) for j, level in levels.items()))
    path, gears = MultiSine(ROBOT, seed), ROBOT.transmission
    moves = np.array([joint == moving for joint in gears.joints])
    start = path.at(0.0)[0]
    plant = Plant(real, Plane(height=-10.0))

    def control(state: SimState) -> FloatArray:
        q, v, _ = path.at(state.time)
        # The drive of the braked joint is off.
        torque = 150.0 * (q - state.position) + 8.0 * (v - state.velocity)
        return np.asarray(moves * torque / gears.gear_ratio)

    log = simulate(plant, control, plant.state(start, 0.0 * start), 4.0, dt=1e-3).log
    return replace(ENCODER.measure(real, log, noise), source=LogSource(path=f"{moving}{noise}.csv"))


@pytest.fixture(scope="module")
def logs() -> list[Log]:
    return [braked("hip", 20, 1), braked("knee", 21, 2), braked("hip", 20, 3)]


def test_logs_that_each_move_one_joint_tell_the_friction_of_both(logs: list[Log]) -> None:
    found = diagnose(ROBOT, logs, [CoulombFriction, ViscousFriction, TorqueOffset])
    assert found.verdict == "named"
    levels = {f.effect.where: f.parameters["level"] for f in found.findings}
    assert levels.keys() == RUBS.keys()
    for joint, level in RUBS.items():
        assert levels[joint].value == pytest.approx(level, rel=0.05)
    (warning,) = [text for text in found.warnings if "stand still" in text]
    assert "hip in knee2.csv; knee in hip1.csv, hip3.csv." in warning


def test_a_repeat_that_holds_a_joint_still_says_nothing_of_its_noise(logs: list[Log]) -> None:
    floor = EstimationProblem.from_logs(ROBOT, logs).floor
    assert floor.repeats == ((0, 2),)
    size = np.sqrt(np.diag(floor.sensors))
    assert floor.values[1] == pytest.approx(size[1])
    assert 0.5 * size[0] < floor.values[0] < 2.0 * size[0]


def test_a_channel_that_never_changes_is_no_crash(logs: list[Log]) -> None:
    hip, knee, _ = logs
    begin = {"position": hip.column("knee.position")[0], "velocity": 0.0, "rotor_torque": 0.0}
    held = hip.with_columns({f"knee.{q}": np.full(len(hip), x) for q, x in begin.items()})
    found = diagnose(ROBOT, [held, knee], [CoulombFriction])
    assert {f.effect.where for f in found.findings} == {"hip", "knee"}


FLOATING = load_robot("planar_leg")
BAND = Bandwidth(residual=10.0, kinematics=40.0)
RATE = 500.0


def away(force: np.ndarray, band: Bandwidth = BAND) -> np.ndarray:
    """Return which samples are judged of a log of a foot with this force [N]."""
    time = np.arange(len(force)) / RATE
    wave = np.sin(4.0 * time)
    columns = {f"{j}.position": 0.1 * wave for j in FLOATING.single_joints}
    columns |= {f"{j}.rotor_torque": 0.1 * wave for j in FLOATING.transmission.joints}
    columns |= {"foot.force.x": 0.0 * wave, "foot.force.y": 0.0 * wave, "foot.force.z": force}
    return away_from_impacts(read_channels(FLOATING, Log(time, columns)), band)


def test_the_samples_around_a_strike_are_set_aside() -> None:
    row = np.arange(2000)
    struck = away(np.where(row < 800, 0.0, 180.0))
    reach = int(2.0 * RATE / BAND.kinematics)
    assert not struck[800 - reach : 800 + reach].any()
    assert struck.sum() == 2000 - 2 * reach
    # A foot that is loaded within a tenth of a second is no strike.
    assert away(180.0 * np.clip((row - 800) / 50.0, 0.0, 1.0)).all()
    # Half of a log stays, however often the foot strikes, and more with shorter filters.
    often = np.where(row // 20 % 2 == 0, 0.0, 180.0 + row / 20.0)
    assert 0.45 < away(often).mean() < 0.55
    assert away(often, replace(BAND, kinematics=400.0)).mean() > away(often).mean()


def test_a_comparison_says_which_joint_fails_and_what_it_follows() -> None:
    comparison = compare(ROBOT, [recorded()["dragging knee"]])
    ratios = {output.output: output.ratio for output in comparison.outputs}
    assert ratios["knee"] > 10.0 * ratios["hip"]
    assert (comparison.where[0].output, comparison.where[0].variable) == ("knee", "speed")
    assert comparison.where[0].share > 0.95
    assert json.loads(json.dumps(comparison.to_json()))["error"] == comparison.error


@pytest.mark.parametrize("seed", range(8))
def test_where_a_joint_rests_long_is_no_period(seed: int) -> None:
    random = np.random.default_rng(seed)
    rests = np.repeat(random.uniform(-1.2, 1.2, 5), 800)
    position = np.concatenate([np.linspace(-1.2, 1.2, 2000), rests])
    torque = np.sin(5.0 * position + random.uniform(0.0, 6.0))
    torque += 0.1 * random.standard_normal(torque.size)
    assert strongest_orders([position], [torque])[0] == pytest.approx(5.0, abs=0.3)


def test_logs_that_say_nothing_are_refused(friction: list[Log]) -> None:
    log = friction[0]
    with pytest.raises(IdentificationError, match="no log"):
        diagnose(ROBOT, [])
    with pytest.raises(IdentificationError, match="too short"):
        diagnose(ROBOT, [log.between(0.0, 0.3)])
    free = load_robot("planar_leg").lossless()
    base = {f"base_{axis}.position": np.zeros(len(log)) for axis in ("x", "z", "pitch")}
    with pytest.raises(LogError, match=r"'foot' moves by.*foot\.active"):
        compare(free, [log.with_columns(base)])


def test_a_joint_at_rest_whose_sensors_flicker_is_accused_of_nothing(logs: list[Log]) -> None:
    """Of a recorded arm each joint moved in a log of its own, and the last digits of the others.

    One count of an encoder was a jump that refused the log, the torque of a joint at rest followed
    no need, and one had a current limit of 2 mN m (99 %).
    """
    hip = logs[0]
    blinks = np.random.default_rng(4).random((3, len(hip))) < 0.02
    count = {"knee.position": 4e-4, "knee.velocity": 0.011, "knee.rotor_torque": 7e-4}
    last = {name: size * blink for (name, size), blink in zip(count.items(), blinks, strict=True)}
    # The velocity stays at a count for longer, and then at another.
    late = hip.time > 0.7 * hip.time[-1]
    last["knee.velocity"] = count["knee.velocity"] * (late.astype(float) + blinks[1] - 1.0)
    last["knee.position"] = last["knee.position"] + hip.column("knee.position")[0]
    held = hip.with_columns(last)
    assert resting_joints(held) == {"knee"}
    assert find_suspicions([held], ROBOT) == [[]]
    assert {f.effect.where for f in diagnose(ROBOT, [held]).findings} == {"hip"}


def test_a_slow_log_that_narrows_the_band_of_all_is_named(friction: list[Log]) -> None:
    """One log of 12 Hz took the band of a recorded arm to 1.2 Hz, and only the JSON said so."""
    first, other = friction
    every = slice(None, None, round(0.08 / other.sample_time))
    columns = {name: values[every] for name, values in other.columns.items()}
    slow = Log(other.time[every], columns, LogSource("b"))
    assert not any(
        "below" in said for said in EstimationProblem.from_logs(ROBOT, friction).warnings
    )
    warnings = EstimationProblem.from_logs(ROBOT, [first, slow]).warnings
    (said,) = (text for text in warnings if "below" in text)
    assert said.startswith("torques are compared below 1.2 Hz")
    assert said.endswith("Without b it would be wider.")
