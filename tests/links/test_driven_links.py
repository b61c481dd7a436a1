"""Links behind gears that yield, against an ODE solver and the plant."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from wbc.links import DrivenLinks
from wbc.transmission import Flanks

STEP = 0.002
ONE = np.zeros(1, dtype=np.int64)  # window
TIME = np.arange(800) * STEP
INERTIA = np.array([[0.5, 0.15], [0.15, 0.1]])
DRAG, PULL = np.array([[0.05, 0.01], [0.02, 0.03]]), np.array([[3.0, 0.4], [0.4, 0.8]])
SOFT, LOOSE = Flanks(600.0, 2.0), Flanks(3000.0, 8.0, 0.015)
STEEP = 2e-5  # [rad/s] of the solver's friction


def _load(time: np.ndarray | float) -> np.ndarray:
    return np.stack([6.0 * np.sin(9.0 * np.asarray(time)), 2.0 * np.cos(7.0 * time)], axis=-1)


def _speed(time: np.ndarray | float) -> np.ndarray:
    return np.stack([np.cos(5.0 * np.asarray(time)), np.sin(4.0 * np.asarray(time))], axis=-1)


def _push(gear: Flanks, d: float, v: float) -> float:
    """Return the torque on a link, written out once more."""
    if gear.play == 0.0:
        return -gear.stiffness * d - gear.damping * v
    if d > 0.5 * gear.play:
        return min(0.0, -gear.stiffness * (d - 0.5 * gear.play) - gear.damping * v)
    if d < -0.5 * gear.play:
        return max(0.0, -gear.stiffness * (d + 0.5 * gear.play) - gear.damping * v)
    return 0.0


def _truth(gears: tuple[Flanks, ...], level: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Return deflections (N, 2)."""
    inverse = np.linalg.inv(INERTIA)

    def rate(time: float, state: np.ndarray) -> np.ndarray:
        d, v = state[:2], state[2:]
        push = [_push(*gear) for gear in zip(gears, d, v, strict=True)]
        rubs = level * np.tanh((_speed(time) + v) / STEEP)
        return np.concatenate([v, inverse @ (push - _load(time) - DRAG @ v - PULL @ d - rubs)])

    span = (0.0, float(TIME[-1]))
    path = solve_ivp(rate, span, start, "LSODA", TIME, max_step=1e-3, rtol=1e-8, atol=1e-10).y
    return np.asarray(path[:2].T)


def _links(level: np.ndarray) -> DrivenLinks:
    every = np.ones((TIME.size, 1, 1))
    rough = level * np.ones((TIME.size, 1))
    speed, nothing = _speed(TIME), np.zeros_like(rough)
    return DrivenLinks(
        *(INERTIA * every, DRAG * every, PULL * every, _load(TIME), speed, rough, nothing, STEP)
    )


@pytest.mark.parametrize("level", [(0.0, 0.0), (0.5, 0.2)], ids=["smooth", "dry"])
@pytest.mark.parametrize("gears", [(SOFT, SOFT), (SOFT, LOOSE), (LOOSE, SOFT)])
def test_two_links_move_together_as_an_ode_solver_says(
    gears: tuple[Flanks, Flanks], level: tuple[float, float]
) -> None:
    """Until strikes have made a difference of steps large, the motions are the same."""
    start = np.array([0.004, -0.006, 0.1, -0.2])
    truth = _truth(gears, np.array(level), start)
    d = _links(np.array(level)).follow(gears, ONE, start.reshape(1, 2, 2, 1)).d
    seconds = 1.6 if gears == (SOFT, SOFT) else 0.6
    seen = seconds > TIME
    error = np.abs(d[seen, :, 0] - truth[seen]).max(axis=0)
    assert np.all(error < 0.03 * np.abs(truth[seen]).max(axis=0))


def test_many_starts_are_followed_as_each_alone() -> None:
    links, gears = _links(np.array([0.3, 0.1])), (SOFT, LOOSE)
    starts = 0.01 * np.random.default_rng(0).standard_normal((1, 2, 2, 7))
    together = links.follow(gears, ONE, starts)
    for k in range(7):
        alone = links.follow(gears, ONE, starts[..., k : k + 1])
        for one, other in zip(together, alone, strict=True):
            np.testing.assert_array_equal(one[..., k], other[..., 0])


def test_a_swing_without_losses_keeps_its_energy() -> None:
    one = np.ones((4000, 1, 1))
    nothing = np.zeros((4000, 1))
    links = DrivenLinks(0.1 * one, 0.0 * one, 0.0 * one, *(nothing,) * 4, STEP)
    d, v, *_ = links.follow([Flanks(400.0, 0.0)], ONE, np.array([[[[0.01]], [[0.0]]]]))
    energy = 0.5 * 400.0 * d[:, 0, 0] ** 2 + 0.5 * 0.1 * v[:, 0, 0] ** 2
    assert energy == pytest.approx(0.5 * 400.0 * 0.01**2, rel=1e-9)


def test_every_window_begins_anew() -> None:
    """Each goes as it would by itself, and the log goes on behind it."""
    links, gears = _links(np.array([0.3, 0.1])), (SOFT, LOOSE)
    starts = 0.01 * np.random.default_rng(0).standard_normal((2, 2, 2, 1))
    whole = links.follow(gears, np.array([0, 400]), starts)
    before = links.follow(gears, ONE, starts[:1])
    np.testing.assert_array_equal(whole.d[:400], before.d[:400])
    np.testing.assert_array_equal(whole.ends[0, 0], before.d[400])
    np.testing.assert_array_equal(whole.ends[0, 1], before.v[400])
    np.testing.assert_array_equal(whole.d[400], starts[1, 0])
    np.testing.assert_array_equal(whole.ends[1, 0], whole.d[-1])


def test_a_link_that_falls_off_is_not_followed() -> None:
    one, nothing = np.ones((4000, 1, 1)), np.zeros((4000, 1))
    links = DrivenLinks(0.1 * one, 0.0 * one, -30.0 * one, *(nothing,) * 4, STEP)
    starts = np.array([[[[0.0, 1e-3]], [[0.0, 0.0]]]])
    d, v, *_ = links.follow([Flanks(10.0, 0.1)], ONE, starts)
    np.testing.assert_array_equal(d[:, 0, 0], 0.0)
    assert np.isinf(d[-1, 0, 1])
    assert np.isinf(v[-1, 0, 1])
    assert not np.isnan(d).any()
