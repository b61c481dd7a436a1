"""No gear and no transmission creates power: searched by hypothesis over all their numbers.

At every instant that needs eta_b <= 1. A value between 1 and 1/eta_f would only keep the sum over a
cycle.
"""

import numpy as np
from hypothesis import given, settings, strategies as st
from hypothesis.extra.numpy import arrays

from tests.sim.random_robots import geared
from wbc.arrays import FloatArray
from wbc.dynamics import dissipative_equation, evaluate, link_torque, rotor_torque
from wbc.effects import load_robot
from wbc.robot import Motion, Robot
from wbc.transmission import Transmission, mesh_input


@settings(deadline=None, max_examples=300)
@given(
    st.floats(-1e3, 1e3),
    st.floats(-1e3, 1e3),
    st.tuples(st.floats(0.05, 1.0), st.floats(-20.0, 1.0)),
)
def test_a_gear_loses_power_in_motion_and_where_it_starts_to_move(
    torque: float, speed: float, etas: tuple[float, float]
) -> None:
    needed = float(mesh_input(torque, speed, *etas))
    low, high = sorted((torque / etas[0], torque * etas[1]))
    assert (needed - torque) * speed >= -1e-9 * abs(torque * speed)
    # Only a torque outside the interval at rest sets the gear in motion; it then pays the branch.
    rounding = 1e-9 * max(abs(low), abs(high))
    assert speed <= 0.0 or needed >= high - rounding
    assert speed >= 0.0 or needed <= low + rounding


def numbers(low: float, high: float) -> st.SearchStrategy[float]:
    """Return zero, or numbers of which five in a product stay above the smallest normal number.

    Products that underflow lose digits, and no bound relative to their size holds.
    """
    return st.floats(low, high).filter(lambda x: x == 0.0 or abs(x) >= 1e-60)


LEG = load_robot("planar_leg")
vectors = arrays(np.float64, (3, 5), elements=numbers(-5.0, 5.0))
TOPOLOGIES = ([[1, 0], [0, 1]], [[1, 0], [-1, 1]], [[0.5, -0.5], [0.5, 0.5]], [[0, -2], [1, 0.3]])


@st.composite
def legs(draw: st.DrawFn) -> Robot:
    def pair(low: float, high: float) -> list[float]:
        return [draw(numbers(low, high)), draw(numbers(low, high))]

    signs = draw(st.sampled_from([(1, 1), (-1, 1), (-1, -1)]))
    return LEG.with_transmission(
        Transmission(
            joints=LEG.transmission.joints,
            gear_ratio=np.array(pair(0.5, 160.0)) * signs,
            rotor_inertia=np.array(pair(0.0, 1e-3)),
            topology=np.array(draw(st.sampled_from(TOPOLOGIES)), dtype=float),
            forward_efficiency=np.array(pair(0.2, 1.0)),
            backward_efficiency=np.array(pair(-1.0, 1.0)),
            rotor_coulomb_friction=np.array(pair(0.0, 0.1)),
            rotor_viscous_friction=np.array(pair(0.0, 1e-2)),
        )
    )


def balance(robot: Robot, motion: Motion) -> tuple[float, float]:
    """Return (power given minus power stored, size of the terms)."""
    gears, acceleration = robot.transmission, motion.acceleration
    assert acceleration is not None
    links = link_torque(robot, motion)
    torque, rest = rotor_torque(robot, motion, links)
    spin = gears.gear_ratio * (gears.motor_from_joint @ motion.velocity[0][robot.actuated])
    spin_up = gears.gear_ratio * (gears.motor_from_joint @ acceleration[0][robot.actuated])
    given_power = np.concatenate([torque[0] * spin, rest[0] * motion.velocity[0][:3]])
    stored = np.concatenate([links[0] * motion.velocity[0], gears.rotor_inertia * spin_up * spin])
    size = np.abs(given_power).sum() + np.abs(stored).sum()
    return float(given_power.sum() - stored.sum()), float(size)


@settings(deadline=None, max_examples=90)
@given(legs(), vectors)
def test_inverse_dynamics_never_gains_power(robot: Robot, state: FloatArray) -> None:
    loss, size = balance(robot, Motion(state[:1], state[1:2], state[2:]))
    assert loss >= -1e-9 * size
    free, size = balance(robot.lossless(), Motion(state[:1], state[1:2], state[2:]))
    assert abs(free) <= 1e-9 * size


@settings(deadline=None, max_examples=90)
@given(legs(), vectors, arrays(np.float64, 2, elements=st.floats(-2.0, 2.0)))
def test_consistent_forward_dynamics_never_gains_power(
    robot: Robot, state: FloatArray, torque: FloatArray
) -> None:
    backward = np.maximum(robot.transmission.backward_efficiency, 0.05)
    robot = geared(robot, backward_efficiency=backward)
    gears, (q, v, _) = robot.transmission, state
    terms = evaluate(robot, q, v)
    speed = gears.motor_from_joint @ v[robot.actuated]
    spin = gears.gear_ratio * speed
    for mode in np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]], dtype=float):
        a = dissipative_equation(robot, terms, mode).acceleration(torque, np.zeros(5))
        spin_up = gears.gear_ratio * (gears.motor_from_joint @ a[robot.actuated])
        mesh_power = (torque - gears.rotor_inertia * spin_up) * spin
        if np.any(mesh_power * mode < 0.0):
            continue
        stored = v @ (terms.mass_matrix @ a + terms.bias)
        stored += float(np.sum(gears.rotor_inertia * spin_up * spin))
        size = float(np.abs(torque * spin).sum() + abs(stored)) + 1.0
        assert float(torque @ spin) - stored >= -1e-7 * size
