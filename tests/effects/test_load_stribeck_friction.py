"""Load friction that falls with speed: its law, the plant, the energy, the controller, servos."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

from wbc import Robot, load_robot
from wbc.arrays import FloatArray
from wbc.control import Controller, PostureTask, Reference
from wbc.dynamics import link_torque, rotor_torque
from wbc.effects import EFFECTS, LoadFriction, LoadStribeckFriction
from wbc.robot import Motion
from wbc.robot.dc_drive import DcDrive
from wbc.sim import EnergyAudit, EnergyFlow, Plane, Plant
from wbc.sim.servo_rollout import servo_rollout
from wbc.sim.servo_run import ServoRun

FAR = Plane(height=-9.0)
RATIO, SHARE, SPEED = 20.0, 0.5, 5.0


def share_at(speed: FloatArray) -> FloatArray:
    return np.asarray(SHARE * np.exp(-((speed / SPEED) ** 2)))


def test_logs_need_the_load_friction_of_their_speed(leg: Robot) -> None:
    """Sample by sample the gear is one with `LoadFriction` of the coefficient at that speed."""
    random = np.random.default_rng(3)
    q, v, a = random.normal(size=(3, 40, 2))
    motion = Motion(q, 2.0 * v, a, time=np.arange(40.0))
    robot = leg.with_effect(LoadStribeckFriction("knee", SHARE, SPEED))
    needed, _ = rotor_torque(robot, motion, link_torque(leg, motion))
    for k in range(40):
        one = Motion(q[[k]], 2.0 * v[[k]], a[[k]])
        plain = leg.with_effect(LoadFriction("knee", float(share_at(2.0 * v[k, 1]))))
        truth, _ = rotor_torque(plain, one, link_torque(leg, one))
        np.testing.assert_allclose(needed[k], truth[0], rtol=1e-12)


def push(t: float) -> FloatArray:
    """Return rotor torques [N m] that turn the knee one way, under a load that changes sign."""
    return np.array([0.1 * np.sin(9.0 * t), 0.02 + 0.2 * np.sin(17.0 * t)])


START, FIRST = np.array([0.3, -1.2]), np.array([0.0, 3.0])


def march(robot: Robot, h: float, duration: float) -> tuple[FloatArray, EnergyFlow, float]:
    """Return q, v (N, 4) of the plant, the energy flow and the change of its energy [J]."""
    plant = Plant(robot, FAR)
    state = plant.state(START, FIRST)
    before, flow, rows = plant.mechanical_energy(state), EnergyFlow(), []
    for i in range(round(duration / h)):
        result = plant.step(state, push((i + 0.5) * h), h)
        state, flow = result.state, flow + result.energy
        assert min(result.energy.losses.values()) >= -1e-12
        rows.append((*state.position, *state.velocity))
    return np.array(rows), flow, plant.mechanical_energy(state) - before


def test_the_plant_moves_as_an_independent_integration_of_the_equations(leg: Robot) -> None:
    """The knee turns one way: t (1 -+ c(v)) = T, t = N tau - N^2 I_r a, by trying both signs."""
    model, rotor = leg.model, leg.transmission.reflected_inertia
    data, signs = model.createData(), []

    def rate(t: float, y: FloatArray) -> FloatArray:
        q, v = y[:2], y[2:]
        inertia = pin.crba(model, data, q)
        inertia = np.triu(inertia) + np.triu(inertia, 1).T
        bias, drive = pin.nle(model, data, q, v), RATIO * push(t)
        for sign in (1.0, -1.0):
            gain = np.array([1.0, 1.0 - sign * np.sign(v[1]) * float(share_at(v[1]))])
            a = np.linalg.solve(inertia + np.diag(gain * rotor), gain * drive - bias)
            if (drive[1] - rotor[1] * a[1]) * sign >= 0.0:
                break
        signs.append(sign)
        return np.concatenate((v, a))

    truth = solve_ivp(rate, (0.0, 0.3), [*START, *FIRST], rtol=1e-8, atol=1e-10, max_step=1e-3)
    assert truth.y[3].min() > 0.05
    assert {1.0, -1.0} <= set(signs)
    robot = leg.with_effect(LoadStribeckFriction("knee", SHARE, SPEED))
    end = truth.y[:, -1]
    errors, misses = [], []
    for h in (1e-3, 2.5e-4):
        rows, flow, change = march(robot, h, 0.3)
        errors.append(np.abs(rows[-1] - end).max())
        assert flow.mesh > 0.1
        misses.append(abs(EnergyAudit(flow, change).residual))
    without, _, _ = march(leg, 2.5e-4, 0.3)
    always, _, _ = march(leg.with_effect(LoadFriction("knee", SHARE)), 2.5e-4, 0.3)
    assert errors[1] < 0.4 * errors[0]
    assert misses[1] < 0.4 * misses[0]
    assert misses[1] < 0.2 * flow.mesh
    assert 8.0 * errors[1] < np.abs(without[-1] - end).max()
    assert 8.0 * errors[1] < np.abs(always[-1] - end).max()


@pytest.mark.parametrize(("speed", "holds"), [(0.0, True), (-4.0, False)])
def test_a_weight_that_is_held_at_rest_runs_once_it_moves(
    leg: Robot, speed: float, holds: bool
) -> None:
    """The gear at rest carries 1 / (1 - c) to 1 / (1 + c) of the load; in motion it does not."""
    robot = leg.with_effects(*(LoadStribeckFriction(j, SHARE, 0.3) for j in ("hip", "knee")))
    at = np.array([0.9, 0.0])
    load = pin.rnea(leg.model, leg.model.createData(), at, *np.zeros((2, 2)))
    plant = Plant(robot, FAR)
    state = plant.state(at, np.array([speed, 0.0]))
    torque = 0.8 * load / RATIO
    for _ in range(200):
        state = plant.step(state, torque, 1e-3).state
    assert (np.abs(state.velocity).max() < 1e-9) == holds
    assert (np.abs(state.position - at).max() < 1e-9) == holds


def test_the_controller_gives_what_the_gear_loses_at_its_speed(leg: Robot) -> None:
    robot = leg.with_effect(LoadStribeckFriction("knee", SHARE, SPEED))
    controller = Controller(robot, [PostureTask.of(robot)])
    plant = Plant(robot, FAR)
    for speed in (6.0, 1.0, 2.0):
        controller.reset()
        state = plant.state(START, np.array([0.0, speed]))
        wanted = Reference(START, np.array([0.0, speed]), np.array([1.0, 30.0]))
        command = controller.step(state, {"posture": wanted})
        assert command.output_torque[1] > 0.0
        gain = command.output_torque[1] / command.mesh_torque[1]
        assert gain == pytest.approx(1.0 - share_at(np.float64(speed)), rel=1e-9)
        after = plant.step(state, command.rotor_torque, 1e-4).state
        a = (after.velocity - state.velocity) / 1e-4
        np.testing.assert_allclose(a, command.acceleration, rtol=0.02)


def test_servo_rollouts_stick_under_load_and_slide_once_they_move() -> None:
    """What holds the resting pendulum at 0.4 rad, switched off, lets it fall where it moves."""

    def final(coefficient: float, enabled: float) -> float:
        robot = load_robot("xl330_pendulum").with_effects(
            LoadStribeckFriction("shaft", coefficient, 0.05),
            EFFECTS["rotor_coulomb_friction"].at("shaft", {"level": 0.11}),
        )
        run = ServoRun("", 2.0, np.zeros(200), np.full(200, enabled), np.full(200, 0.4))
        return float(servo_rollout([(robot, DcDrive(7.4))], [run], 0.005)[-1, 0, 0])

    assert final(0.9, 0.0) == pytest.approx(0.4, abs=1e-12)
    assert final(0.0, 0.0) < 0.39
    assert abs(final(0.9, 1.0)) < 0.1
