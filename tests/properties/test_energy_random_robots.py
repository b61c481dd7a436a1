"""Hypothesis looks for a robot that makes energy: random trees, bases, gears, points in contact."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tests.sim.random_robots import BASES, random_robot
from wbc import Robot
from wbc.errors import RobotError
from wbc.sim import EnergyAudit, EnergyFlow, Plane, Plant, SimState
from wbc.transmission import Transmission


def _drop(robot: Robot, base: str, restitution: float, rng: np.random.Generator):
    """Return plant and state of a robot just above the ground, or on it."""
    plant = Plant(robot, restitution=restitution)
    q = pin.integrate(robot.model, robot.neutral(), rng.uniform(-1.0, 1.0, robot.model.nv))
    above = rng.choice([0.0, rng.uniform(0.0, 0.03)])
    lowest = plant.gaps(plant.state(q)).min()
    if base == "fixed":
        plant = Plant(robot, Plane(height=lowest - 10.0), restitution)
    else:
        q[1 if base == "planar" else 2] -= lowest - above
    return plant, plant.state(q, rng.normal(size=robot.model.nv))


def _audit(plant: Plant, state: SimState, torque: np.ndarray, dt: float, duration: float):
    flow, least, start = EnergyFlow(), 0.0, plant.mechanical_energy(state)
    for _ in range(round(duration / dt)):
        result = plant.step(state, torque * np.cos(30.0 * state.time), dt)
        state, flow = result.state, flow + result.energy
        least = min(least, *result.energy.losses.values())
        for impact in result.impacts:
            assert impact.restitution <= plant.restitution
    audit = EnergyAudit(flow, plant.mechanical_energy(state) - start)
    traffic = flow.lost + abs(flow.work) + abs(audit.stored) + 1.0
    return audit.residual / traffic, least / traffic


@settings(max_examples=40, deadline=None, derandomize=True)
@given(
    seed=st.integers(0, 2**32 - 1),
    base=st.sampled_from(BASES),
    eta_f=st.floats(0.5, 1.0),
    eta_b=st.floats(0.02, 1.0),
    friction=st.floats(0.0, 1.5),
    restitution=st.sampled_from([0.0, 0.0, 0.4, 0.9]),
    coupled=st.booleans(),
    strength=st.floats(0.0, 20.0),
)
@example(206, "planar", 1.0, 1.0, 0.0, 0.0, True, 0.0)  # coupled rotors in an impact
def test_no_random_robot_makes_energy(
    seed, base, eta_f, eta_b, friction, restitution, coupled, strength
) -> None:
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, base, eta_f, eta_b, friction, coupled)
    plant, state = _drop(robot, base, restitution, rng)
    torque = strength * rng.uniform(-1.0, 1.0, robot.transmission.size)
    torque /= np.abs(robot.transmission.gear_ratio)
    coarse, least = _audit(plant, state, torque, 1e-3, 0.03)
    fine, fine_least = _audit(plant, state, torque, 2.5e-4, 0.03)
    assert min(least, fine_least) >= -1e-9
    assert abs(coarse) < 0.03
    assert abs(fine) < 0.4 * abs(coarse) + 2e-3


def test_joints_out_of_depth_first_order_are_refused() -> None:
    # pinocchio fills the inertia matrix subtree by subtree; it would be wrong without a word.
    model, turning = pin.Model(), pin.JointModelRY()
    place = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.3]))
    left = model.addJoint(0, turning, place, "left")
    model.addJoint(0, turning, place, "right")
    model.addJoint(left, turning, place, "left_again")
    gears = Transmission(("left",), np.array([10.0]), np.array([1e-5]))
    with pytest.raises(RobotError, match="depth-first"):
        Robot("mixed", model, gears)
