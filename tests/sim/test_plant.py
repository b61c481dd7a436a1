"""The plant against conservation laws and textbook answers."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

from tests.sim.random_robots import geared
from wbc import load_robot
from wbc.control import RotorTorqueLimit
from wbc.dynamics import evaluate
from wbc.effects import CoulombFriction
from wbc.sim import Plane, Plant, Stairs, simulate


def test_a_falling_gear_takes_less_inertia_than_a_growing_one() -> None:
    """One gear on one link: the impact's velocity path and its losses in closed form."""
    robot = load_robot("planar_leg_fixed")
    eta_f, eta_b = robot.transmission.forward_efficiency, robot.transmission.backward_efficiency
    foot, rng = Plant(robot), np.random.default_rng(0)
    reflected = robot.transmission.reflected_inertia
    seen = set()
    for _ in range(60):
        q = robot.configuration(hip=rng.uniform(-1, 1), knee=rng.uniform(-2, 2))
        plant = Plant(robot, terrain=Plane(height=float(foot.gaps(foot.state(q))[0])))
        inertia = evaluate(robot, q, np.zeros(2)).mass_matrix + np.diag(reflected)
        for impact in plant.step(plant.state(q, 3 * rng.normal(size=2)), np.zeros(2), 1e-9).impacts:
            before, after = impact.before, impact.after
            taken = np.where(np.abs(after) < np.abs(before), eta_f, 1.0 / eta_b)
            through_rest = before * after < 0.0
            path = -taken * reflected * (after - before)
            bent = eta_f * reflected * before - reflected * after / eta_b
            expected = np.where(through_rest, bent, path)
            assert np.allclose(impact.end["mesh_impulse"], expected, atol=1e-9)
            had, has = 0.5 * reflected * before**2, 0.5 * reflected * after**2
            bent = (1.0 - eta_f) * had + (1.0 / eta_b - 1.0) * has
            lost = np.where(through_rest, bent, (1.0 - taken) * (had - has)).sum()
            assert impact.mesh_loss == pytest.approx(lost, abs=1e-9)
            kinetic = [0.5 * v @ inertia @ v for v in (before, after)]
            lost = impact.mesh_loss + impact.contact_loss
            assert lost == pytest.approx(kinetic[0] - kinetic[1], rel=1e-6)
            seen |= set(zip(through_rest.tolist(), (taken < 1.0).tolist(), strict=True))
    assert seen == {(False, False), (False, True), (True, False), (True, True)}


def test_a_passive_robot_on_self_locking_gears_stands_for_ever() -> None:
    robot = load_robot("solo12")
    robot = geared(robot, forward_efficiency=0.45, backward_efficiency=2.0 - 1.0 / 0.45)
    plant, pose = Plant(robot), robot.pose()
    results = plant.run(plant.state(pose), np.zeros(12), 0.4, 200)
    state, force = results[-1].state, np.mean([one.contact_force for one in results], axis=0)
    assert np.abs(state.velocity).max() < 1e-8
    assert np.abs(state.position - pose).max() < 1e-5
    weight = 9.81 * sum(inertia.mass for inertia in robot.model.inertias)
    assert force[:, 2].sum() == pytest.approx(weight, rel=1e-4)


@pytest.mark.parametrize(("share", "holds"), [(1.001, True), (0.999, False)])
def test_holding_bound(share: float, holds: bool) -> None:
    """Standing costs eta_b T: a little more holds for ever, a little less sinks."""
    robot = replace(load_robot("planar_leg_fixed"), contacts=())
    q = robot.configuration(hip=0.9, knee=0.4)
    plant = Plant(robot)
    load = pin.rnea(robot.model, robot.model.createData(), q, *np.zeros((2, 2)))
    gears = robot.transmission
    torque = share * gears.backward_efficiency * load / gears.gear_ratio
    state = plant.run(plant.state(q), torque, 0.3, 300)[-1].state
    if holds:
        assert np.array_equal(state.position, q)
    else:
        assert np.abs(state.position - q).min() > 1e-6


def test_a_landing_on_a_step_happens_at_its_height() -> None:
    robot = load_robot("planar_leg")
    plant = Plant(robot, terrain=Stairs(np.array([-0.2, 0.2]), np.array([0.0, 0.15, 0.3])))
    state = plant.state(robot.configuration(hip=0.5, knee=-1.0, base_z=1.5))
    falls = np.sqrt(2 * (Plant(robot).gaps(state)[0] - 0.15) / 9.81)
    run = simulate(plant, lambda s: np.zeros(2), state, falls + 2e-3)
    assert run.impacts[0].time == pytest.approx(falls, abs=2e-6)


def test_a_motor_at_its_voltage_limit_runs_into_its_speed() -> None:
    leg = load_robot("planar_leg_fixed").lossless().with_gravity([0.0, 0.0, 0.0])
    robot = geared(leg, torque_limit=1.0, speed_limit=100.0)
    curve = RotorTorqueLimit(knee=0.5)
    plant = Plant(robot, Plane(height=-9.0), motor_bounds=curve.bounds)
    model = robot.model.copy()
    model.armature = robot.transmission.reflected_inertia
    data = model.createData()

    def rate(_: float, y: np.ndarray) -> np.ndarray:
        speed = 20.0 * y[2:]
        along = np.clip(2.0 * (1.0 - np.abs(speed) / 100.0), 0.0, 1.0)
        torque = 20.0 * np.where(speed >= 0.0, np.minimum(2.0, along), 1.0) * [0.0, 1.0]
        return np.concatenate((y[2:], pin.aba(model, data, y[:2], y[2:], torque)))

    truth = solve_ivp(rate, (0.0, 0.5), np.zeros(4), rtol=1e-9, atol=1e-9).y[2:, -1]
    run = simulate(plant, lambda s: np.array([0.0, 2.0]), plant.state(np.zeros(2)), 0.5, dt=5e-4)
    assert run.state.velocity == pytest.approx(truth, abs=5e-3)
    assert truth[1] > 4.0
    reported = run.log.column("knee.rotor_torque")
    assert reported[0] == 1.0  # what the motor takes of the 2 N m it was asked for
    assert reported[-1] < 0.3


def test_a_humanoid_that_stands_on_dry_joints_takes_a_bounded_step() -> None:
    """More rows stick than there are coordinates: 30 dry joints and two feet on four points."""
    smooth = load_robot("talos")
    gears, at = smooth.transmission, smooth.actuated_position
    levels = 0.02 * np.abs(gears.gear_ratio) * gears.torque_limit
    dry = zip(gears.joints, levels.tolist(), strict=True)
    robot = smooth.with_effects(*(CoulombFriction(joint, level) for joint, level in dry))
    plant, pose = Plant(robot), robot.pose()
    state = plant.state(pose)
    for _ in range(40):
        error = state.position[at] - pose[at] + 0.025 * state.velocity[robot.actuated]
        result = plant.step(state, -2000.0 * error / gears.gear_ratio, 1e-3)
        state = result.state
        for part in result.parts:
            assert part.iterations < 150
        assert result.unsettled == 0
