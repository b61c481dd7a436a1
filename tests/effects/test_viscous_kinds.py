"""Viscous friction that differs by direction or falls with temperature: law, plant, logs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

from wbc import Robot
from wbc.arrays import FloatArray
from wbc.dynamics import link_torque, rotor_torque
from wbc.effects import DirectionalViscousFriction, ThermalViscousFriction, ViscousFriction
from wbc.identification import diagnose
from wbc.measurement import Log
from wbc.robot import Effect, Motion
from wbc.sim import Plane, Plant
from wbc.sim.excitation import ENCODER, record_run, record_with

COLD, WARM = 20.0, 60.0
FAR = Plane(height=-9.0)


@pytest.mark.parametrize(
    ("effect", "temperature", "up", "down"),
    [
        (DirectionalViscousFriction("knee", 0.5, 0.2), None, 0.5, 0.2),
        (ThermalViscousFriction("knee", 0.4, 0.03), None, 0.4, 0.4),
        (ThermalViscousFriction("knee", 0.4, 0.03), COLD, 0.4 * np.exp(0.6), 0.4 * np.exp(0.6)),
        (ThermalViscousFriction("knee", 0.4, 0.03), WARM, 0.4 * np.exp(-0.6), 0.4 * np.exp(-0.6)),
    ],
)
def test_the_plant_slows_down_as_the_law_says(
    leg: Robot, effect: Effect, temperature: float | None, up: float, down: float
) -> None:
    """In no gravity, beside plain viscous friction of the coefficient that should act."""
    model = leg.model.copy()
    model.gravity.linear = np.zeros(3)
    warm = None if temperature is None else np.full(2, temperature)
    still = replace(leg, model=model)
    plant = Plant(still.with_effect(effect), FAR, temperature=warm)
    for speed, drag in ((1.0, up), (-1.0, down)):
        same = Plant(still.with_effect(ViscousFriction("knee", drag)), FAR)
        ends = []
        for one in (plant, same):
            state = one.state([0.0, 0.0], [0.0, speed])
            for _ in range(100):
                state = one.step(state, np.zeros(2), 1e-3).state
            ends.append(np.concatenate((state.position, state.velocity)))
        np.testing.assert_allclose(*ends, atol=1e-9)
        assert abs(ends[0][3]) < abs(speed)


def test_the_law_of_directions_against_an_independent_integration(leg: Robot) -> None:
    """Effects see the speed before a step: the plant is off by O(h), four times less at h/4."""
    model = leg.model.copy()
    model.armature = leg.transmission.reflected_inertia
    data = model.createData()

    def rate(_: float, y: FloatArray) -> FloatArray:
        drag = np.array([0.0, -(0.5 if y[3] > 0.0 else 0.2) * y[3]])
        return np.concatenate((y[2:], pin.aba(model, data, y[:2], y[2:], drag)))

    truth = solve_ivp(rate, (0.0, 0.5), [0.3, -0.6, 0.0, 0.0], rtol=1e-9, atol=1e-11).y[:, -1]
    assert truth[1] > 0.0 > truth[0]
    plant = Plant(leg.with_effect(DirectionalViscousFriction("knee", 0.5, 0.2)), FAR)
    errors = []
    for h in (1e-3, 2.5e-4):
        state = plant.state([0.3, -0.6])
        for _ in range(round(0.5 / h)):
            state = plant.step(state, np.zeros(2), h).state
        errors.append(np.abs(np.concatenate((state.position, state.velocity)) - truth).max())
    assert errors[0] < 3e-3
    assert errors[1] < 0.3 * errors[0]


def logs_of(leg: Robot, effects: list[Effect], temperatures: list[float | None]) -> list[Log]:
    real = leg.with_effects(*effects)
    logs = []
    for k, degrees in enumerate(temperatures):
        warm = None if degrees is None else np.full(2, degrees)
        logs.append(ENCODER.measure(real, record_run(real, leg, 7 + k // 2, 3.0, warm), k))
    return logs


def test_friction_that_falls_with_temperature_is_named(leg: Robot) -> None:
    logs = logs_of(leg, [ThermalViscousFriction("knee", 0.6, 0.03)], [COLD, WARM, COLD, 40.0])
    diagnosis = diagnose(leg, logs)
    assert diagnosis.verdict == "named"
    (found,) = diagnosis.effects
    assert found.key == ("thermal_viscous_friction", "knee")
    assert found.values["coefficient"] == pytest.approx(0.6, rel=0.02)
    assert found.values["rate"] == pytest.approx(0.03, rel=0.05)


def test_friction_that_differs_by_direction_is_named(leg: Robot) -> None:
    logs = logs_of(leg, [DirectionalViscousFriction("hip", 0.6, 0.2)], [None, None, None])
    diagnosis = diagnose(leg, logs)
    assert diagnosis.verdict == "named"
    (found,) = diagnosis.effects
    assert found.key == ("directional_viscous_friction", "hip")
    ways = {"positive_direction": 0.6, "negative_direction": 0.2}
    assert found.values == pytest.approx(ways, rel=0.02)


def test_logs_need_the_friction_at_their_temperature(leg: Robot) -> None:
    robot = leg.with_effect(ThermalViscousFriction("knee", 0.4, 0.03))
    q, v = np.zeros((2, 2)), np.full((2, 2), 1.5)
    motion = Motion(q, v, np.zeros((2, 2)), temperature=np.array([[20.0, 20.0], [20.0, 60.0]]))
    links = link_torque(robot, motion)
    more = rotor_torque(robot, motion, links)[0] - rotor_torque(leg, motion, links)[0]
    expected = 1.5 * 0.4 * np.exp([0.6, -0.6]) / leg.transmission.gear_ratio[1]
    np.testing.assert_allclose(more[:, 1], expected, rtol=1e-12)
    np.testing.assert_allclose(more[:, 0], 0.0, atol=1e-12)


def test_one_temperature_or_one_direction_shows_no_such_friction(leg: Robot) -> None:
    v = np.stack([np.linspace(-1.0, 1.0, 50), np.linspace(0.1, 1.0, 50)], axis=1)
    same = Motion(np.zeros((50, 2)), v, temperature=np.full((50, 2), 40.0))
    thermal = ThermalViscousFriction("knee", 0.4, 0.03)
    assert not thermal.search.recognisable(thermal, leg, [same])
    assert not thermal.search.recognisable(thermal, leg, [same.replace(temperature=None)])
    warmer = same.replace(temperature=np.full((50, 2), 50.0))
    assert thermal.search.recognisable(thermal, leg, [same, warmer])
    assert DirectionalViscousFriction.search.recognisable(
        DirectionalViscousFriction("hip", 0.4, 0.1), leg, [same]
    )
    assert not DirectionalViscousFriction.search.recognisable(
        DirectionalViscousFriction("knee", 0.4, 0.1), leg, [same]
    )


def test_friction_alike_in_both_directions_is_plain_viscous_friction(leg: Robot) -> None:
    """With one number more it does as well; until it cost a name, every answer was tied."""
    logs = record_with(leg, [ViscousFriction("knee", 0.3)], duration=6.0)
    found = diagnose(leg, logs)
    assert found.verdict == "named"
    assert [(one.effect.key, one.rivals) for one in found.findings] == [
        (("viscous_friction", "knee"), ())
    ]
