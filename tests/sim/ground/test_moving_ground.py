"""Ground that moves: belts, lifts, tables that turn or tilt, and the energy that they give."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from tests.sim.ground.bodies import block
from tests.sim.ground.random_grounds import random_scene
from wbc import load_robot
from wbc.errors import SimulationError
from wbc.sim import EnergyAudit, EnergyFlow, Moving, Plane, Plant, Together

G = 9.81


def _along(way):
    """Return a motion that shifts the ground by way(t) (3,)."""
    return lambda time: pin.SE3(np.eye(3), np.asarray(way(time), dtype=float))


def _run(plant: Plant, state, dt: float, duration: float, torque=()):
    """Return the last result and the energy balance of a run."""
    flow, first = EnergyFlow(), plant.mechanical_energy(state)
    for _ in range(round(duration / dt)):
        result = plant.step(state, torque, dt)
        assert not [event for event in result.events if event.kind == "energy"]
        state, flow = result.state, flow + result.energy
    return result, EnergyAudit(flow, plant.mechanical_energy(state) - first)


def _standing(half_height: float = 0.05, friction: float = 0.4):
    robot = block((0.2, 0.2, 2 * half_height), friction)
    q = robot.neutral()
    q[2] = half_height
    return robot, q


def test_a_belt_takes_a_block_along() -> None:
    """It slides with mu g until it has the speed of the belt; the belt pays twice its energy."""
    robot, q = _standing()
    plant = Plant(robot, Moving(Plane(), _along(lambda t: [t, 0, 0])))
    result, audit = _run(plant, plant.state(q), 1e-3, 0.2)
    assert result.state.velocity[0] == pytest.approx(0.4 * G * 0.2, abs=1e-9)
    result, more = _run(plant, result.state, 1e-3, 0.3)
    assert result.state.velocity[0] == pytest.approx(1.0, abs=1e-9)
    whole = EnergyAudit(audit.flow + more.flow, audit.stored + more.stored)
    assert whole.flow.ground == pytest.approx(1.0, rel=5e-3)
    assert whole.flow.contact == pytest.approx(0.5, rel=5e-3)
    assert abs(whole.residual) < 5e-3
    assert "work of the ground" in str(whole)


@pytest.mark.parametrize(("dt", "error"), [(2e-3, 4e-3), (1e-3, 2e-3)])
def test_a_lift_carries_a_block_and_throws_it(dt: float, error: float) -> None:
    """Pressed with m (g + a) while a > -g; then it flies."""
    robot, q = _standing()
    height, rate = 0.05, 10.0  # up to 5 m/s^2, less than g
    plant = Plant(robot, Moving(Plane(), _along(lambda t: [0, 0, height * np.sin(rate * t)])))
    state = plant.state(q, [0, 0, height * rate, 0, 0, 0])
    result, audit = _run(plant, state, dt, 0.4)
    time, z = result.state.time, result.state.position[2]
    assert z - 0.05 == pytest.approx(height * np.sin(rate * time), abs=1e-6)
    assert result.state.velocity[2] == pytest.approx(height * rate * np.cos(rate * time), abs=error)
    push = G - height * rate**2 * np.sin(rate * (time - 0.5 * dt))
    assert result.contact_force[:, 2].sum() == pytest.approx(push, abs=0.05)
    assert abs(audit.residual) < 0.02 * abs(audit.flow.ground)
    quick = Plant(robot, Moving(Plane(), _along(lambda t: [0, 0, height * np.sin(20.0 * t)])))
    state = quick.state(q, [0, 0, 20.0 * height, 0, 0, 0])
    leaves = np.arcsin(G / (height * 400.0)) / 20.0  # where the lift falls away with g
    result, _ = _run(quick, state, dt, 0.08)
    flown = result.state.time - leaves
    up = height * 20.0 * np.cos(20.0 * leaves)
    expected = 0.05 + height * np.sin(20.0 * leaves) + up * flown - 0.5 * G * flown**2
    assert not result.state.closed.any()
    assert result.state.position[2] == pytest.approx(expected, abs=error)


def test_a_leg_on_a_ground_that_moves_evenly_moves_with_it() -> None:
    """Galileo: the same fall and impact as on ground at rest, at every speed of both."""
    leg = load_robot("planar_leg_strong")
    q = leg.configuration(hip=-0.5, knee=1.0, base_z=0.72)
    at_rest, speed = Plant(leg, restitution=0.3), np.array([0.7, 0.0, 0.4])
    moving = Plant(leg, Moving(Plane(), _along(lambda t: speed * t)), restitution=0.3)
    one, two = at_rest.state(q), moving.state(q, [speed[0], speed[2], 0, 0, 0])
    impacts = 0
    for _ in range(150):
        first, second = at_rest.step(one, [1.0, -2.0], 1e-3), moving.step(two, [1.0, -2.0], 1e-3)
        one, two = first.state, second.state
        impacts += len(first.impacts)
        assert len(first.impacts) == len(second.impacts)
        for a, b in zip(first.impacts, second.impacts, strict=True):
            assert b.contact_loss == pytest.approx(a.contact_loss, abs=1e-6)
            assert b.mesh_loss == pytest.approx(a.mesh_loss, abs=1e-6)
    carried = np.array([speed[0], speed[2], 0, 0, 0])
    assert impacts > 0
    assert two.velocity - carried == pytest.approx(one.velocity, abs=2e-6)
    assert two.position - carried * two.time == pytest.approx(one.position, abs=2e-7)


def test_what_the_balance_leaves_halves_with_the_step_and_contacts_make_nothing() -> None:
    left = np.zeros(2)
    for seed in range(6):
        rng = np.random.default_rng(seed)
        plant, start = random_scene(rng, "free", ("stairs", "plane")[seed % 2], 0.0, least=0.0)
        turn, way = rng.normal(size=3), rng.normal(size=3)

        def pose(time: float, turn=turn, way=way) -> pin.SE3:
            return pin.SE3(pin.exp3(0.2 * np.sin(5 * time) * turn), 0.05 * np.sin(8 * time) * way)

        moved = replace(plant, terrain=Moving(plant.terrain, pose))
        torque = np.zeros(plant.robot.transmission.size)
        for i, dt in enumerate((1e-3, 5e-4)):
            left[i] += abs(_run(moved, start, dt, 0.03, torque)[1].residual)
    assert left[1] < 0.6 * left[0]


def test_motions_that_are_none_are_refused() -> None:
    robot, q = _standing()
    with pytest.raises(SimulationError, match=r"pose\(0\) of the moving ground .* pin.SE3"):
        Plant(robot, Together([Moving(Plane(), lambda t: np.eye(4))]))
    lost = Plant(robot, Moving(Plane(), _along(lambda t: [0.0 if t < 0.01 else np.nan, 0, 0])))
    with pytest.raises(SimulationError, match="is not finite"):
        lost.step(lost.state(q), [], 0.1)
