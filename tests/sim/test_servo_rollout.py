"""Rollouts of one-joint servos against solutions that share no code with them."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from wbc import Robot, effects, load_robot
from wbc.errors import RobotError
from wbc.sim.servo_rollout import DcDrive, ServoRun, servo_rollout

PENDULUM = load_robot("xl330_pendulum")
MASS, LEVER, ARMATURE, KT, RESISTANCE = 0.49, 0.1, 0.00181, 0.387, 4.02


DRIVE = DcDrive(7.4)


def run(goal: float, rows: int, first: float = 0.0, enabled: float = 1.0) -> ServoRun:
    return ServoRun("run", 2.0, np.full(rows, goal), np.full(rows, enabled), np.full(rows, first))


def moved(robot: Robot, one: ServoRun, step: float, drive: DcDrive = DRIVE) -> np.ndarray:
    """Return the positions (N,) [rad] of one robot in one run."""
    return servo_rollout([(robot, drive)], [one], step)[:, 0, 0]


def test_a_winding_that_warms_gives_way_under_a_held_load() -> None:
    step, duration, heating, cooling = 1e-3, 2.0, 0.15, 0.8
    robot = PENDULUM.with_effect(effects.ViscousFriction("shaft", 0.05))
    drive = DcDrive(7.4, source_resistance=0.5, heating=heating, cooling=cooling)
    reached = moved(robot, run(1.2, 2000), step, drive)

    def rate(t: float, x: np.ndarray) -> list[float]:
        duty, warm = np.clip(2.0 * (1.2 - x[0]), -1.0, 1.0), RESISTANCE * (1.0 + x[2])
        current = (duty * 7.4 - KT * x[1]) / (warm + 0.5 * abs(duty))
        torque = KT * current - MASS * 9.81 * LEVER * np.sin(x[0]) - 0.05 * x[1]
        heat = heating * warm * current**2 - cooling * x[2]
        return [x[1], torque / (MASS * LEVER**2 + ARMATURE), heat]

    time = np.arange(reached.size) * step
    truth = solve_ivp(rate, (0.0, duration), [0.0] * 3, rtol=1e-9, atol=1e-12, t_eval=time).y[0]
    assert np.max(np.abs(reached - truth)) < 2e-3
    cold = moved(robot, run(1.2, 2000), step, DcDrive(7.4, source_resistance=0.5))
    assert cold[-1] > reached[-1] + 0.05


def test_released_frictionless_swing_keeps_its_energy() -> None:
    reached = moved(PENDULUM, run(1.0, 10000, first=0.7, enabled=0.0), 2e-4)
    assert reached.max() == pytest.approx(0.7, abs=1e-3)
    assert reached.min() == pytest.approx(-0.7, abs=1e-3)


def test_dry_friction_holds_inside_its_cone_and_not_outside() -> None:
    angle = 0.2
    weight, free = MASS * 9.81 * LEVER * np.sin(angle), run(0.0, 400, first=angle, enabled=0.0)
    held, falling = (
        moved(PENDULUM.with_effect(effects.CoulombFriction("shaft", share * weight)), free, 0.005)
        for share in (1.01, 0.99)
    )
    assert np.ptp(held) == 0.0
    assert falling[-1] < angle - 1e-3


def test_lossy_gear_lifts_with_one_efficiency_and_lowers_with_the_other() -> None:
    # Slowly: t = T / (1 - c) on the way up, t = T / (1 + c) on the way down.
    c, step = 0.3, 0.002
    robot = PENDULUM.with_effect(effects.LoadFriction("shaft", c))
    ramp = np.concatenate([np.linspace(0.0, 1.5, 10000), np.linspace(1.5, 0.0, 10000)])
    slow = ServoRun("slow", 2.0, ramp, np.ones(ramp.size), np.zeros(ramp.size))
    reached = moved(robot, slow, step)
    for row, share in ((9000, 1.0 - c), (17000, 1.0 + c)):
        speed = (reached[row + 100] - reached[row - 100]) / (200 * step)
        current = (2.0 * (ramp[row] - reached[row]) * 7.4 - KT * speed) / RESISTANCE
        load = MASS * 9.81 * LEVER * np.sin(reached[row])
        assert load / (KT * current) == pytest.approx(share, rel=0.01)


def test_an_effect_that_no_table_holds_is_refused_by_name() -> None:
    robot = PENDULUM.with_effect(effects.SupplySag("robot", 0.01))
    with pytest.raises(RobotError, match="supply_sag"):
        moved(robot, run(0.0, 3), 0.01)
