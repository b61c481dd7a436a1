"""The time step against Dymola's LossyGear demos."""

from __future__ import annotations

import numpy as np
import pytest

from tests.reference.lossygear import demo, reference
from wbc.sim import Plant


def _stepped(number: int, step: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    case = demo(number)
    plant = Plant(case.robot)
    state = plant.state([0.0], [case.speed])
    rows = [(0.0, 0.0, case.speed)]
    end = 1.0 if number == 3 else 0.5
    for i in range(round(end / step)):
        middle = (i + 0.5) * step
        state = plant.step(state, case.rotor_torque(middle), step, case.external(middle)).state
        rows.append(((i + 1) * step, float(state.position[0]), float(state.velocity[0])))
    time, phi, speed = np.array(rows).T
    return time, phi, speed


@pytest.mark.parametrize("number", [1, 2, 3])
def test_time_stepping_reaches_dymola(number: int) -> None:
    truth = reference(number)
    time, phi, speed = _stepped(number, 1e-4)
    rows = np.round(truth[:, 0] / 1e-4, 6) % 1.0 == 0.0  # event rows lie between the steps
    assert rows.sum() > 900
    at = np.round(truth[rows, 0] / 1e-4).astype(int)
    assert np.abs(time[at] - truth[rows, 0]).max() < 1e-9
    assert np.abs(speed[at] - truth[rows, 2]).max() <= 2e-5
    assert np.abs(phi[at] - truth[rows, 1]).max() <= 1e-7


@pytest.mark.parametrize("number", [1, 2])
def test_time_stepping_converges(number: int) -> None:
    truth = reference(number)
    grid = np.round(truth[:, 0] / 5e-4, 6) % 1.0 == 0.0
    errors = []
    for step in (5e-4, 1.25e-4):
        _, _, speed = _stepped(number, step)
        at = np.round(truth[grid, 0] / step).astype(int)
        errors.append(np.abs(speed[at] - truth[grid, 2]).max())
    assert errors[1] < 0.3 * errors[0]  # a quarter at first order
