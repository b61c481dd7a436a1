"""The compound planetary gear against the torques and powers of its three meshes."""

from __future__ import annotations

import numpy as np
import pytest

from wbc.transmission import CompoundPlanetaryGear, wedge_backward_efficiency

GEAR = CompoundPlanetaryGear.of_reduction(100.0, 4.0)


def balance(gear: CompoundPlanetaryGear, e: float, forward: bool) -> float:
    """Return the efficiency from the torques on sun, fixed ring and output ring, solved for.

    Unknowns: torques of the surroundings on the three gears. Moments add to zero (the carrier is
    free), the input torque is 1, and in the carrier's frame the powers that leave the planet are e
    times those that enter.
    """
    sun = 1.0
    carrier = sun / (1.0 + gear.sun_ratio)
    ring = carrier * (1.0 - gear.ring_ratio)
    relative = np.array([sun, 0.0, ring]) - carrier
    # Forward: sun and output ring bring power to the planet, the fixed ring takes it.
    enters = np.array([True, False, True]) if forward else np.array([False, True, False])
    share = np.where(enters, e, 1.0)
    turns = relative if forward else -relative  # the whole gear turns the other way round
    rows = np.array([np.ones(3), share * turns, [1.0, 0.0, 0.0] if forward else [0.0, 0.0, 1.0]])
    torque = np.linalg.solve(rows, [0.0, 0.0, 1.0])
    speed = np.array([sun, 0.0, ring])
    power_in, power_out = (torque * speed)[[0, 2] if forward else [2, 0]]
    return float(-power_out / power_in)


@pytest.mark.parametrize("e", [0.999, 0.99, 0.97, 0.96])
def test_the_efficiencies_are_those_of_the_balance(e: float) -> None:
    assert GEAR.reduction == pytest.approx(100.0)
    assert GEAR.forward_efficiency(e) == pytest.approx(balance(GEAR, e, True))
    assert GEAR.backward_efficiency(e) == pytest.approx(balance(GEAR, e, False))


def test_it_locks_itself_near_one_half_as_the_paper_states() -> None:
    for ratio in (50.0, 100.0, 300.0):
        gear = CompoundPlanetaryGear.of_reduction(ratio, 1.4)
        assert gear.backward_efficiency(gear.ring_ratio) == pytest.approx(0.0, abs=1e-12)
        assert gear.forward_efficiency(gear.ring_ratio) == pytest.approx(gear.locking_efficiency)
    # The paper's 0.499 is that of a reduction of 100 with i1 = 1.4, among others.
    gear = CompoundPlanetaryGear.of_reduction(100.0, 1.4)
    assert gear.locking_efficiency == pytest.approx(0.499, abs=5e-4)


def test_a_high_reduction_is_a_wedge() -> None:
    gear = CompoundPlanetaryGear.of_reduction(1e6, 3.0)
    e = 1.0 - (1.0 - gear.ring_ratio) * np.linspace(0.0, 0.95, 20)
    forward = gear.forward_efficiency(e)
    wedge = wedge_backward_efficiency(forward)
    np.testing.assert_allclose(gear.backward_efficiency(e), wedge, atol=1e-5)
