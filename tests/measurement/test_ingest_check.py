from __future__ import annotations

import numpy as np
import pytest

from wbc.effects import load_robot
from wbc.identification.readings import check_log, check_logs
from wbc.measurement import Log, LogSource, align_velocity, mended
from wbc.measurement.filters import fit_velocity


def _kinds(log: Log) -> set[str]:
    return {finding.kind for finding in check_log(log).findings}


def test_a_clean_log_has_no_findings(swing: Log) -> None:
    quality = check_log(swing, load_robot("planar_leg_fixed"))
    assert quality.findings == ()
    assert quality.usable
    assert quality.rate == pytest.approx(500.0)
    assert quality.jitter == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("delay", [-0.003, 0.0007, 0.005])
def test_the_delay_of_a_velocity_is_found_finer_than_a_sample_and_taken_out(delay: float) -> None:
    rng = np.random.default_rng(1)
    time = np.arange(4000) * 0.002 + rng.uniform(-5e-4, 5e-4, 4000)

    def motion(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        position = np.sin(5.0 * t) + 0.3 * np.sin(11.0 * t)
        return position, 5.0 * np.cos(5.0 * t) + 3.3 * np.cos(11.0 * t)

    position = motion(time)[0] + 2e-5 * rng.normal(size=time.size)
    velocity = 1.02 * motion(time - delay)[1] + 3e-3 * rng.normal(size=time.size) + 0.1
    fit = fit_velocity(time, position, velocity)
    assert fit.delay == pytest.approx(delay, abs=5e-5)
    assert fit.scale == pytest.approx(1.02, abs=2e-3)
    log = Log(time, {"hip.position": position, "hip.velocity": velocity})
    assert ("clock_lag" in _kinds(log)) == (abs(delay) > 0.5e-3)
    aligned = align_velocity(log)
    expected = 1.02 * motion(aligned.time)[1] + 0.1
    assert np.std(aligned.column("hip.velocity") - expected) < 4e-3


@pytest.mark.parametrize("mend", ["align_velocity", "lag"])
def test_a_shifted_column_follows_the_rows_through_times_that_cluster(mend: str) -> None:
    """Of a recorded pendulum, rows 2 microseconds apart; the printed mend made it useless."""
    random = np.random.default_rng(0)
    time = np.arange(0.0, 10.0, 0.005)
    time[1::20] = time[0::20] + 2e-6
    seen, delay = 0.02 * random.standard_normal(time.size), 0.0035
    columns = {"a.position": np.sin(3.0 * time), "a.velocity": 3.0 * np.cos(3.0 * (time - delay))}
    columns["a.velocity"] += seen
    if mend == "align_velocity":
        log = align_velocity(Log(time, columns))
    else:
        log = mended(Log(time, columns), {"columns": {"a.velocity": {"lag": delay}}})
    wrong = log.column("a.velocity") - 3.0 * np.cos(3.0 * log.time)
    assert np.std(wrong) < 0.03


def test_a_full_duty_is_saturation_even_while_the_joint_stands_still(swing: Log) -> None:
    duty = np.where(swing.time > 3.0, 1.0, 0.2 * np.sin(swing.time))
    position = np.minimum(swing.time, 3.0)
    log = Log(swing.time, {"a.position": position, "a.duty": duty})
    assert "saturation" in _kinds(log)


@pytest.mark.parametrize(
    ("period", "words"), [(2 * np.pi, "one turn"), (4096.0, r"2^12 encoder counts"), (360.0, "360")]
)
def test_unsigned_wraps_are_recognised(period: float, words: str) -> None:
    time = np.arange(3000) * 0.002
    position = np.mod(period * (0.3 + 0.9 * np.sin(2.0 * time)), period)
    (finding,) = check_log(Log(time, {"a.position": position})).of_kind("wrap")
    assert words in finding.text
    assert f"unwrap = {period:.6g}"[:12] in finding.way_out


def test_a_clipped_torque_is_saturated_and_a_held_pose_is_not(swing: Log) -> None:
    clipped = np.clip(swing.column("hip.rotor_torque"), -0.7, 0.7)
    (finding,) = check_log(swing.with_columns({"hip.rotor_torque": clipped})).of_kind("saturation")
    share = np.mean(np.abs(clipped) == 0.7)
    assert f"{100 * share:.1f} %" in finding.text
    time = np.arange(2000) * 0.002
    pose = np.clip(np.sin(2.0 * time), -0.5, 0.5)
    held = Log(time, {"a.position": pose, "a.motor_torque": 3.0 * pose})
    assert "saturation" not in _kinds(held)


def test_stuck_sensors_are_told_from_joints_at_rest(swing: Log) -> None:
    stuck = swing.column("hip.position").copy()
    stuck[700:800] = stuck[700]
    (finding,) = check_log(swing.with_columns({"hip.position": stuck})).of_kind("stuck")
    assert "1.400 s" in finding.text
    held = swing.column("knee.velocity").copy()
    held[900:1050] = held[900]
    (finding,) = check_log(swing.with_columns({"knee.velocity": held})).of_kind("stuck")
    assert finding.column == "knee.velocity"
    lost = swing.column("hip.position").copy()
    lost[1700:] = lost[1700]
    assert "stuck" in _kinds(swing.with_columns({"hip.position": lost}))
    time = swing.time
    rest = np.where(time < 2.0, np.sin(np.pi * time) ** 2, 0.0)
    speed = np.where(time < 2.0, np.pi * np.sin(2 * np.pi * time), 0.0)
    still = Log(time, {"a.position": rest, "a.velocity": speed})
    assert "stuck" not in _kinds(still)


@pytest.mark.parametrize(
    ("count", "noise", "offset"), [(2.4e-5, 2e-5, 0.0), (2.4e-5, 5e-6, 0.0), (1e-3, 3e-4, 2e-3)]
)
def test_a_wrist_held_still_is_no_broken_sensor(count: float, noise: float, offset: float) -> None:
    random, time = np.random.default_rng(0), np.arange(2500) * 0.002
    shown = 0.3 + noise * random.normal(size=time.size)
    shown[time > 2.4] = 0.3  # one count until the end, while the velocity drifts on
    shown = np.round(shown / count) * count
    speed = offset + 3e-3 * random.normal(size=time.size)
    held = Log(time, {"wrist.position": shown, "wrist.velocity": speed})
    (finding,) = check_log(held).findings
    assert (finding.kind, finding.severity) == ("constant_joint", "warning")
    assert "stands still" in finding.text
    # A velocity that goes on shows that the encoder is dead.
    swings = held.with_columns({"wrist.velocity": np.sin(5.0 * time)})
    assert {"velocity_unrelated", "stuck"} & _kinds(swings)
    dead = swings.with_columns({"wrist.position": np.full(time.size, 0.3)})
    (finding,) = check_log(dead).of_kind("constant_joint")
    assert "while the velocity changes" in finding.text


def test_resolution_constant_joints_gaps_and_unrelated_velocities(swing: Log) -> None:
    step = 2 * np.pi / 4096
    coarse = np.round(swing.column("hip.position") / step) * step
    quality = check_log(swing.with_columns({"hip.position": coarse}))
    assert quality.resolution["hip.position"] == pytest.approx(step, rel=1e-3)
    assert quality.resolution["knee.position"] == 0.0
    rough = np.round(swing.column("hip.position") / 0.2) * 0.2
    assert check_log(swing.with_columns({"hip.position": rough})).of_kind("coarse")
    quality = check_log(swing.with_columns({"hip.position": np.full(2000, 0.3)}))
    assert quality.of_kind("constant_joint")[0].column == "hip.position"
    time = swing.time + 0.5 * (np.arange(2000) >= 1200)
    gap = check_log(Log(time, swing.columns)).of_kind("gap")[0]
    assert "2.3980 s" in gap.text
    copied = swing.with_columns({"hip.velocity": swing.column("hip.position")})
    assert "velocity_unrelated" in _kinds(copied)
    noise = np.random.default_rng(0).normal(size=2000)
    assert "velocity_unrelated" in _kinds(swing.with_columns({"hip.velocity": noise}))
    jittery = np.sort(np.random.default_rng(1).uniform(0.0, 4.0, 2000))
    assert {"jitter", "gap"} & _kinds(Log(jittery, {"a.current": jittery}))
    assert "short" in _kinds(swing[:50])


def test_logs_that_fight_each_other_are_named(swing: Log) -> None:
    def named(log: Log, name: str) -> Log:
        return log.with_source(LogSource(path=name))

    a, copy = named(swing, "a.csv"), named(swing, "copy.csv")
    (finding,) = check_logs([a, copy])[0].of_kind("duplicate")
    assert "a.csv, copy.csv" in finding.text
    other = Log(swing.time, {"arm.position": np.sin(swing.time)}, LogSource(path="arm.csv"))
    (finding,) = check_logs([a, other])[0].of_kind("joints_differ")
    assert "arm.csv has the joints arm" in finding.text
    slow = Log(3.0 * swing.time, swing.columns, LogSource(path="slow.csv"))
    assert check_logs([a, slow])[0].of_kind("rates_differ")
    fewer = named(swing[100:].select(["hip.position", "knee.position"]), "fewer.csv")
    assert check_logs([a, fewer])[0].of_kind("channels_differ")
    assert check_logs([a, named(swing[100:], "tail.csv")])[0].findings == ()


def test_an_extreme_in_the_last_row_of_a_log_is_no_crash(swing: Log) -> None:
    time = np.arange(3300) * 0.002
    torque = np.clip(np.sin(5.0 * time), -1.0, 0.7)
    torque[-1] = 0.7
    torque[-2] = 0.0
    log = Log(time, {"a.position": np.sin(5.0 * time), "a.motor_torque": torque})
    assert "saturation" in _kinds(log)
