"""Gears whose losses build up: against independent integration, their limit, energy and logs."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

from wbc import Robot
from wbc.arrays import FloatArray
from wbc.dynamics import link_torque, rotor_torque
from wbc.effects import LoadPresliding, Presliding, TransmissionEfficiency
from wbc.errors import EffectError
from wbc.robot import Motion
from wbc.sim import EnergyAudit, EnergyFlow, Plane, Plant
from wbc.transmission import mesh_input

START = np.array([0.3, -0.6])
RATIO, ETA_F, ETA_B, LENGTH = 20.0, 0.7, 0.6, 0.05
MEAN, DIFFERENCE = 0.5 * (1.0 / ETA_F - ETA_B), 0.5 * (1.0 / ETA_F + ETA_B) - 1.0
FAR = Plane(height=-9.0)


def push(t: float) -> FloatArray:
    """Return rotor torques [N m] that move both joints back and forth under changing loads."""
    return np.array([0.25 * np.sin(17.0 * t), 0.25 * np.sin(23.0 * t + 1.0)])


def march(robot: Robot, h: float, duration: float) -> FloatArray:
    """Return q, v and z (N, 5) of the plant."""
    plant = Plant(robot, FAR)
    state = plant.state(START)
    rows = []
    for i in range(round(duration / h)):
        state = plant.step(state, push((i + 0.5) * h), h).state
        z = state.memory[0][0] if state.memory else 0.0
        rows.append((*state.position, *state.velocity, z))
    return np.array(rows)


def bent(leg: Robot, length: float = LENGTH) -> Robot:
    return leg.with_effect(LoadPresliding("knee", ETA_F, ETA_B, length))


def test_the_plant_moves_as_an_independent_integration_of_the_equations(leg: Robot) -> None:
    """T_knee (1 + mean sgn(T) z + difference z^2) = N tau - N^2 I_r a, by trying both signs."""
    model, rotor = leg.model, leg.transmission.reflected_inertia
    data = model.createData()

    def rate(t: float, y: FloatArray) -> FloatArray:
        q, v, z = y[:2], y[2:4], y[4]
        inertia = pin.crba(model, data, q)
        inertia = np.triu(inertia) + np.triu(inertia, 1).T
        bias, drive = pin.nle(model, data, q, v), RATIO * push(t)
        for sign in (1.0, -1.0):
            gain = np.array([1.0, 1.0 + MEAN * sign * z + DIFFERENCE * z**2])
            a = np.linalg.solve(inertia + np.diag(rotor / gain), drive / gain - bias)
            if (drive[1] - rotor[1] * a[1]) * sign >= 0.0:
                break
        return np.concatenate((v, a, [(v[1] - abs(v[1]) * z) / LENGTH]))

    truth = solve_ivp(rate, (0.0, 0.5), [*START, 0, 0, 0], rtol=1e-8, atol=1e-10, max_step=2e-3)
    end = truth.y[:, -1]
    errors = [np.abs(march(bent(leg), h, 0.5)[-1] - end) for h in (1e-3, 2.5e-4)]
    assert errors[0].max() < 0.02
    assert errors[1].max() < 0.4 * errors[0].max()
    without = march(leg, 1e-3, 0.5)[-1]
    assert np.abs(without[:4] - end[:4]).max() > 10.0 * errors[0].max()  # the loss matters


def test_a_short_length_is_the_gear_with_these_efficiencies(leg: Robot) -> None:
    """A joint that reverses passes a length l in a time of sqrt(l): so the speeds are off."""
    gaps = {}
    for h in (1e-3, 5e-4):
        efficiency = TransmissionEfficiency("knee", ETA_F, ETA_B)
        sharp = march(leg.with_effect(efficiency), h, 0.3)[:, :4]
        for length in (0.05, 1e-6) if h == 1e-3 else (0.05, 5e-4, 1e-6):
            gaps[h, length] = np.abs(march(bent(leg, length), h, 0.3)[:, :4] - sharp).max()
    assert gaps[5e-4, 5e-4] < 0.15 * gaps[5e-4, 0.05]  # 0.1 by the root
    assert gaps[5e-4, 1e-6] < 0.6 * gaps[1e-3, 1e-6]  # what is left is the step's
    assert gaps[5e-4, 1e-6] < 0.03 * gaps[5e-4, 0.05]


def test_at_its_ends_the_law_is_that_of_the_efficiencies(leg: Robot) -> None:
    robot, n = bent(leg, 1e-4), 200
    q, v = np.zeros((n, 2)), np.zeros((n, 2))
    q[:, 1] = np.linspace(-1.0, 1.0, n)
    v[:, 1] = 1.0
    loads = np.random.default_rng(1).normal(size=(n, 2))
    for way in (1.0, -1.0):
        motion = Motion(way * q, way * v, np.zeros((n, 2)), time=np.arange(n) * 0.01)
        needed = mesh_input(loads, way * v, np.array([1.0, ETA_F]), np.array([1.0, ETA_B]))
        found = robot.effects[0].meshed(robot, motion, loads, np.array(loads))
        np.testing.assert_allclose(found[1:, 1], needed[1:, 1], rtol=1e-12)
    # A single sample, all that a controller knows, has no z: the efficiencies hold.
    one, load = Motion(q[0], v[0], np.zeros(2)), loads[0]
    assert robot.effects[0].meshed(robot, one, load, load) is load
    assert robot.transmission.forward_efficiency[1] == ETA_F


def test_logs_need_what_the_plant_was_given(leg: Robot) -> None:
    robot, h = bent(leg), 2.5e-4
    rows = march(robot, h, 0.5)
    q, v = rows[:, :2], rows[:, 2:4]
    a = np.gradient(v, h, axis=0)
    time = h * np.arange(1, len(q) + 1)
    motion = Motion(q, v, a, time=time)
    needed, _ = rotor_torque(robot, motion, link_torque(robot, motion))
    given = np.array([push(t) for t in time])
    plain, _ = rotor_torque(leg, motion, link_torque(leg, motion))
    inner = slice(5, -5)
    assert np.abs(needed - given)[inner].max() < 0.02 * np.abs(plain - given)[inner].max()


@pytest.mark.parametrize(
    "effect",
    [LoadPresliding("knee", ETA_F, ETA_B, LENGTH), Presliding("knee", 0.8, LENGTH)],
    ids=["under load", "of constant level"],
)
def test_bristles_have_lines_of_their_own_in_the_books(leg: Robot, effect: Presliding) -> None:
    """The store is level h z^2 / 2 at the end, nothing is made, and the books close with h."""
    misses = []
    for h in (2e-3, 5e-4):
        plant = Plant(leg.with_effect(effect), FAR)
        state = plant.state(START)
        before, flow, least = plant.mechanical_energy(state), EnergyFlow(), 0.0
        for i in range(round(0.6 / h)):
            result = plant.step(state, push((i + 0.5) * h), h)
            state, flow = result.state, flow + result.energy
            least = min(least, *result.energy.losses.values())
            # A step's own error, which shrinks with h below, may be named.
            assert all(event.kind == "coarse" for event in result.events)
        audit = EnergyAudit(flow, plant.mechanical_energy(state) - before)
        assert least >= -1e-12
        assert flow.bristles > 0.0
        assert flow.effects == 0.0  # no other effect does work
        misses.append(abs(audit.residual))
        z = state.memory[0][0]
        level = 0.8 if len(state.memory[0]) == 1 else MEAN * abs(state.memory[0][1])
        assert flow.bent == pytest.approx(0.5 * level * LENGTH * z**2, abs=1e-12)
        assert (flow.reloaded == 0.0) == (len(state.memory[0]) == 1)
        assert "stored in bristles" in str(audit)
    assert misses[1] < 0.4 * misses[0]
    assert misses[1] < 0.02 * flow.lost


def test_self_locking_and_states_outside_a_simulation_are_refused(leg: Robot) -> None:
    with pytest.raises(EffectError, match="backward_efficiency"):
        LoadPresliding("knee", 0.4, -0.5, 0.02)
    sample = Motion(START, np.zeros(2))
    effect = LoadPresliding("knee", 0.8, 0.7, 0.02)
    with pytest.raises(EffectError, match="load_presliding at 'knee' has no state"):
        effect.next_memory(leg, sample, np.zeros(2))
    assert effect.rotor_torque(leg, sample) is None
    assert effect.memory_energy(leg, sample) is None
