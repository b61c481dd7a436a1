"""The maps beside the robots against the outside data they are for."""

import json

import numpy as np
import pyarrow.parquet as pq
import pytest

from tests.outside import outside
from wbc.identification.readings import check_log
from wbc.measurement import Log, align_velocity, derivative, load_log, load_logs, low_pass
from wbc.measurement.filters import fit_velocity
from wbc.robot import robots_directory

PENDULUM = "dfki_double_pendulum/double_pendulum.parquet"


def _map(robot: str) -> str:
    return str(robots_directory() / robot / "columns.toml")


@pytest.mark.parametrize(
    ("robot", "design", "count"), [("", "A.0", 8), ("_c0", "C.0", 7), ("_c1", "C.1", 12)]
)
def test_double_pendulum_logs_are_split_by_design(robot: str, design: str, count: int) -> None:
    path = outside(PENDULUM)
    logs = load_logs([path], _map(f"double_pendulum{robot}"))
    assert len(logs) == count
    assert all(log.source.part.startswith(design + "/") for log in logs)
    table = pq.read_table(path, filters=[("log", "==", logs[0].source.part)])
    np.testing.assert_array_equal(logs[0].column("elbow.velocity"), table["v2_rad_s"].to_numpy())
    np.testing.assert_array_equal(logs[0].time, table["time_s"].to_numpy())


def delay(log: Log, joint: str) -> float:
    """Return by how much a velocity is behind its position [s]."""
    position, velocity = log.column(f"{joint}.position"), log.column(f"{joint}.velocity")
    return fit_velocity(log.time, position, velocity).delay


def test_reported_velocities_of_the_double_pendulum_are_backward_differences() -> None:
    log = load_log(f"{outside(PENDULUM)}#C.1/143339", _map("double_pendulum_c1"))
    steps = np.diff(log.column("elbow.position")) / np.diff(log.time)
    assert np.corrcoef(steps, log.column("elbow.velocity")[1:])[0, 1] > 0.999
    assert delay(log, "elbow") == pytest.approx(0.5 * log.sample_time, rel=0.05)


def test_servo_logs_carry_what_the_drive_did() -> None:
    path = outside("bam_servo/bam.parquet")
    logs = load_logs([path], _map("xl330_pendulum"))
    assert len(logs) == 12
    # Duty law of the README: pwm = clip(kp 4096 / (2 pi) / (256 885) (goal - q)), slope 1.02.
    log = next(log for log in logs if log.source.part == "xl330_kp200_sin_sin")
    error = log.column("shaft.goal_position") - log.column("shaft.position")
    law = 200.0 * 4096.0 / (2.0 * np.pi) / (256.0 * 885.0) * error
    duty = log.column("shaft.duty")
    assert float(law @ duty / (law @ law)) == pytest.approx(1.02, abs=0.05)
    other = load_logs([path], _map("sts3250_pendulum"))
    assert len(other) == 3
    assert not any(log.has("shaft.duty") for log in other)
    released = next(log for log in logs if log.source.part.endswith("kp100_lift_and_drop"))
    assert np.count_nonzero(released.column("shaft.enabled") == 0.0) == 1138


def test_tiago_starts_with_the_motion_and_its_velocity_is_a_low_pass_of_it() -> None:
    log = load_log(outside("tiago/tiago.parquet"), _map("tiago"))
    model = json.loads(outside("tiago/model.json").read_text())
    assert log.joints == tuple(joint["name"] for joint in model["joints"])
    assert len(log) == 5080
    assert len(check_log(log).of_kind("velocity_filtered")) == 8
    # Undoing T dv/dt + v = dq/dt must give the derivative of the position, which is not used for it
    # beyond the one number T; a pure shift leaves several times as much.
    aligned, rate = align_velocity(log), 1.0 / log.sample_time
    for joint in ("torso_lift_joint", "arm_1_joint", "arm_4_joint"):
        truth = derivative(low_pass(log.column(f"{joint}.position"), 5.0, rate, 4), rate)
        found = low_pass(aligned.column(f"{joint}.velocity"), 5.0, rate, 4)
        shifted = np.interp(log.time + delay(log, joint), log.time, log.column(f"{joint}.velocity"))
        inner = slice(60, -60)
        left = np.std((found - truth)[inner])
        assert left < 0.01 * np.std(truth[inner])
        assert left < 0.3 * np.std((low_pass(shifted, 5.0, rate, 4) - truth)[inner])
