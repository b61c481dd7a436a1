"""Hypothesis looks for a step of a random robot that makes energy."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tests.sim.ground.random_grounds import GROUNDS, drawn_scene, made_by_rows, random_scene
from tests.sim.random_robots import BASES, random_robot
from wbc import Robot
from wbc.errors import RobotError, SimulationError
from wbc.sim import EnergyAudit, EnergyFlow, Plane, Plant, SimState
from wbc.transmission import Transmission


@settings(max_examples=120, deadline=None, derandomize=True)
@given(
    seed=st.integers(0, 2**32 - 1),
    base=st.sampled_from(BASES),
    ground=st.sampled_from(GROUNDS),
    restitution=st.sampled_from([0.0, 0.0, 0.5, 1.0]),
    strength=st.sampled_from([0.0, 0.0, 10.0]),
    decade=st.floats(-5.0, -1.5),
    soft=st.booleans(),
)
def test_no_step_makes_energy_through_its_rows(
    seed, base, ground, restitution, strength, decade, soft
) -> None:
    rng = np.random.default_rng(seed)
    plant, state = random_scene(rng, base, ground, restitution, soft=soft)
    m = plant.robot.transmission.size
    torque = strength * rng.uniform(-1.0, 1.0, m) / np.abs(plant.robot.transmission.gear_ratio)
    for _ in range(4):
        try:
            result = plant.step(state, torque, 10.0**decade)
        except SimulationError as error:
            if "self-locking gears 'j" not in str(error):  # several solutions: refused by name
                raise
            return
        state = result.state
        assert made_by_rows(result) < 1e-9
        assert not [event for event in result.events if event.kind == "energy"]
        assert plant.gaps(state).min() > -1e-3 - 10.0 * 10.0 ** (2 * decade)


@pytest.mark.parametrize(
    ("seed", "ground", "steps"),
    [
        (18, "plane", 1),  # a damped flank let go of jumped: no end met its law
        (28, "stairs", 2),
        (40, "boxes", 1),
        (7, "stairs", 4),  # friction of a rotor that holds on to a rigid flank, counted twice
        (7, "plane", 5),
        (118, "field", 2),  # rounds on a flank went on with the slope of a place far off
    ],
)
def test_soft_gears_that_were_refused_or_made_energy(seed: int, ground: str, steps: int) -> None:
    plant, state, torque, dt = drawn_scene(seed, ground, soft=True)
    for _ in range(steps):
        result = plant.step(state, torque, dt)
        state = result.state
        assert made_by_rows(result) < 1e-9
        assert not [event for event in result.events if event.kind == "energy"]


@pytest.mark.parametrize(("seed", "ground"), [(307, "stairs"), (174, "balls"), (298, "balls")])
def test_a_kept_stop_that_closes_takes_an_impact(seed: int, ground: str) -> None:
    """Its row let it close with speed; the next step carried that on and passed it by 2 cm."""
    plant, state, torque, dt = drawn_scene(seed, ground, soft=True)
    for _ in range(4):
        result = plant.step(state, torque, dt)
        state = result.state
        assert not [event for event in result.events if event.kind == "overlap"]


@pytest.mark.parametrize(
    ("seed", "ground", "soft"), [(385, "boxes", False), (346, "field", False), (102, "plane", True)]
)
def test_an_overlap_is_taken_back_whole(seed: int, ground: str, soft: bool) -> None:
    """Gaps are not linear in the shift: one shift left 0.1 mm of what a coarse step overran.

    A short part after it then could not take that back at the plant's return speed.
    """
    plant, state, torque, dt = drawn_scene(seed, ground, soft=soft)
    for _ in range(5):
        result = plant.step(state, torque, dt)
        state = result.state
        for part in result.parts:
            assert part.gap[part.state.closed].min(initial=0.0) > -2e-6
        assert not [event for event in result.events if event.kind == "overlap"]


@pytest.mark.parametrize(
    ("seed", "ground"), [(266, "plane"), (174, "plane"), (4, "balls"), (115, "balls")]
)
def test_no_impact_or_jump_drives_a_robot_past_a_stop(seed: int, ground: str) -> None:
    """A kept row acts from the middle of a part on: stops were passed before, by up to 9 mm.

    An impact elsewhere drove the robot at them (174 and the balls), or their gap jumped where a
    contact let go (266), and all of the step was taken with the row.
    """
    plant, state, torque, dt = drawn_scene(seed, ground, soft=True)
    for _ in range(5):
        result = plant.step(state, torque, dt)
        state = result.state
        assert made_by_rows(result) < 1e-9
        assert not [event for event in result.events if event.kind == "overlap"]


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
