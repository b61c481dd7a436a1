"""Links behind gears that yield: many starts, windows, energy, and what is not followed.

That they move as the plant does is asked in tests/recover.
"""

import numpy as np
import pytest

from wbc.links import DrivenLinks
from wbc.transmission import Flanks

STEP = 0.002
ONE = np.zeros(1, dtype=np.int64)  # window
TIME = np.arange(800) * STEP
INERTIA = np.array([[0.5, 0.15], [0.15, 0.1]])
DRAG, PULL = np.array([[0.05, 0.01], [0.02, 0.03]]), np.array([[3.0, 0.4], [0.4, 0.8]])
SOFT, LOOSE = Flanks(600.0, 2.0), Flanks(3000.0, 8.0, 0.015)


def _links(time: np.ndarray = TIME) -> DrivenLinks:
    """Return two coupled links with dry friction under loads that change."""
    every, level = np.ones((time.size, 1, 1)), np.tile([0.3, 0.1], (time.size, 1))
    load = np.stack([6.0 * np.sin(9.0 * time), 2.0 * np.cos(7.0 * time)], axis=-1)
    speed = np.stack([np.cos(5.0 * time), np.sin(4.0 * time)], axis=-1)
    link = INERTIA * every, DRAG * every, PULL * every
    return DrivenLinks(*link, load, speed, level, np.zeros_like(level), STEP)


def test_many_starts_are_followed_as_each_alone() -> None:
    links, gears = _links(), (SOFT, LOOSE)
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
    links, gears = _links(), (SOFT, LOOSE)
    starts = 0.01 * np.random.default_rng(0).standard_normal((2, 2, 2, 1))
    whole = links.follow(gears, np.array([0, 400]), starts)
    before = links.follow(gears, ONE, starts[:1])
    np.testing.assert_array_equal(whole.d[:400], before.d[:400])
    np.testing.assert_array_equal(whole.ends[0, 0], before.d[400])
    np.testing.assert_array_equal(whole.ends[0, 1], before.v[400])
    behind = _links(TIME[400:]).follow(gears, ONE, starts[1:])
    np.testing.assert_allclose(whole.d[400:], behind.d, rtol=0.0, atol=1e-9)
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
