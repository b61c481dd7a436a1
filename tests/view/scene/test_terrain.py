"""Drawn ground lies where the simulator's ground lies."""

from __future__ import annotations

import numpy as np
import pytest

from wbc.sim.ground import Plane, Stairs, Terrain
from wbc.view.ground import surface_under, terrain_slabs


@pytest.mark.parametrize(
    "terrain",
    [
        Plane(),
        Plane(height=0.3),
        Plane.slope(0.25, 0.1),
        Plane(np.array([0.1, -0.2, 1.0]), -0.2),
        Stairs(np.array([-5.0, 0.1, 0.4]), np.array([9.0, 0.0, 0.1, 0.25])),
    ],
)
def test_points_on_the_drawn_surface_touch_the_ground(terrain: Terrain) -> None:
    center = np.array([0.2, 0.1, 0.6])
    slabs = terrain_slabs(terrain, center, 2.0)
    rng = np.random.default_rng(0)
    for x, y in center[:2] + rng.uniform(-0.8, 0.8, (40, 2)):
        height, normal = surface_under(slabs, np.array([x, y, 1.0]))
        gap, truth = terrain.gap(np.array([[x, y, height + 1e-9]]))
        assert gap[0] == pytest.approx(0.0, abs=1e-8)
        np.testing.assert_allclose(normal, truth[0], atol=1e-12)
