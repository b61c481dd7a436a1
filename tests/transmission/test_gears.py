"""Gears: their numbers, the mesh law, and wedge and planetary gear against balances."""

from typing import Any

import numpy as np
import pytest

from wbc.errors import TransmissionError
from wbc.transmission import (
    CompoundPlanetaryGear,
    Direction,
    Transmission,
    WedgeBlock,
    mesh_input,
    wedge_backward_efficiency,
)

PARALLELOGRAM = np.array([[1.0, 0.0], [-1.0, 1.0]])


def gears(**changes: Any) -> Transmission:
    values: dict[str, Any] = {"gear_ratio": [20.0, 10.0], "rotor_inertia": [1e-4, 2e-4]}
    values |= {"joints": ("hip", "knee"), "forward_efficiency": [0.8, 0.7]}
    return Transmission(**values | changes)


def test_the_backward_efficiency_follows_the_wedge_unless_given() -> None:
    np.testing.assert_allclose(gears().backward_efficiency, [0.75, 2 - 1 / 0.7])
    given = gears(backward_efficiency=[0.9, -0.2])
    np.testing.assert_array_equal(given.self_locking, [False, True])


def test_maps_of_a_parallelogram() -> None:
    legs, rotor_speed = gears(topology=PARALLELOGRAM), np.array([40.0, 30.0])
    joint_speed = legs.topology @ legs.reduction @ rotor_speed
    # The shin's absolute angle follows the second motor: q_hip + q_knee = psi_2.
    np.testing.assert_allclose(joint_speed, [2.0, 1.0])
    np.testing.assert_allclose(legs.motor_from_joint @ joint_speed, rotor_speed / [20.0, 10.0])
    torque = np.array([0.3, -0.7])
    # Duality: the same power on either side of perfect gears.
    assert joint_speed @ (legs.distribution @ torque) == pytest.approx(rotor_speed @ torque)
    np.testing.assert_allclose(legs.distribution, np.linalg.inv(PARALLELOGRAM @ legs.reduction).T)
    np.testing.assert_allclose(legs.reflected_inertia, [0.04, 0.02])


FRICTION = ("rotor_coulomb_friction", "rotor_viscous_friction")
NOT_NEGATIVE = ("rotor_inertia", *FRICTION, "damping", "backlash")


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("forward_efficiency", [0.8, 0.0], "forward_efficiency of joint 'knee' is 0"),
        ("forward_efficiency", [1.2, 0.5], "'hip' is 1.2; it must be <= 1"),
        ("forward_efficiency", [np.nan, 0.5], "finite"),
        ("backward_efficiency", [1.3, 0.5], "would create power"),
        # Less than 1/eta_f, and still more out than in while the joint drives.
        ("backward_efficiency", [1.1, 0.5], "'hip' is 1.1; it must be at most 1"),
        ("gear_ratio", [0.0, 1.0], "other than 0"),
        ("gear_ratio", [np.nan, 1.0], "finite"),
        ("gear_ratio", [1.0], r"shape \(1,\), expected \(2\)"),
        *[(field, [-1.0, 0.1], ">= 0") for field in NOT_NEGATIVE],
        *[(field, [0.0, 1.0], "> 0") for field in ("torque_limit", "speed_limit", "stiffness")],
        ("torque_limit", [np.nan, 1.0], "> 0"),
        ("torque_constant", [0.0, 1.0], "NaN where unknown"),
        ("resistance", [-1.0, 1.0], "NaN where unknown"),
        ("topology", [[1.0, 1.0], [1.0, 1.0]], "singular"),
        ("topology", [[1.0]], "topology D has shape"),
        ("joints", ("hip", "hip"), "driven twice"),
        ("housings", ("base",), "1 housings for 2 motors"),
    ],
)
def test_numbers_outside_their_range_are_named(field: str, value: Any, message: str) -> None:
    with pytest.raises(TransmissionError, match=message):
        gears(**{field: value})


def test_arrays_are_read_only_and_unshared() -> None:
    ratio = np.array([20.0, 10.0])
    legs = gears(gear_ratio=ratio)
    ratio[0] = 1.0
    assert legs.gear_ratio[0] == 20.0
    for array in (legs.gear_ratio, legs.distribution, legs.motor_from_joint, legs.reduction):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0


