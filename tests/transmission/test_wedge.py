"""The wedge-block, solved from its force balance with no efficiency anywhere in it."""

from __future__ import annotations

import numpy as np
import pytest

from wbc.errors import TransmissionError
from wbc.transmission import Direction, WedgeBlock


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
