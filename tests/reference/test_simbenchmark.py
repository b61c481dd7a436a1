"""Rolling, bouncing and momentum as github.com/leggedrobotics/SimBenchmark asks for them.

That project throws bodies at one another. Bodies of this library's robots do not collide with each
other, so each test keeps what it measures and the closed solution: its balls on a box that is
pushed see, from the box, a gravity that is tilted, which is a ball on a slope; its elastic balls
bounce on the ground alone; its quadruped in weightlessness is set in motion by its own joints
instead of by a ball.
"""

import numpy as np
import pinocchio as pin
import pytest

from tests.sim.bodies import ball, block
from wbc import load_robot
from wbc.sim import Plane, Plant, simulate

G, R, NONE = 9.81, 0.1, np.zeros(0)
SIZE = (0.4, 0.4, 0.1)
BOX = block(SIZE, 0.4, 10.0)
TIME, STEP = 0.5, 2e-3


def at(position, rotation=None):
    """Return q (7,) of a free body."""
    turn = np.eye(3) if rotation is None else rotation
    return np.concatenate([position, pin.Quaternion(np.array(turn)).coeffs()])


def world_velocity(state):
    """Return linear (3,) and angular (3,) velocity in world axes of a free body's state."""
    turn = pin.Quaternion(np.array(state.position[3:7])).matrix()
    return turn @ state.velocity[:3], turn @ state.velocity[3:6]


def along(plant, state, time=TIME, step=STEP, external=None):
    """Return the states from start to end."""
    states = [state]
    for _ in range(round(time / step)):
        states.append(plant.step(states[-1], NONE, step, external).state)
    return states


# Rolling: friction, and whether its cone is round.


@pytest.mark.parametrize("push", [150.0, 39.0])
@pytest.mark.parametrize("direction", [0.0, 0.25 * np.pi, 1.0])
def test_a_pushed_box_slides_as_a_round_cone_wants(direction, push):
    """On 10 kg with mu = 0.4: F/m - mu g, whatever the direction (a pyramid fails at 45).

    With 39 N, less than friction, it does not move at all.
    """
    plant, way = Plant(BOX), np.array([np.cos(direction), np.sin(direction), 0.0])
    # Pushed at the height of its feet it does not tip: M = r x F about its centre. Nor does it
    # turn: its axes stay the world's.
    force = push * np.concatenate([way, np.cross([0.0, 0.0, -0.05], way)])
    start = at([0.0, 0.0, 0.05])
    end = along(plant, plant.state(start), external=force)[-1]
    speed, turning = world_velocity(end)
    wanted = max(push / 10.0 - 0.4 * G, 0.0) * TIME * way
    np.testing.assert_allclose(speed, wanted, atol=1e-9)
    np.testing.assert_allclose(turning, 0.0, atol=1e-9)
    assert push > 40.0 or np.abs(end.position - start).max() < 1e-12


SLOPES = [(10.0, 0.8), (30.0, 0.8), (30.0, 0.17), (30.0, 0.1)]


@pytest.mark.parametrize(("degrees", "friction"), SLOPES)
def test_a_ball_rolls_down_a_slope_or_slips_where_friction_is_too_little(degrees, friction):
    """Rolling: 5/7 g sin a, without loss; friction needed: 2/7 tan a (0.165 at 30 degrees).

    With less it slips: v' = g (sin a - mu cos a) and R w' = 5/2 mu g cos a.
    """
    angle = np.deg2rad(degrees)
    plane, down = Plane.slope(angle), np.array([-np.cos(angle), 0.0, -np.sin(angle)])
    plant = Plant(ball(R, friction), plane)
    states = along(plant, plant.state(at(R * plane.normal)))
    speed, spin = world_velocity(states[-1])
    rubs = min(friction * np.cos(angle), 2.0 / 7.0 * np.sin(angle))
    np.testing.assert_allclose(speed, G * (np.sin(angle) - rubs) * TIME * down, atol=1e-9)
    turned = 2.5 * G * rubs * TIME * down
    np.testing.assert_allclose(R * np.cross(spin, plane.normal), turned, atol=1e-9)
    first, last = (plant.mechanical_energy(state) for state in (states[0], states[-1]))
    assert friction == 0.1 or last == pytest.approx(first, abs=1e-9)


@pytest.mark.parametrize("heading", [0.0, 0.25 * np.pi])
def test_a_ball_thrown_flat_slides_until_it_rolls(heading):
    """v falls by mu g t to 5/7 of its start, at t = 2 v / (7 mu g), and stays."""
    plant, friction, start = Plant(ball(R, 0.3)), 0.3, 3.0
    way = np.array([np.cos(heading), np.sin(heading), 0.0])
    state = plant.state(at([0.0, 0.0, R]), np.concatenate([start * way, np.zeros(3)]))
    rolls = 2.0 * start / (7.0 * friction * G)
    states = along(plant, state, 1.5 * rolls, rolls / 100.0)
    for k in (30, 60, 90):
        speed = world_velocity(states[k])[0]
        np.testing.assert_allclose(speed, (start - friction * G * k * rolls / 100) * way, atol=1e-9)
    for k in (101, 150):
        speed, spin = world_velocity(states[k])
        np.testing.assert_allclose(speed, 5.0 / 7.0 * start * way, atol=1e-9)
        np.testing.assert_allclose(R * np.cross(spin, [0.0, 0.0, 1.0]), speed, atol=1e-9)


# Bouncing: energy of elastic impacts, and the bounces of less elastic ones.


@pytest.mark.parametrize("step", [1e-2, 2e-3])
def test_an_elastic_ball_keeps_its_energy_and_without_friction_its_speed_along_the_ground(step):
    """From 5 m, 10 kg, e = 1: every apex at 5 m again, whatever the step."""
    plant = Plant(ball(R, 0.0, 10.0), restitution=1.0)
    time = (5.0 if step > 5e-3 else 1.5) * np.sqrt(2.0 * 4.9 / G)  # two bounces, or one, and up
    start = plant.state(at([0.0, 0.0, 5.0]), [2.0, -1.0, 0.0, 3.0, 4.0, 5.0])
    states = along(plant, start, time, step)
    energy = np.array([plant.mechanical_energy(state) for state in states])
    assert np.abs(energy / energy[0] - 1.0).max() < 1e-5
    speed, spin = world_velocity(states[-1])
    np.testing.assert_allclose([*speed[:2], *spin], [2.0, -1.0, 3.0, 4.0, 5.0], atol=1e-9)


# Momentum: a quadruped in weightlessness.


@pytest.mark.parametrize("name", ["solo12", "anymal"])
def test_a_shaken_quadruped_keeps_its_momentum(name):
    """Linear and angular, about its centre of mass."""
    robot = load_robot(name).with_gravity([0.0, 0.0, 0.0])
    plant, model = Plant(robot, Plane(height=-100.0)), robot.model
    push, random = 0.1 * robot.transmission.torque_limit, np.random.default_rng(3)
    phase = random.uniform(0.0, 6.0, robot.transmission.size)
    twist = np.concatenate([[0.7, -0.4, 0.5, 1.0, -2.0, 1.5], np.zeros(model.nv - 6)])
    start = plant.state(robot.pose(), twist)
    run = simulate(plant, lambda s: push * np.sin(12.0 * s.time + phase), start, 0.4, dt=STEP)
    before, after = (
        pin.computeCentroidalMomentum(model, model.createData(), s.position, s.velocity).vector
        for s in (start, run.state)
    )
    for part in (slice(0, 3), slice(3, 6)):
        change = np.linalg.norm(after[part] - before[part])
        assert change < 1e-10 * np.linalg.norm(before[part])
