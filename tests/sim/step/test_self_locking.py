"""Robots on self-locking gears: they run wherever a step has one solution."""

import numpy as np
import pinocchio as pin
import pytest

from sims.leg import LegControl, balanced_pose, squat, with_gears
from sims.legged import CenterOfMass
from tests.sim.bodies import one_joint
from tests.sim.ground.random_grounds import made_by_rows
from wbc import Robot, load_robot
from wbc.effects import CoulombFriction
from wbc.errors import SimulationError
from wbc.sim import Plane, Plant

FAR = Plane(height=-9.0)


def _arm(**changes: float) -> Robot:
    """One weightless link on one gear."""
    body = pin.Inertia(2.0, np.array([0.0, 0.0, -0.3]), 0.02 * np.eye(3))
    gears = {"gear_ratio": 50.0, "rotor_inertia": 1e-5} | changes
    return one_joint(pin.JointModelRY(), body, **gears).with_gravity(np.zeros(3))


def test_friction_beside_a_self_locking_gear_adds_to_what_it_holds() -> None:
    """At rest the gear has a hole in what it holds; friction reaches into it from both ends."""
    friction, drive, ratio = 0.5, 0.1, 50.0
    # Beyond the far end of the hole, T = -N tau/|eta_b|, the gear locks by itself; friction helps.
    for end, way, rotor in ((0.45 * ratio * drive, -1.0, 1e-5), (ratio * drive, 1.0, 1e-2)):
        robot = _arm(forward_efficiency=0.45, backward_efficiency=-1.0, rotor_inertia=rotor)
        plant = Plant(robot.with_effect(CoulombFriction("joint", friction)), FAR)
        for load, holds in ((end - 0.4, True), (end - 0.6, False)):
            result = plant.step(plant.state([0.0]), [drive], 1e-3, np.array([way * load]))
            assert (abs(result.state.velocity[0]) < 1e-12) == holds


def test_a_step_with_several_solutions_names_the_gear() -> None:
    robot = _arm(forward_efficiency=0.4, backward_efficiency=-2.0, rotor_inertia=1e-7)
    plant = Plant(robot, FAR)
    state, messages = plant.state([0.0]), []
    for load in np.linspace(-1.0, 10.0, 23):
        try:
            plant.step(state, [0.1], 1e-3, np.array([load]))
        except SimulationError as error:
            messages.append(str(error))
    assert messages
    assert all("self-locking gears 'joint'" in message for message in messages)
    assert all("solutions" in message for message in messages)


@pytest.mark.parametrize("efficiency", [0.49, 0.45, 0.4, 0.35])
def test_a_squat_on_light_rotors_goes_on_where_steps_have_several_solutions(
    efficiency: float,
) -> None:
    """It was refused after 14 to 26 steps. Every step is on every law, and makes no energy."""
    leg = with_gears(load_robot("planar_leg_strong"), efficiency=efficiency)
    plant = Plant(leg)
    state, asked = plant.state(balanced_pose(leg)), 0
    control = LegControl(leg, squat(float(CenterOfMass(leg)(state)[2]), 0.025, 0.5))
    for _ in range(200):
        result = plant.step(state, control(state), 1e-3)
        state = result.state
        assert not [event for event in result.events if event.kind == "energy"]
        assert result.unsettled == 0
        assert made_by_rows(result) < 1e-9
        asked += sum(part.method == "ranges" for part in result.parts)
    assert asked > 10


def test_a_jack_lifts_steadily() -> None:
    """It stopped with three solutions after 9 to 76 ms, though the motor drives all the time."""
    mass, ratio, rotor, eta_f = 50.0, 200.0, 1e-4, 0.4
    gears = {"gear_ratio": ratio, "rotor_inertia": rotor, "forward_efficiency": eta_f}
    body = pin.Inertia(mass, np.zeros(3), np.eye(3))
    plant = Plant(one_joint(pin.JointModelPZ(), body, **gears, backward_efficiency=-0.5))
    weight = 9.81 * mass
    given, state = 1.3 * weight / eta_f, plant.state([0.0])
    state = plant.run(state, [given / ratio], 0.1, 100)[-1].state
    rises = 0.1 * (eta_f * given - weight) / (mass + eta_f * ratio**2 * rotor)
    assert state.velocity[0] == pytest.approx(rises, rel=1e-9)
