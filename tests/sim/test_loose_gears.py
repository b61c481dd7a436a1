"""Compliant gears, gears with play, and rotors that couple to their housings."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from sims.leg import balanced_pose
from tests.sim.ground.random_grounds import made_by_rows
from tests.sim.random_robots import BASES, geared, random_robot, softened
from wbc import Robot, load_robot
from wbc.dynamics import evaluate, redundant_model
from wbc.effects import CoulombFriction
from wbc.sim import Plane, Plant, SimState


def _arm(**numbers) -> Robot:
    """Return an arm without weight."""
    robot = replace(load_robot("planar_leg_fixed").lossless(), contacts=())
    return geared(robot.with_gravity(np.zeros(3)), **numbers)


def test_a_spring_and_two_inertias_ring_at_their_frequency() -> None:
    robot = _arm(stiffness=80.0)
    locked = robot.with_effects(CoulombFriction("knee", 1e4))
    plant = Plant(locked)
    q = np.array([0.0, 0.3])
    state = plant.state(q).replace(deflection=np.array([0.05, 0.0]), motor_velocity=np.zeros(2))
    link = evaluate(robot, q, np.zeros(2)).mass_matrix[0, 0]
    rotor = robot.transmission.reflected_inertia[0]
    pulse = np.sqrt(80.0 * (1.0 / link + 1.0 / rotor))
    dt, errors = 2e-4, []
    for _ in range(round(3 * 2 * np.pi / pulse / dt)):
        state = plant.step(state, np.zeros(2), dt).state
        errors.append(state.deflection[0] - 0.05 * np.cos(pulse * state.time))
    assert np.abs(errors).max() < 1e-3
    assert np.abs(state.velocity[1]) < 1e-9


def test_coupled_rotors_move_as_the_redundant_model_says() -> None:
    robot = replace(load_robot("planar_leg").lossless(), rotors_turn_with_links=True, contacts=())
    plant = Plant(robot)
    rng = np.random.default_rng(2)
    for _ in range(5):
        q = robot.configuration(hip=rng.uniform(-1, 1), knee=rng.uniform(-1, 1))
        v, torque = rng.normal(size=5), rng.uniform(-0.9, 0.9, 2)
        dt, model = 1e-7, redundant_model(robot, evaluate(robot, q, v))
        K, drive = model.nullspace, np.concatenate((np.zeros(robot.model.nv), torque))
        expected = np.linalg.solve(K.T @ model.inertia @ K, K.T @ (drive - model.bias))
        measured = (plant.step(plant.state(q, v), torque, dt).state.velocity - v) / dt
        assert np.allclose(measured, expected, rtol=1e-5, atol=1e-5 * np.abs(expected).max())


def bent(plant: Plant, q, ahead: float, rate: float, *more, **lifted) -> SimState:
    """Return a state whose second motor is ahead of its link [rad], and its speed [rad/s]."""
    state = plant.state(q, *more, **lifted)
    return state.replace(deflection=[0.0, ahead], motor_velocity=[0.0, rate])


@pytest.mark.parametrize("play", [0.0, 0.01])
def test_the_plant_and_the_logs_step_through_one_law_of_the_flanks(play: float) -> None:
    """What passes the gear in a short step is `Flanks.torque`, pushing and let go of."""
    robot = load_robot("planar_leg_fixed").lossless()
    robot = geared(robot, stiffness=[np.inf, 800.0], damping=[0.0, 3.0], backlash=[0.0, play])
    plant, law, seen = Plant(robot, Plane(height=-9.0)), robot.transmission.flanks("knee"), set()
    for ahead in (-0.02, -0.006, -0.002, 0.003, 0.0052, 0.03):
        for rate in (-20.0, -0.5, 0.0, 0.5, 20.0):
            state = bent(plant, [0.3, 0.4], ahead, rate)
            torque = plant.step(state, [0.0, 0.0], 1e-7).mesh_torque[1]
            expected = float(law.torque(-ahead, -rate))
            assert torque == pytest.approx(expected, rel=1e-3, abs=1e-3)
            seen.add(expected == 0.0)
    assert seen == ({True, False} if play else {False})
    energies = (bent(plant, [0.3, 0.4], ahead, 20.0) for ahead in (0.0, 0.02))
    before, after = map(plant.mechanical_energy, energies)
    stored = 0.5 * law.stiffness * (0.02 - 0.5 * play) ** 2
    assert after - before == pytest.approx(stored, abs=1e-12)


@pytest.mark.parametrize("stiffness", [80.0, 800.0, 8000.0])
@pytest.mark.parametrize("dt", [1e-3, 4e-3])
def test_a_link_that_crosses_its_play_keeps_its_energy(stiffness: float, dt: float) -> None:
    """Each arrival at a flank gained up to the share h^2 k / (4 I) of what swings."""
    robot = _arm(stiffness=[np.inf, stiffness], backlash=[0.0, 0.02])
    plant = Plant(robot.with_effect(CoulombFriction("hip", 1e4)))  # which is held
    state = bent(plant, [0.3, 0.4], 0.0, 1.5)
    energy, sides = [], set()
    for _ in range(300):
        result = plant.step(state, [0.0, 0.0], dt)
        state = result.state
        energy.append(plant.mechanical_energy(state))
        sides.add(int(np.sign(state.deflection[1]) * (abs(state.deflection[1]) > 0.01)))
        assert not result.events
        assert abs(result.balance.residual) < 1e-9 * energy[0]
    assert sides == {-1, 0, 1}
    np.testing.assert_allclose(energy, energy[0], rtol=1e-9)


@pytest.mark.parametrize("play", [0.0, 0.01])
def test_the_laws_hold_in_steps_of_any_length(play: float) -> None:
    """In a short step a spring passes the same whatever the speeds: no compliance stands for it.

    Written as the compliance 4 / (h^2 k) of its row it set the scale of the floor of all other
    rows and of the accepted error, and parts below a nanosecond made energy.
    """
    leg = geared(load_robot("planar_leg"), stiffness=[np.inf, 900.0], backlash=[0.0, play])
    plant, rates = Plant(leg), []
    q = balanced_pose(leg)
    for dt in (1e-6, 1e-8, 1e-10, 1e-12):
        state = bent(plant, q, 0.02, 0.3, [0.0, 0.0, 0.0, 0.4, -0.7], lifted=True)
        state = plant.step(state, [0.0, 0.0], 1e-9).state  # the foot lands
        result = plant.step(state, [0.0, 0.0], dt)
        assert result.unsettled == 0
        assert made_by_rows(result) < 1e-9
        assert not [event for event in result.events if event.kind == "energy"]
        spring = 900.0 * (state.deflection[1] - 0.5 * play)
        assert result.mesh_torque[1] == pytest.approx(spring, rel=1e-3)
        rates.append(result.contact_impulse.ravel() / dt)
    for rate in rates[1:]:
        np.testing.assert_allclose(rate, rates[0], rtol=1e-2, atol=1e-2 * np.abs(rates[0]).max())


def test_flanks_that_are_crossed_many_times_within_a_step_are_met() -> None:
    """Such steps raised, and ended passively later: play of 0.1 to 100 mrad in steps of 0.1 s."""
    rng = np.random.default_rng(199)
    sizes = 0.5 + 0.5 * rng.random(), 0.3 + 0.5 * rng.random(), rng.random()
    robot = softened(rng, random_robot(rng, BASES[1], *sizes, False))
    plant = Plant(robot, Plane(height=-20.0))
    state = plant.state(robot.neutral(), 3.0 * rng.normal(size=robot.model.nv))
    for tried in (1e-3, 1e-2, 0.1):  # the torques of the steps that failed
        now = state
        for _ in range(8):
            torque = rng.normal(size=robot.transmission.size) * 10.0 ** rng.uniform(-2.0, 2.0)
            result = plant.step(now, torque, tried)
            now = result.state
            assert result.unsettled == 0


@pytest.mark.parametrize("seed", [90, 137, 178, 207])
def test_impacts_of_heavy_rotors_behind_lossy_gears_have_a_solution(seed):
    """What a housing takes of its rotor's momentum leaves the law of an impact monotone."""
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, BASES[(2, 1, 0)[seed % 3]], 0.05, 0.1, 1.0, True)
    gears = robot.transmission
    heavy = {"gear_ratio": gears.gear_ratio / 10.0, "rotor_inertia": 30.0 * gears.rotor_inertia}
    plant = Plant(geared(robot, **heavy, forward_efficiency=0.05, backward_efficiency=0.3))
    q = pin.integrate(robot.model, robot.neutral(), 0.4 * rng.normal(size=robot.model.nv))
    state = plant.state(q, 3.0 * rng.normal(size=robot.model.nv), lifted=True)
    for _ in range(60):
        result = plant.step(state, np.zeros(gears.size), 5e-3)
        assert not [event for event in result.events if event.kind == "energy"]
        state = result.state


def test_an_impact_at_the_start_leaves_motors_behind_springs_their_speed() -> None:
    leg = geared(load_robot("planar_leg"), stiffness=80.0)
    plant = Plant(leg)
    q = leg.configuration(hip=-0.5, knee=1.0, base_z=0.8 * np.cos(0.5))
    landed = plant.state(q, [0.0, -1.0, 0.0, 0.0, 0.0])
    told = landed.replace(motor_velocity=np.zeros(2))
    ends = [plant.step(state, np.zeros(2), 1e-5) for state in (landed, told)]
    assert all(len(end.impacts) == 1 for end in ends)
    assert np.array_equal(ends[0].state.motor_velocity, ends[1].state.motor_velocity)
    assert np.abs(ends[0].state.motor_velocity).max() < 0.1 < np.abs(ends[0].state.velocity).max()
