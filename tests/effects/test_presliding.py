"""Bristles against independent integration, their limits, their energy, and logs of the plant."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

from wbc import Robot, load_robot
from wbc.arrays import FloatArray
from wbc.dynamics import link_torque, rotor_torque
from wbc.effects import CoulombFriction, Presliding
from wbc.errors import EffectError
from wbc.robot import Motion
from wbc.sim import Plane, Plant

START = np.array([0.3, -0.6])
RATIO = 20.0
LEVEL, LENGTH = 0.8, 0.05


def push(t: float) -> FloatArray:
    """Return rotor torques [N m] that move both joints back and forth several times."""
    return np.array([0.25 * np.sin(17.0 * t), 0.12 * np.sin(23.0 * t + 1.0)])


def march(robot: Robot, h: float, duration: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return positions, velocities (N, 2) and z (N,) of the plant."""
    plant = Plant(robot, terrain=Plane(height=-9.0))
    state = plant.state(START)
    rows = []
    for i in range(round(duration / h)):
        state = plant.step(state, push((i + 0.5) * h), h).state
        z = state.memory[0][0] if state.memory else 0.0
        rows.append((state.position, state.velocity, z))
    position, velocity, z = zip(*rows, strict=True)
    return np.array(position), np.array(velocity), np.array(z)


def test_the_plant_moves_as_an_independent_integration_of_the_equations(leg: Robot) -> None:
    model = leg.model.copy()
    armature = np.zeros(model.nv)
    armature[leg.actuated] = leg.transmission.reflected_inertia
    model.armature = armature
    data = model.createData()

    def rate(t: float, y: FloatArray) -> FloatArray:
        torque = RATIO * push(t) + np.array([0.0, -LEVEL * y[4]])
        bent = (y[3] - abs(y[3]) * y[4]) / LENGTH
        return np.concatenate((y[2:4], pin.aba(model, data, y[:2], y[2:4], torque), [bent]))

    truth = solve_ivp(
        rate, (0.0, 0.5), np.r_[START, 0.0, 0.0, 0.0], rtol=1e-9, atol=1e-11, max_step=2e-3
    ).y[:, -1]
    errors = []
    for h in (1e-3, 5e-4, 2.5e-4):
        q, v, z = march(leg.with_effect(Presliding("knee", LEVEL, LENGTH)), h, 0.5)
        errors.append(np.abs(np.r_[q[-1], v[-1], z[-1]] - truth).max())
    assert errors[-1] < 2e-3
    assert all(finer < 0.6 * coarser for coarser, finer in pairwise(errors))


def test_short_bristles_are_coulomb_friction_in_the_plant(leg: Robot) -> None:
    h, duration = 5e-4, 0.3
    dry, _, _ = march(leg.with_effect(CoulombFriction("knee", LEVEL)), h, duration)
    free, _, _ = march(leg, h, duration)
    felt = np.abs(dry - free).max()
    misses = []
    for length in (0.05, 0.001, 0.0):
        bent, _, z = march(leg.with_effect(Presliding("knee", LEVEL, length)), h, duration)
        misses.append(np.abs(bent - dry).max())
        assert np.all(np.abs(z) <= 1.0)
    assert misses[0] > 3.0 * misses[1] > 9.0 * misses[2]
    assert misses[2] < 0.01 * felt


@pytest.mark.parametrize("length", [0.0, 1e-6, 1e-3])
@pytest.mark.parametrize("h", [1e-3, 1e-2])
def test_no_step_is_too_long_for_stiff_bristles(leg: Robot, length: float, h: float) -> None:
    """A joint that hangs at rest below its friction stays there, and comes to rest there."""
    plant = Plant(leg.with_effect(Presliding("knee", 5.0, length)), terrain=Plane(height=-9.0))
    state = plant.state(np.zeros(2)).replace(velocity=np.array([0.0, 0.5]))
    highest = plant.mechanical_energy(state)
    for _ in range(round(1.0 / h)):
        state = plant.step(state, np.zeros(2), h).state
        assert plant.mechanical_energy(state) < highest + 0.05 * abs(highest) + 0.05
    assert abs(state.velocity[1]) < 0.1


def test_work_is_what_is_stored_and_what_is_lost() -> None:
    robot = load_robot("planar_leg_fixed").lossless()
    t = np.linspace(0.0, 4.0, 40001)
    angle = 0.2 * np.sin(2.0 * t) + 0.05 * np.sin(9.0 * t)
    q = np.stack([0.0 * t, angle], axis=1)
    v = np.stack([0.0 * t, 0.4 * np.cos(2.0 * t) + 0.45 * np.cos(9.0 * t)], axis=1)
    torque = Presliding("knee", LEVEL, LENGTH).joint_torque(robot, Motion(q, v, time=t))
    assert torque is not None
    z = -torque[:, 1] / LEVEL
    stored = 0.5 * LEVEL * LENGTH * z**2
    power = LEVEL * z * v[:, 1]
    lost = LEVEL * np.abs(v[:, 1]) * z**2
    gone = np.trapezoid(power - lost, t)
    assert gone == pytest.approx(stored[-1] - stored[0], abs=1e-4 * np.trapezoid(lost, t))
    assert power.min() < -0.1 * power.max()  # after a reversal they give energy back


def test_a_log_of_the_plant_needs_the_torque_that_was_commanded(leg: Robot) -> None:
    h, robot = 1e-3, leg.with_effect(Presliding("knee", LEVEL, LENGTH))
    q, v, _ = march(robot, h, 0.6)
    t = h * (1.0 + np.arange(len(q)))
    a = np.gradient(v, h, axis=0)
    motion = Motion(q, v, a, time=t)
    needed, _ = rotor_torque(robot, motion, link_torque(robot, motion))
    without, _ = rotor_torque(leg, motion, link_torque(leg, motion))
    given = np.array([push(time) for time in t])
    inner = slice(20, -20)
    left = RATIO * (needed - given)[inner, 1]
    missed = RATIO * (without - given)[inner, 1]
    assert np.sqrt(np.mean(left**2)) < 0.08 * np.sqrt(np.mean(missed**2))


def test_where_no_memory_is_known_it_acts_as_coulomb_friction(leg: Robot) -> None:
    effect, dry = Presliding("knee", LEVEL, LENGTH), CoulombFriction("knee", LEVEL)
    sample = Motion(START, np.array([0.1, -0.4]))
    assert effect.joint_torque(leg, sample) is None
    np.testing.assert_array_equal(
        effect.joint_friction(leg, sample), dry.joint_friction(leg, sample)
    )
    with pytest.raises(EffectError, match="presliding at 'knee' has no state"):
        effect.next_memory(leg, sample, np.zeros(2))
