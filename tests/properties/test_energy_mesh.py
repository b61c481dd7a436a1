"""No gear creates power: searched by hypothesis over every sign, efficiency and self-locking.

At every instant that needs eta_b <= 1. A value between 1 and 1/eta_f, which a transmission accepts
as an apparent efficiency seen through a wrong torque constant, only keeps the sum over a cycle.
"""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from wbc.transmission import mesh_input, mesh_input_interval, mesh_output

torques = st.floats(-1e3, 1e3)
speeds = st.floats(-1e3, 1e3)


@st.composite
def efficiencies(draw: st.DrawFn, lowest_backward: float = -20.0) -> tuple[float, float]:
    forward = draw(st.floats(0.05, 1.0))
    return forward, draw(st.floats(lowest_backward, 1.0))


@settings(deadline=None, max_examples=300)
@given(torques, speeds, efficiencies())
def test_the_loss_for_a_wanted_output_is_never_negative(
    torque: float, speed: float, etas: tuple[float, float]
) -> None:
    given_torque = float(mesh_input(torque, speed, *etas))
    assert (given_torque - torque) * speed >= -1e-9 * abs(torque * speed)


@settings(deadline=None, max_examples=300)
@given(torques, speeds, efficiencies(lowest_backward=0.01))
def test_the_loss_for_a_given_input_is_never_negative_and_inverts(
    torque: float, speed: float, etas: tuple[float, float]
) -> None:
    output = float(mesh_output(torque, speed, *etas))
    assert (torque - output) * speed >= -1e-9 * abs(output * speed)
    if speed != 0.0:
        np.testing.assert_allclose(mesh_input(output, speed, *etas), torque, rtol=1e-9, atol=1e-300)


@settings(deadline=None, max_examples=300)
@given(torques, efficiencies(), st.floats(0.0, 1.0), speeds)
def test_whatever_is_chosen_at_rest_starting_to_move_loses_power(
    torque: float, etas: tuple[float, float], share: float, speed: float
) -> None:
    low, high = mesh_input_interval(torque, *etas)
    assert low <= high
    chosen = float((1.0 - share) * low + share * high)
    rounding = 1e-9 * max(abs(low), abs(high))
    # Only a torque outside the interval can set the gear in motion, and it then pays the branch.
    needed = float(mesh_input(torque, speed, *etas))
    if speed > 0.0:
        assert needed >= chosen - rounding
    elif speed < 0.0:
        assert needed <= chosen + rounding
