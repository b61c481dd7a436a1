"""Links behind soft and loose gears, against an ODE solver that shares nothing with them."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from wbc.effects import JointCompliance
from wbc.identification.choice.gears import best_gears
from wbc.links import LinkResponse, deflections
from wbc.transmission import Flanks

STEP = 0.004
TIME = np.arange(1000) * STEP
LOOSE = Flanks(800.0, 6.0, 0.02)
LOAD = 2.0 * np.sin(2 * np.pi * 0.8 * TIME) + 0.3
INERTIA, DRAG, PULL = 0.12, 0.05, 0.7


@cache
def _truth(contact: Flanks, start: tuple[float, float]) -> np.ndarray:
    """Return deflection, rate and second derivative (N, 3), by an adaptive solver."""

    def rate(time: float, state: np.ndarray) -> list[float]:
        d, v = state
        stretch = d - np.clip(d, -0.5 * contact.play, 0.5 * contact.play)
        held = contact.stiffness * stretch + (contact.damping * v if stretch != 0.0 else 0.0)
        return [v, -(np.interp(time, TIME, LOAD) + DRAG * v + PULL * d + held) / INERTIA]

    exact = {"max_step": STEP, "rtol": 1e-9, "atol": 1e-9}  # the load bends at samples
    path = solve_ivp(rate, (0.0, float(TIME[-1])), start, t_eval=TIME, **exact).y
    second = [rate(t, state)[1] for t, state in zip(TIME, path.T, strict=True)]
    return np.column_stack([*path, second])


def _response(truth: np.ndarray, inertia: float = INERTIA) -> LinkResponse:
    """Return a log whose unexplained torque is that of the true deflection."""
    d, v, a = truth.T
    torque = INERTIA * a + DRAG * v + PULL * d
    one = np.ones((TIME.size, 1))
    link = {"inertia": inertia * one, "damping": DRAG * one, "stiffness": PULL * one}
    seen = {"unexplained": torque, "band": lambda values: values, "rows": np.arange(len(TIME))}
    return LinkResponse(step=STEP, row=0, load=LOAD[:, None], **link, **seen)


def test_a_swing_that_dies_before_the_log_is_judged_began_as_small_as_the_load_winds_up() -> None:
    spring = (600.0, 15.0)
    truth = _truth(Flanks(*spring, 0.0), (0.0, 0.0))
    whole = _response(truth)
    noise = 0.01 * np.random.default_rng(0).standard_normal(TIME.size)
    judged = (TIME > 0.24).astype(float)  # fifteen time constants of the swing
    seen = replace(
        whole,
        unexplained=whole.unexplained + noise,
        band=lambda values: values * judged.reshape(-1, *(1,) * (np.ndim(values) - 1)),
    )
    found = deflections([seen], [Flanks(*spring)]).paths[0]
    assert np.abs(found[:, 0]).max() < 2.0 * np.abs(LOAD).max() / spring[0]
    assert found[judged > 0.0, 0] == pytest.approx(truth[judged > 0.0, 0], abs=1e-5)


@pytest.mark.parametrize("straight", [False, True])
@pytest.mark.parametrize("way", [1, -1])
def test_a_motion_is_followed_from_one_without_play_and_back(way: int, straight: bool) -> None:
    """Behind play a log is cut into windows, behind a spring it is one: a fit passes both."""
    here, there = (LOOSE, Flanks(400.0, 1.0))[::way]
    truth = _truth(there, (0.01, 0.0))
    near = deflections([_response(truth)], [here])
    found = deflections([_response(truth)], [there], near, straight=straight)
    assert found.finite
    assert found.paths[0].shape == near.paths[0].shape


def test_nothing_swings_behind_a_gear_that_moves_a_point_on_its_own_axis() -> None:
    response = _response(_truth(Flanks(300.0, 0.5, 0.0), (0.01, 0.0)), inertia=0.0)
    for play in (False, True):
        assert best_gears(response, has_play=play, count=1) == []


def test_no_spring_is_offered_that_a_gear_cannot_state() -> None:
    """A wrist of 2 g m^2 that swings at 2 Hz: the diagnosis of a recorded arm ended in an error."""
    response = _response(_truth(Flanks(300.0, 0.5, 0.0), (0.01, 0.0)), inertia=0.002)
    response = replace(response, load=0.01 * response.load)
    found = best_gears(response, has_play=False, count=300)
    assert found
    for _, flanks in found:
        assert JointCompliance.having("wrist", flanks).stiffness == flanks.stiffness
