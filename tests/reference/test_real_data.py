"""The recorded data sets: what their robots, maps and published numbers say fits the logs.

The logs live outside the repository, in `../shared/data`; without them these tests are skipped.
The comparisons are with published numbers, not with the diagnosis.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from tests.outside import ROOT, outside
from wbc.dynamics import link_torque, rotor_torque
from wbc.effects import load_robot
from wbc.measurement import Log, load_logs
from wbc.robot import Motion
from wbc.sim.servo_rollout import DcDrive, ServoRun, servo_rollout

PENDULUM = "dfki_double_pendulum/double_pendulum.parquet"
DESIGNS = {
    "double_pendulum": (0.3, 0.05347, 0.5594 * 0.3, 0.02392, 0.6043, 0.1838, 7.66e-5),
    "double_pendulum_c0": (0.2, 0.02671, 0.6417 * 0.2, 0.05388, 0.5639, 0.3213, 9.94e-5),
    "double_pendulum_c1": (0.2, 0.03189, 0.5235 * 0.2, 0.05087, 0.6256, 0.2557, 6.29e-5),
}


def logs_of(robot: str, name: str) -> tuple[Log, ...]:
    return load_logs([outside(name)], ROOT / "robots" / robot / "columns.toml")


def low_pass(values: np.ndarray, rate: float, cutoff: float) -> np.ndarray:
    return sosfiltfilt(butter(4, cutoff / (0.5 * rate), output="sos"), values, axis=0)


@pytest.mark.parametrize("name", DESIGNS)
def test_double_pendulum_has_the_published_mass_matrix_and_gravity(name: str) -> None:
    l1, i1, mr1, i2, m2, r2, rotor = DESIGNS[name]
    robot = load_robot(ROOT / "robots" / name / "published.toml")
    robot = replace(robot, rotors_turn_with_links=True)
    q, c2 = np.array([0.4, -0.9]), np.cos(-0.9)
    m12, m22 = i2 + l1 * m2 * r2 * c2 - 6 * rotor, i2 + 36 * rotor
    m11 = i1 + i2 + m2 * l1**2 + 2 * l1 * m2 * r2 * c2 + 37 * rotor
    g2 = 9.81 * m2 * r2 * np.sin(q.sum())
    g1 = g2 + 9.81 * (mr1 + m2 * l1) * np.sin(q[0])

    def motor(acceleration: list[float]) -> np.ndarray:
        moving = Motion(q[None], np.zeros((1, 2)), np.array([acceleration]))
        rotors, _ = rotor_torque(robot, moving, link_torque(robot, moving))
        return rotors[0] * robot.transmission.gear_ratio

    np.testing.assert_allclose(motor([0.0, 0.0]), [g1, g2], rtol=2e-4, atol=1e-6)
    for unit, column in (([1.0, 0.0], [m11, m12]), ([0.0, 1.0], [m12, m22])):
        np.testing.assert_allclose(motor(unit) - motor([0.0, 0.0]), column, rtol=2e-3)


@pytest.mark.parametrize(
    ("name", "path", "cutoff", "left"),
    [
        ("double_pendulum", f"{PENDULUM}#A.0/trajectory_00", 5.0, 0.75),
        ("emps", "emps/emps_estimation.parquet", 20.0, 0.1),
        ("staubli_tx40", "staubli_tx40/tx40.parquet", 30.0, 0.2),
    ],
)
def test_the_published_robot_explains_its_log(
    name: str, path: str, cutoff: float, left: float
) -> None:
    """Rms torque errors of each joint, of the robot as given and as published."""
    (log,) = logs_of(name, path)
    given = load_robot(ROOT / "robots" / name / "robot.toml")
    rate = 1.0 / log.sample_time
    position = low_pass(log.stack("position", given.joints), rate, cutoff)
    velocity = np.gradient(position, 1.0 / rate, axis=0)
    motion = Motion(position, velocity, np.gradient(velocity, 1.0 / rate, axis=0))
    gears = given.transmission
    if f"{given.joints[0]}.rotor_torque" in log.columns:
        measured = log.stack("rotor_torque", given.joints)
    else:
        measured = log.stack("motor_torque", given.joints) / gears.gear_ratio
    thin, errors = slice(int(rate), -int(rate), int(0.02 * rate)), []
    for robot in (given, load_robot(ROOT / "robots" / name / "published.toml")):
        needed, _ = rotor_torque(robot, motion, link_torque(robot, motion))
        error = low_pass((measured - needed) * gears.gear_ratio, rate, cutoff)[thin]
        errors.append(np.sqrt(np.mean(error**2, axis=0)))
    assert np.all(errors[1] < left * errors[0])


def test_the_published_servo_moves_as_its_logs_say() -> None:
    logs = logs_of("xl330_pendulum", "bam_servo/bam.parquet#xl330_kp100*")
    gain = 100 * 4096 / (2 * np.pi) / (256 * 885)
    runs = [ServoRun.from_log(log, "shaft", gain, 0.005) for log in logs]
    errors = []
    for file in ("robot.toml", "published.toml"):
        robot = load_robot(ROOT / "robots" / "xl330_pendulum" / file)
        reached = servo_rollout([(robot, DcDrive(7.4))], runs, 0.005)[:, 0].T
        missed = [
            np.abs(q[: len(r.position)] - r.position) for q, r in zip(reached, runs, strict=True)
        ]
        errors.append(np.mean([one.mean() for one in missed]))
    assert errors[1] < 0.6 * errors[0]
    assert errors[1] < 0.06  # rad
