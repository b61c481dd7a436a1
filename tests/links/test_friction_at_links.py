"""Links that dry friction holds behind soft and loose gears, against a stiff ODE solver.

The solver shares nothing with the steps: its friction is a steep smooth function of the speed.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from wbc.links import Deflections, LinkFriction, LinkResponse, deflections
from wbc.transmission import Flanks

STEP = 0.002
TIME = np.arange(1000) * STEP
AT_REST = Deflections([], np.zeros((1, 2, 1)))
STEEP = 1e-4  # [rad/s] of the solver's friction
INERTIA = np.array([[0.12, 0.03], [0.03, 0.05]])
DRAG, PULL = np.array([0.05, 0.02]), np.array([0.7, 0.3])
SIZE, OMEGA = np.array([0.3, 0.2]), 2.0 * np.pi * np.array([0.8, 1.1])


def _motors(time: np.ndarray | float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return positions, velocities and accelerations (..., 2) of two motors."""
    angle = np.multiply.outer(time, OMEGA)
    position = SIZE * np.sin(angle) + 0.1
    return position, SIZE * OMEGA * np.cos(angle), -SIZE * OMEGA**2 * np.sin(angle)


def _truth(gears: list[Flanks], level: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Return deflections and rates (N, 2, n) of the first n links."""
    n = len(gears)
    inverse = np.linalg.inv(INERTIA[:n, :n])

    def rate(time: float, state: np.ndarray) -> np.ndarray:
        motor, speed, push = (column[:n] for column in _motors(time))
        d, v = state[:n], state[n:]
        torque = DRAG[:n] * (speed + v) + PULL[:n] * (motor + d) + INERTIA[:n, :n] @ push
        torque = torque + level * np.tanh((speed + v) / STEEP)
        for k, gear in enumerate(gears):
            stretch = d[k] - np.clip(d[k], -0.5 * gear.play, 0.5 * gear.play)
            touching = stretch != 0.0 or gear.play == 0.0
            torque[k] += gear.stiffness * stretch + (gear.damping * v[k] if touching else 0.0)
        return np.concatenate([v, -inverse @ torque])

    span = (0.0, float(TIME[-1]))
    path = solve_ivp(rate, span, start, "LSODA", TIME, max_step=1e-3, rtol=1e-7, atol=1e-9).y.T
    return np.stack([path[:, :n], path[:, n:]], axis=1)


def _responses(truth: np.ndarray, level: np.ndarray) -> list[LinkResponse]:
    """Return the log whose unexplained torque is that of the true motion, friction included."""
    n = level.size
    motor, speed, push = (column[:, :n] for column in _motors(TIME))
    load = push @ INERTIA[:n, :n] + DRAG[:n] * speed + PULL[:n] * motor
    d, v = truth[:, 0], truth[:, 1]
    a = np.gradient(v, STEP, axis=0)
    friction, counted = level * np.tanh((speed + v) / STEEP), level * np.sign(speed)
    torque = a @ INERTIA[:n, :n] + DRAG[:n] * v + PULL[:n] * d + friction - counted
    one = np.ones((TIME.size, 1))
    return [
        LinkResponse(
            step=STEP,
            row=k,
            load=load,
            inertia=INERTIA[[k], :n] * one,
            damping=np.eye(n)[[k]] * DRAG[k] * one,
            stiffness=np.eye(n)[[k]] * PULL[k] * one,
            unexplained=torque[:, k],
            band=lambda values: values,
            rows=np.arange(len(TIME)),
            friction=LinkFriction(speed[:, k], level[k] * one[:, 0], counted[:, k]),
        )
        for k in range(n)
    ]


@pytest.mark.parametrize("level", [0.3, 1.5])
def test_a_link_that_sticks_winds_up_its_spring(level: float) -> None:
    levels = np.array([level])
    truth = _truth([Flanks(300.0, 0.5, 0.0)], levels, np.zeros(2))
    responses = _responses(truth, levels)
    found = deflections(responses, [Flanks(300.0, 0.5)], AT_REST).paths[0]
    largest = np.abs(truth[:, 0, 0]).max()
    assert largest > level / 300.0
    assert found[:, 0] == pytest.approx(truth[:, 0, 0], abs=0.02 * largest)
    speed = _motors(TIME)[1][:, 0]
    rubs = level * np.tanh((speed + truth[:, 1, 0]) / STEEP)
    assert np.sqrt(np.mean((found[:, 3] - rubs) ** 2)) < 0.05 * level
    torque = 300.0 * found[:, 0] + 0.5 * found[:, 1]
    exact = 300.0 * truth[:, 0, 0] + 0.5 * truth[:, 1, 0]
    assert torque == pytest.approx(exact, abs=0.02 * np.abs(exact).max())


def test_links_that_shake_one_another_hold_one_another() -> None:
    levels = np.array([0.8, 0.4])
    truth = _truth([Flanks(300.0, 0.5, 0.0), Flanks(150.0, 0.2, 0.0)], levels, np.zeros(4))
    springs = [Flanks(300.0, 0.5), Flanks(150.0, 0.2)]
    found = deflections(_responses(truth, levels), springs, Deflections([], np.zeros((1, 2, 2))))
    for k, path in enumerate(found.paths):
        largest = np.abs(truth[:, 0, k]).max()
        assert path[:, 0] == pytest.approx(truth[:, 0, k], abs=0.03 * largest)


def test_where_a_held_link_began_is_found() -> None:
    levels, start = np.array([0.3]), np.array([0.012, -0.3])
    truth = _truth([Flanks(300.0, 0.5, 0.0)], levels, start)
    responses = _responses(truth, levels)
    found = None
    for _ in range(4):
        found = deflections(responses, [Flanks(300.0, 0.5)], found)
    assert found.starts[0, 0, 0] == pytest.approx(0.012, rel=0.05)
    assert found.starts[0, 1, 0] == pytest.approx(-0.3, rel=0.1)


def test_a_loose_link_with_friction_bounces_less() -> None:
    contact, levels = Flanks(800.0, 6.0, 0.02), np.array([0.4])
    start = np.array([-0.01, 0.0])
    truth = _truth([contact], levels, start)
    found = deflections([_responses(truth, levels)[0]], [contact]).paths[0]
    assert found[:, 0] == pytest.approx(truth[:, 0, 0], abs=8e-4)
    speed = _motors(TIME)[1][:, 0]
    rubs = levels * np.tanh((speed + truth[:, 1, 0]) / STEEP)
    assert np.sqrt(np.mean((found[:, 3] - rubs) ** 2)) < 0.15 * levels[0]
