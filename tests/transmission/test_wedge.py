"""The wedge and the compound planetary gear against balances of forces and powers."""

from __future__ import annotations

import numpy as np
import pytest

from wbc.errors import TransmissionError
from wbc.transmission import CompoundPlanetaryGear, Direction, WedgeBlock, wedge_backward_efficiency


def force_balance(wedge: WedgeBlock, f_x: float, f_u: float, u_dot: float) -> tuple[float, float]:
    """Solve H_s s_ddot - A' lambda = f + f_d, A s_ddot = 0 for (x_ddot, lambda).

    The friction is -mu sin(alpha) |lambda| sgn(u_dot); both signs of lambda are tried and the
    consistent one is returned.
    """
    cosine, found = np.cos(wedge.slope), []
    for sign in (1.0, -1.0):
        drag = -wedge.friction * np.sin(wedge.slope) * sign * np.sign(u_dot)
        system = np.array(
            [
                [wedge.block_mass, 0.0, 1.0],
                [0.0, wedge.wedge_mass, -cosine - drag],
                [-1.0, cosine, 0.0],
            ]
        )
        x_ddot, _, force = np.linalg.solve(system, [f_x, f_u, 0.0])
        if force * sign >= 0.0:
            found.append((float(x_ddot), float(force)))
    assert len(found) == 1
    return found[0]


CASES = [(3.0, 0.4, 0.5, 0.3), (1.0, 2.0, 1.1, 0.2), (0.5, 0.5, 0.9, 0.6)]


@pytest.mark.parametrize("numbers", CASES)
@pytest.mark.parametrize(
    ("f_x", "f_u", "mode"), [(0.0, 5.0, Direction.FORWARD), (5.0, 0.0, Direction.BACKWARD)]
)
def test_acceleration_and_efficiency_follow_from_the_force_balance(
    numbers: tuple[float, float, float, float], f_x: float, f_u: float, mode: Direction
) -> None:
    wedge = WedgeBlock(*numbers)
    u_dot = 1.0
    x_ddot, force = force_balance(wedge, f_x, f_u, u_dot)
    assert wedge.acceleration(mode, f_x, f_u) == pytest.approx(x_ddot)
    on_block, on_wedge = wedge.mesh_force(force, u_dot)
    power = np.array([on_block * np.cos(wedge.slope) * u_dot, on_wedge * u_dot])
    if mode is Direction.FORWARD:
        assert power[0] / -power[1] == pytest.approx(wedge.forward_efficiency)
    else:
        assert power[1] / -power[0] == pytest.approx(wedge.backward_efficiency)
    assert power.sum() < 0.0


@pytest.mark.parametrize("numbers", CASES)
def test_impedance_is_the_driving_force_over_the_acceleration(
    numbers: tuple[float, float, float, float],
) -> None:
    wedge = WedgeBlock(*numbers)
    forward, _ = force_balance(wedge, 0.0, 2.0 * np.cos(wedge.slope), 1.0)
    assert wedge.impedance_mass(Direction.FORWARD) == pytest.approx(2.0 / forward)
    backward, _ = force_balance(wedge, 2.0, 0.0, 1.0)
    assert wedge.impedance_mass(Direction.BACKWARD) == pytest.approx(2.0 / backward)


def test_at_k_one_the_wedge_locks_itself() -> None:
    wedge = WedgeBlock(1.0, 1.0, np.pi / 4, 1.0)
    assert wedge.backward_efficiency == pytest.approx(0.0, abs=1e-12)
    assert wedge.forward_efficiency == pytest.approx(0.5)
    for mode in (Direction.BACKWARD, Direction.STUCK):
        with pytest.raises(TransmissionError, match="does not move"):
            WedgeBlock(1.0, 1.0, 1.0, 1.0).acceleration(mode, 1.0, 0.0)


@pytest.mark.parametrize(
    "numbers",
    [
        (1.0, 1.0, np.pi / 2, 0.1),
        (1.0, 1.0, -0.1, 0.1),
        (-1.0, 1.0, 0.1, 0.1),
        (1.0, np.nan, 0.1, 0.1),
        (1.0, 1.0, 0.1, -0.1),
    ],
)
def test_ranges(numbers: tuple[float, float, float, float]) -> None:
    with pytest.raises(TransmissionError):
        WedgeBlock(*numbers)


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
