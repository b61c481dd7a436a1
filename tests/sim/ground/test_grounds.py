"""Contacts that belong to a solid; boxes, edges, balls and height fields; small overlaps."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from sims.leg import balanced_pose
from tests.sim.bodies import ball, block, watched
from tests.sim.random_robots import random_robot
from wbc import load_robot
from wbc.robot import ContactPoint
from wbc.sim import Box, HeightField, Plane, Plant, Stairs, Terrain
from wbc.sim.step.tables import TOUCH

POINT = replace(ball(0.05, 0.0), contacts=(ContactPoint("point", "body", np.zeros(3), 0.0),))


@pytest.mark.parametrize("dt", [1e-3, 1e-2])
def test_a_block_that_slides_into_a_riser_stops_there(dt: float) -> None:
    plant = Plant(block((0.2, 0.2, 0.1), friction=0.05), Stairs([0.3], [0.0, 0.06]))
    start = plant.state([0, 0, 0.05, 0, 0, 0, 1], [1.0, 0, 0, 0, 0, 0])
    state, deepest = watched(plant, start, 0.6, 1e-4, step=dt)
    assert deepest > -1e-5
    assert 0.15 < state.position[0] < 0.2001


def test_a_fall_off_an_edge_keeps_the_speed() -> None:
    """A point that slides over the end of a tread flies on."""
    plant = Plant(POINT, Stairs(np.array([0.1]), np.array([0.0, -1.0])))
    start = plant.state(POINT.neutral(), [2.0, 0, 0, 0, 0, 0])
    state, _ = watched(plant, start, 0.3, 4e-10)
    assert state.velocity[0] == pytest.approx(2.0, abs=1e-9)
    assert state.position[2] == pytest.approx(-0.5 * 9.81 * 0.25**2, abs=3e-3)


class _Jump(Terrain):
    """A ground of one face whose height jumps, as a user may write one."""

    def gap(self, points):
        high = np.where(points[:, 0] > 0.1, 0.06, 0.0)
        return points[:, 2] - high, np.tile([0.0, 0.0, 1.0], (len(points), 1))


def test_a_gap_that_jumps_is_taken_back_slowly_and_named() -> None:
    plant = Plant(POINT, _Jump(), return_speed=0.5)
    state, deepest, named = plant.state(POINT.neutral(), [1.0, 0, 0, 0, 0, 0]), 0.0, []
    for _ in range(300):
        result = plant.step(state, [], 1e-3)
        rise = result.state.position[2] - state.position[2]
        assert rise <= 0.5e-3 + 1e-9
        assert np.linalg.norm(result.state.velocity) < 1.0 + 1e-9
        state, deepest = result.state, min(deepest, plant.gaps(result.state).min())
        named += [event for event in result.events if event.kind == "overlap"]
    assert deepest < -0.05 < -1e-6 < plant.gaps(state).min()
    assert "contact 'point'" in named[0].text
    assert named[0].size == pytest.approx(0.0595, abs=1e-3)


@pytest.mark.parametrize("restitution", [0.0, 0.9])
@pytest.mark.parametrize("dt", [2e-3, 1e-2, 5e-2])
def test_every_barrier_that_closes_in_a_step_is_kept(restitution: float, dt: float) -> None:
    """A passive leg on a slope bounces between stop and ground, many times within a step."""
    leg = load_robot("planar_leg").lossless()
    model = leg.model.copy()
    model.upperPositionLimit = np.append(model.upperPositionLimit[:-1], 0.8)
    leg = replace(leg, model=model)
    for seed in range(6):
        rng = np.random.default_rng(seed)
        plant = Plant(leg, Plane.slope(np.radians(15.0)), restitution)
        q = leg.configuration(hip=rng.uniform(-0.8, 0.2), knee=rng.uniform(0.3, 0.7), base_z=2.0)
        q[1] -= plant.gaps(plant.state(q)).min() - 0.02
        v = rng.normal(size=5) * [0.5, 0.5, 1.0, 2.0, 2.0]
        state = plant.state(q, v)
        energy = plant.mechanical_energy(state)
        for _ in range(round(0.6 / dt)):
            state = plant.step(state, [0.0, 0.0], dt).state
            assert state.position[-1] < 0.8 + 1e-3 * (dt / 1e-2) ** 2 + 2e-6
            assert plant.gaps(state).min() > -1e-2 * (dt / 1e-2) ** 2 - 2e-6
            assert plant.mechanical_energy(state) < energy * (1.0 + dt)


def test_a_ball_rolls_over_an_edge_round_it() -> None:
    """The way out of an edge turns with the ball: no jump, no energy."""
    plant = Plant(ball(0.1, 1.5), Box([-0.5, 0.0, -0.5], [1.0, 2.0, 1.0]))
    start = plant.state([-0.05, 0, 0.1, 0, 0, 0, 1], [0.2, 0, 0, 0, 2.0, 0])
    state, _ = watched(plant, start, 0.8, 9e-5)
    assert state.position[2] < -0.05


def test_the_gap_of_a_height_field_is_the_distance() -> None:
    """The gap grows along its normal as fast as the way, and not at all across it."""
    x = np.linspace(-1.0, 1.0, 11)
    rng = np.random.default_rng(0)
    ground = HeightField(x, x, 0.08 * rng.normal(size=(11, 11)))
    flat = np.column_stack((rng.uniform(-0.9, 0.9, (200, 2)), np.zeros(200)))
    gap, normal = ground.gap(flat)
    points, way = flat + (0.03 - gap)[:, None] * normal, 1e-6
    gap, normal = ground.gap(points)
    slopes = [ground.gap(points + s)[0] - ground.gap(points - s)[0] for s in way * np.eye(3)]
    assert np.stack(slopes, axis=1) / (2 * way) == pytest.approx(normal, abs=1e-6)
    surface, _ = ground.gap(points - gap[:, None] * normal)
    assert np.abs(surface).max() < 1e-10


def test_a_ball_in_a_hollow_keeps_its_energy() -> None:
    """With its gap taken straight below its centre it lost 4 %, at any step."""
    x = np.linspace(-1.0, 1.0, 41)
    hollow = HeightField(x, x, np.repeat(2.0 * x[:, None] ** 2, 41, axis=1))
    plant, left = Plant(ball(0.1, 0.0), hollow), []
    start = plant.state([0, 0, 0.1, 0, 0, 0, 1], [1.0, 0, 0, 0, 0, 0])
    for dt in (1e-3, 5e-4):
        state = plant.step(start, [], 1e-9).state
        first = plant.mechanical_energy(state)
        state = plant.run(state, [], 0.3, round(0.3 / dt))[-1].state
        left.append(abs(plant.mechanical_energy(state) - first))
    assert left[0] < 5e-3
    assert left[1] < 0.6 * left[0], left


def test_a_slow_landing_is_a_row_of_its_step() -> None:
    """It took three solves and an impact; every foot that rocks does so in every other step."""
    plant, q, v = Plant(ball(0.05, 0.5)), [0, 0, 0.05 + 4e-6, 0, 0, 0, 1], np.zeros(6)
    v[2] = -3e-3
    state = plant.state(q, v)
    assert len(plant.step(state, [], 1e-3).parts) == 1
    state, deepest = watched(plant, state, 3e-3, 0.0, said=(), parts=1)
    assert deepest >= -1e-6
    assert np.abs(state.velocity).max() < 1e-9
    assert len(plant.step(plant.state(q, 10.0 * v), [], 1e-3).parts) == 2


# Found by searching, with the steps it takes until the jam has lasted a few.
@pytest.mark.parametrize(("seed", "steps"), [(165, 9), (246, 40), (345, 14), (1245, 27)])
def test_a_point_that_friction_jams_rests_where_it_drifted(seed: int, steps: int) -> None:
    """One step inside the ground, on so few joints that steep friction holds every opening."""
    rng = np.random.default_rng(seed)
    gears = rng.uniform(0.5, 1.0), rng.uniform(0.02, 1.0)
    robot = random_robot(rng, "fixed", *gears, rng.uniform(0.0, 1.5), coupled=False)
    free, ratio = Plant(robot), robot.transmission.gear_ratio
    q = pin.integrate(robot.model, robot.neutral(), rng.uniform(-1.0, 1.0, robot.model.nv))
    lowest = free.gaps(free.state(q)).min()
    plant = Plant(robot, Plane(height=lowest - rng.uniform(0.0, 0.05)))
    state = plant.state(q, rng.normal(size=robot.model.nv))
    torque = 5.0 * rng.normal(size=len(ratio)) / np.abs(ratio)
    state = plant.run(state, torque, 1e-3 * steps, steps)[-1].state
    assert plant.gaps(state).min() > -2e-4


def test_an_overlap_throws_nothing_up_however_short_the_step_and_is_soon_gone() -> None:
    """A landing leaves up to half TOUCH; taken back within what is left of a step, it is a blow."""
    leg = load_robot("planar_leg_strong")
    plant = Plant(leg)
    start = plant.state(balanced_pose(leg, lift=-0.5 * TOUCH))
    state = start.replace(closed=plant.step(start, [0.0, 0.0], 1e-3).state.closed)
    assert plant.gaps(state).min() == pytest.approx(-0.5 * TOUCH, rel=1e-6)
    for dt in (1e-9, 1e-6, 1e-4, 1e-3):
        after = plant.step(state, [0.0, 0.0], dt).state
        assert plant.mechanical_energy(after) < plant.mechanical_energy(state) + 1e-4
        # Half a TOUCH in a millisecond turns the knee at 9 mrad/s; without motors it then sinks.
        assert np.abs(after.velocity).max() < 0.01 + 60.0 * dt
    assert plant.gaps(plant.run(start, [0.0, 0.0], 5e-3, 50)[-1].state).min() > -0.01 * TOUCH


def test_a_point_on_its_way_out_of_the_ground_lands_nowhere() -> None:
    """A fast impact can leave a point inside that moves out; looking for its landing crashed."""
    plant = Plant(block((0.2, 0.2, 0.1), friction=0.5))
    state = plant.state([0, 0, 0.04, 0, 0, 0, 1], [0, 0, 1.0, 0, 0, 0])
    state = state.replace(closed=np.zeros(8, dtype=bool))
    result = plant.step(state, [], 1e-3)
    assert len(result.parts) == 1
    assert result.state.velocity[2] == pytest.approx(1.0 - 9.81e-3)
    result = plant.step(state.replace(velocity=-state.velocity), [], 1e-3)
    assert len(result.impacts) == 1
    assert abs(result.state.velocity[2]) < 1e-9
