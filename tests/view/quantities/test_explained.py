"""Curves of what the effects explain: where the axis decides, and only there."""

from __future__ import annotations

import numpy as np

from wbc.view.residuals import explained_curves


def test_dry_friction_is_one_curve_over_speed_and_none_over_position() -> None:
    rng = np.random.default_rng(2)
    speed, position = rng.uniform(-2.0, 2.0, 2000), rng.uniform(-1.0, 1.0, 2000)
    friction = 0.5 * np.sign(speed)
    ((center, mean),) = explained_curves(speed, friction, speed)
    clear = np.abs(center) > 0.2
    np.testing.assert_allclose(mean[clear], 0.5 * np.sign(center[clear]))
    # Over the position each direction of motion is a constant, which the position does not decide.
    assert explained_curves(position, friction, speed) == ()
    noise = rng.standard_normal(2000)
    assert explained_curves(position, noise, speed) == ()


def test_a_lossy_gear_has_a_branch_over_the_load_for_each_direction() -> None:
    rng = np.random.default_rng(3)
    speed, load = rng.uniform(-2.0, 2.0, 3000), rng.uniform(-5.0, 8.0, 3000)
    loss = 0.2 * np.abs(load) * np.sign(speed)
    forth, back = explained_curves(load, loss, speed)
    np.testing.assert_allclose(forth[1], 0.2 * np.abs(forth[0]), atol=0.04)
    np.testing.assert_allclose(back[1], -0.2 * np.abs(back[0]), atol=0.04)
