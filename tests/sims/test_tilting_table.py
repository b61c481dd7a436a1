"""The brick on a tilting table against the equation of a point mass with Coulomb friction."""

from __future__ import annotations

import numpy as np

from sims.tilting_table import FRICTION, HALF, RATE, TILT, figure, main


def _slid(seconds: float, step: float = 1e-4) -> float:
    """Return how far [m] a point at the brick's height slides, in the frame of the table."""
    s, speed, high = 0.0, 0.0, HALF[2]
    for k in range(round(seconds / step)):
        time = k * step
        tilt = 0.5 * TILT * (1.0 - np.cos(RATE * time))
        rate = 0.5 * TILT * RATE * np.sin(RATE * time)
        turn = 0.5 * TILT * RATE**2 * np.cos(RATE * time)
        normal = 9.81 * np.cos(tilt) - 2.0 * speed * rate - s * turn - high * rate**2
        drive = 9.81 * np.sin(tilt) + s * rate**2 - high * turn
        most = FRICTION * normal
        free = speed + step * drive
        speed = free - np.clip(free, -step * most, step * most)
        s += step * speed
    return float(s)


def test_the_brick_slides_as_far_as_a_point_mass() -> None:
    rows = main()
    assert rows[-1, 2] > 0.3
    np.testing.assert_allclose(rows[-1, 2], _slid(rows[-1, 0]), rtol=0.01)
    assert np.abs(rows[:, 3] - HALF[2]).max() < 1e-5
    assert len(figure(rows).axes) == 2