def test_a_changed_copy_leaves_the_original_and_forgets_its_derived_matrices() -> None:
    legs = gears()
    assert legs.distribution[0, 0] == 20.0
    changed = legs.with_values("hip", {"gear_ratio": 30.0})
    assert changed.distribution[0, 0] == 30.0
    assert legs.distribution[0, 0] == 20.0
    with pytest.raises(TransmissionError, match="Did you mean 'knee'"):
        legs.with_values("kne", {"gear_ratio": 1.0})


ETA_F, ETA_B = 0.8, 0.6


@pytest.mark.parametrize("torque", [3.0, -3.0, 0.0])
def test_power_out_is_efficiency_times_power_in_and_at_rest_between(torque: float) -> None:
    moving = [float(mesh_input(torque, speed, ETA_F, ETA_B)) for speed in (2.0, -2.0)]
    # t = T / eta_f where the motor drives, eta_b T where the joint does.
    ends = torque / ETA_F, torque * ETA_B
    np.testing.assert_allclose(moving, [max(ends), min(ends)])
    assert mesh_input(torque, 0.0, ETA_F, ETA_B) == pytest.approx(np.mean(moving))


def test_a_self_locking_gear_needs_help_to_be_lowered() -> None:
    # T pulls along the motion, the motor must push the same way: t and v have one sign.
    given = mesh_input(-2.0, 1.0, 0.45, float(wedge_backward_efficiency(0.45)))
    assert given > 0.0


def test_wedge_relation_and_its_range() -> None:
    np.testing.assert_allclose(wedge_backward_efficiency([1.0, 0.8, 0.7, 0.5]), [1, 0.75, 4 / 7, 0])
    for wrong in (0.0, -0.1, 1.01, np.nan):
        with pytest.raises(TransmissionError, match=r"\(0, 1\]"):
            wedge_backward_efficiency(wrong)


def force_balance(wedge: WedgeBlock, f_x: float, f_u: float, u_dot: float) -> tuple[float, float]:
    """Solve H_s s_ddot - A' lambda = f + f_d, A s_ddot = 0 for (x_ddot, lambda).

    The friction is -mu sin(alpha) |lambda| sgn(u_dot); both signs of lambda are tried and the
    consistent one is returned.
    """
    cosine, found = np.cos(wedge.slope), []
    for sign in (1.0, -1.0):
        drag = -wedge.friction * np.sin(wedge.slope) * sign * np.sign(u_dot)
        rows = [[wedge.block_mass, 0.0, 1.0], [0.0, wedge.wedge_mass, -cosine - drag]]
        system = np.array([*rows, [-1.0, cosine, 0.0]])
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
def test_mass_and_efficiency_follow_from_the_force_balance(
    numbers: tuple[float, float, float, float], f_x: float, f_u: float, mode: Direction
) -> None:
    wedge = WedgeBlock(*numbers)
    x_ddot, force = force_balance(wedge, f_x, f_u, 1.0)
    driving = f_x + f_u / np.cos(wedge.slope)
    assert wedge.impedance_mass(mode) == pytest.approx(driving / x_ddot)
    on_block, on_wedge = wedge.mesh_force(force, 1.0)
    power = np.array([on_block * np.cos(wedge.slope), on_wedge])
    out, given, efficiency = (*power, wedge.forward_efficiency)
    if mode is Direction.BACKWARD:
        out, given, efficiency = (*power[::-1], wedge.backward_efficiency)
    assert out / -given == pytest.approx(efficiency)
    assert power.sum() < 0.0


def test_at_k_one_the_wedge_locks_itself() -> None:
    wedge = WedgeBlock(1.0, 1.0, np.pi / 4, 1.0)
    assert (wedge.backward_efficiency, wedge.forward_efficiency) == pytest.approx((0.0, 0.5))
    for wrong in ((1, 1, np.pi / 2, 0.1), (1, 1, -0.1, 0.1), (-1, 1, 0.1, 0.1), (1, 1, 0.1, -0.1)):
        with pytest.raises(TransmissionError):
            WedgeBlock(*wrong)
    for mode in (Direction.BACKWARD, Direction.STUCK):
        with pytest.raises(TransmissionError, match="does not move"):
            WedgeBlock(1.0, 1.0, 1.0, 1.0).impedance_mass(mode)


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
    # The paper's 0.499 is that of a reduction of 100 with i1 = 1.4, among others.
    gear = CompoundPlanetaryGear.of_reduction(100.0, 1.4)
    assert gear.forward_efficiency(gear.ring_ratio) == pytest.approx(0.499, abs=5e-4)
