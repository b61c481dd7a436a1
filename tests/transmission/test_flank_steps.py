"""One time step through the law of a gear's flanks."""

from __future__ import annotations

import numpy as np
import pytest

from wbc.transmission.flank_steps import flank_impulse


@pytest.mark.parametrize(("late", "late_damping"), [(0.5, 1.0), (0.5, 0.5), (0.7, 0.7), (1.0, 1.0)])
def test_what_a_flank_passes_never_falls_and_never_jumps(late: float, late_damping: float) -> None:
    """With the speed at the end. Where a step left one flank for the other, damping made it jump:
    no end of the step met the law, and a spring that was left loaded got its energy from nowhere.
    """
    rng = np.random.default_rng(0)
    for _ in range(100):
        damping = rng.choice([0.0, 10.0 ** rng.uniform(-2.0, 1.5)])
        half, step = 10.0 ** rng.uniform(-4.0, -1.0), 10.0 ** rng.uniform(-4.0, -1.5)
        law = 10.0 ** rng.uniform(1.0, 4.0), damping, half, step, late, late_damping
        at = 2.0 * half * rng.normal(), 3.0 * rng.normal()
        end = np.linspace(-10.0, 10.0, 401)
        passed, slope, _, damped = np.array([flank_impulse(*law, *at, v) for v in end]).T
        most = np.abs(passed).max()
        assert np.diff(passed).min() >= -1e-12 * most
        # Where the law is smooth its slope is the change; kinks and jumps are few.
        change = 0.5 * (np.diff(passed)[1:] + np.diff(passed)[:-1]) / (end[1] - end[0])
        assert np.median(np.abs(change - slope[1:-1])) <= 1e-4 * slope.max() + 1e-15
        # A jump would be the same however near its two sides are.
        worst = int(np.argmax(np.diff(passed)))
        for _ in range(40):
            middle = 0.5 * (end[worst] + end[worst + 1])
            near = [flank_impulse(*law, *at, v)[0] for v in (end[worst], middle, end[worst + 1])]
            later = near[2] - near[1] > near[1] - near[0]
            end[worst + (0 if later else 1)] = middle
        assert max(np.diff(near)) <= 1e-6 * most + 1e-18
        if late == 0.5:  # The spring gives back what it stores.
            way = 0.5 * step * (at[1] + np.linspace(-10.0, 10.0, 401))
            bent = np.maximum(np.abs([at[0] + way, at[0] + 0.0 * way]) - half, 0.0)
            stored = 0.5 * law[0] * (bent[0] ** 2 - bent[1] ** 2)
            assert np.abs((passed - damped) * way / step - stored).max() <= 1e-9 * (
                np.abs(stored).max() + 1e-15
            )
