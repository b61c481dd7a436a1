from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from wbc.effects import load_robot
from wbc.identification.readings import check_log, check_logs
from wbc.measurement import Log, LogSource, align_velocity, mended
from wbc.measurement.column_mistakes import motion_findings
from wbc.measurement.filters import fit_velocity

Change = Callable[[Log], Log]


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


T, RANDOM = np.arange(2000) * 0.002, np.random.default_rng(0)


def held(column: str, start: int, stop: int) -> Change:
    def change(log: Log) -> Log:
        values = log.column(column).copy()
        values[start:stop] = values[start]
        return log.with_columns({column: values})

    return change


def copied(log: Log) -> Log:
    return log.with_columns({"hip.velocity": log.column("hip.position")})


def with_(column: str, change: Callable[[np.ndarray], np.ndarray]) -> Change:
    return lambda log: log.with_columns({column: change(log.column(column))})


def until_the_end(torque: np.ndarray) -> np.ndarray:
    """Return a clipped torque with an extreme in its last row, which was a crash."""
    return np.append(np.clip(torque[:-2], -1.0, 0.7), [0.0, 0.7])


# Even while the joint stands still.
DUTY = np.where(T > 3.0, 1.0, 0.2 * np.sin(T))
AT_FULL_DUTY = {"a.position": np.minimum(T, 3.0), "a.duty": DUTY}
# What is wrong, its kind, and what the finding says (its text and column).
WRONG: dict[str, tuple[Change, str, str]] = {
    "a position is stuck": (held("hip.position", 700, 800), "stuck", "1.400 s"),
    "a velocity is stuck": (held("knee.velocity", 900, 1050), "stuck", "knee.velocity"),
    "a position is lost": (held("hip.position", 1700, 2000), "stuck", ""),
    "coarse steps": (with_("hip.position", lambda q: np.round(q / 0.2) * 0.2), "coarse", ""),
    "one number": (held("hip.position", 0, 2000), "constant_joint", "hip.position"),
    "a hole": (lambda s: Log(s.time + 0.5 * (s.time >= 2.4), s.columns), "gap", "2.3980 s"),
    "a copy": (copied, "velocity_unrelated", ""),
    "noise": (with_("hip.velocity", lambda v: RANDOM.normal(size=2000)), "velocity_unrelated", ""),
    "uneven": (lambda s: Log(np.sort(RANDOM.uniform(0.0, 4.0, 2000)), s.columns), "jitter", ""),
    "few rows": (lambda s: s[:50], "short", ""),
    "clipped": (with_("hip.rotor_torque", lambda u: np.clip(u, -0.7, 0.7)), "saturation", "49.7 %"),
    "at last": (with_("hip.rotor_torque", until_the_end), "saturation", ""),
    "full duty": (lambda s: Log(s.time, AT_FULL_DUTY), "saturation", ""),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_with_a_channel_is_named(name: str, swing: Log) -> None:
    change, kind, says = WRONG[name]
    found = check_log(change(swing)).of_kind(kind)
    assert found
    assert says in f"{found[0].text} {found[0].column}"


def test_rest_held_poses_and_fine_steps_are_not_wrong(swing: Log) -> None:
    rest = np.where(T < 2.0, np.sin(np.pi * T) ** 2, 0.0)
    speed = np.where(T < 2.0, np.pi * np.sin(2 * np.pi * T), 0.0)
    assert "stuck" not in _kinds(Log(T, {"a.position": rest, "a.velocity": speed}))
    # A drive whose velocity has a zero of its own, as sums of counts of 12 bits have.
    assert "stuck" not in _kinds(Log(T, {"a.position": rest, "a.velocity": speed - 0.3}))
    pose = np.clip(np.sin(2.0 * T), -0.5, 0.5)
    assert "saturation" not in _kinds(Log(T, {"a.position": pose, "a.motor_torque": 3.0 * pose}))
    step = 2 * np.pi / 4096
    quality = check_log(with_("hip.position", lambda q: np.round(q / step) * step)(swing))
    assert quality.resolution["hip.position"] == pytest.approx(step, rel=1e-3)
    assert quality.resolution["knee.position"] == 0.0


UNITS = {"rad": 1.0, "deg": 180.0 / np.pi, "turn": 0.5 / np.pi}
SPEEDS = {"rad/s": 1.0, "deg/s": 180.0 / np.pi, "turn/s": 0.5 / np.pi, "rpm": 30.0 / np.pi}


@pytest.mark.parametrize("velocity", SPEEDS)
@pytest.mark.parametrize("position", UNITS)
def test_units_of_position_and_velocity_are_judged_as_a_pair(
    position: str, velocity: str, swing: Log
) -> None:
    """Degrees beside rpm are 1.05 of radians beside turns per second."""
    held = {"position": UNITS[position], "velocity": SPEEDS[velocity]}
    factors = {n: held.get(n.rpartition(".")[2], 1.0) for n in swing.names}
    log = replace(swing, columns={n: factors[n] * v for n, v in swing.columns.items()})
    found = motion_findings([log], {})[0]
    assert bool(found) != (velocity == f"{position}/s")
    for one in found:
        log = mended(log, one.mend)
    for joint in ("hip", "knee") if found else ():
        for quantity in held:
            name = f"{joint}.{quantity}"
            np.testing.assert_allclose(log.column(name), swing.column(name), atol=1e-9)


@pytest.mark.parametrize(
    ("period", "words"), [(2 * np.pi, "one turn"), (4096.0, r"2^12 encoder counts"), (360.0, "360")]
)
def test_unsigned_wraps_are_recognised(period: float, words: str) -> None:
    time = np.arange(3000) * 0.002
    position = np.mod(period * (0.3 + 0.9 * np.sin(2.0 * time)), period)
    (finding,) = check_log(Log(time, {"a.position": position})).of_kind("wrap")
    assert words in finding.text
    assert f"unwrap = {period:.6g}"[:12] in finding.way_out


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


def test_logs_that_fight_each_other_are_named(swing: Log) -> None:
    def named(log: Log, name: str) -> Log:
        return replace(log, source=LogSource(path=name))

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


def test_a_joint_that_starts_abruptly_is_no_lost_velocity() -> None:
    """A recorded arm drifted by a millionth of a radian while its velocity read zero."""
    speed = np.where(np.sin(2.0 * np.pi * T) > 0.0, 0.2 + 0.1 * np.sin(11.0 * T), 0.0)
    position = cumulative_trapezoid(speed, T, initial=0.0) + 1e-6 * np.sin(7.0 * T)
    assert "stuck" not in _kinds(Log(T, {"a.position": position, "a.velocity": speed}))
