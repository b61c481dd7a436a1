"""Bodies against edges of the ground and against each other: distances as coal has them, rest."""

from dataclasses import replace
from itertools import combinations_with_replacement
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest

from sims import bodies
from tests.sim.bodies import free, hull_of, placed, solid, watched
from wbc.measurement import load_log, save_log
from wbc.robot import FreeBody
from wbc.sim import Plane, Plant, Recorder, Sphere, Stairs
from wbc.view.channels import configuration, velocity as measured_velocity

SHAPES = {
    "sphere": coal.Sphere(0.06),
    "capsule": coal.Capsule(0.04, 0.2),
    "box": coal.Box(0.2, 0.14, 0.1),
    "mesh": hull_of(np.random.default_rng(3).normal(size=(18, 3)) * [0.1, 0.07, 0.05]),
}


@pytest.mark.parametrize("kinds", list(combinations_with_replacement(SHAPES, 2)), ids="-".join)
def test_distances_are_those_of_coal(kinds: tuple[str, str]) -> None:
    """Where they overlap; apart, the distance is at least coal's (see `Plant.pair_gaps`)."""
    one, other = (SHAPES[kind] for kind in kinds)
    both = FreeBody("a", one, 1.0), FreeBody("b", other, 1.0)
    robot = free(*both, pairs=(("a", "b"),))
    # With the vertices of a mesh that stick out by 1e-4 m and more: nearly all that it has.
    robot = replace(robot, surface=replace(robot.surface, depth=1e-9))
    plant = Plant(robot, Plane(height=-50.0))
    random, request, overlaps = np.random.default_rng(5), coal.DistanceRequest(), 0
    request.enable_signed_distance = True
    for _ in range(300):
        first, second = (pin.Quaternion(random.normal(size=4)).normalized() for _ in range(2))
        way, wanted, apart = random.normal(size=3), random.uniform(-2e-3, 3e-3), 0.4
        way, here = way / np.linalg.norm(way), coal.Transform3s(first.matrix(), np.zeros(3))
        for _ in range(40):  # along the way to about the wanted distance
            place = apart * way
            there = coal.Transform3s(second.matrix(), place)
            found = coal.distance(one, here, other, there, request, coal.DistanceResult())
            apart -= found - wanted
        if abs(found - wanted) > 1e-7 or apart < 0.0:
            continue  # coal does not settle there
        q = np.concatenate((np.zeros(3), first.coeffs(), place, second.coeffs()))
        seen = plant.pair_gaps(plant.state(q))[0]
        assert seen > found - 1e-6
        if found < 0.0 and "mesh" not in kinds:  # of a mesh some vertices are left out
            assert seen == pytest.approx(found, abs=1e-6)
            overlaps += 1
    assert "mesh" in kinds or overlaps > 20


@pytest.mark.parametrize("turn", [[0.0, 0.0, 0.0], [0.5, 0.3, 0.7]], ids=["level", "turned"])
def test_a_plank_lies_on_the_edge_of_a_stair(turn: list[float]) -> None:
    """Its corners touch the treads; the edge was 42 mm inside it."""
    stair = Stairs(edges=np.array([0.0]), heights=np.array([0.0, 0.1]))
    plant = solid(coal.Box(0.6, 0.4, 0.1), stair)
    state, deepest = watched(plant, plant.state(placed(([-0.05, 0.0, 0.45], turn))), 3.0)
    assert np.abs(state.velocity).max() < 1e-9
    assert deepest > -1e-6
    rotation = pin.Quaternion(state.position[3:]).matrix()
    along = np.linspace(-0.3, 0.3, 601)
    edge = np.column_stack((0.0 * along, along, 0.0 * along + 0.1)) - state.position[:3]
    inside = np.min([0.3, 0.2, 0.05] - np.abs(edge @ rotation), axis=1)
    assert inside.max() < 1e-6


def test_a_plank_on_a_ball_rocks_as_a_rolling_body_does() -> None:
    """Nothing in Coulomb's law stops rolling: it neither comes to rest nor gains energy."""
    radius, half, tilt = 0.1, 0.025, 0.1
    plant = solid(coal.Box(0.6, 0.4, 2.0 * half), Sphere(np.zeros(3), radius))
    out, along = np.array([[np.sin(tilt), 0, np.cos(tilt)], [np.cos(tilt), 0, -np.sin(tilt)]])
    place = (radius + half) * out - radius * tilt * along
    state = plant.state(placed((place.tolist(), [0.0, tilt, 0.0])))
    tilts = [tilt]
    for _ in range(2700):
        state, _ = watched(plant, state, 1e-3, 1e-7)
        tilts.append(2.0 * np.arcsin(state.position[4]))
    turned = (0.6**2 + 0.05**2) / 12.0 + half**2  # k^2 about the place of contact
    period = 2.0 * np.pi * np.sqrt(turned / (9.81 * (radius - half)))
    crossed = np.flatnonzero(np.diff(np.sign(tilts)))
    assert len(crossed) == 4
    assert 2e-3 * np.diff(crossed).mean() == pytest.approx(period, rel=0.01)
    assert max(tilts[crossed[-2] :]) == pytest.approx(tilt, rel=0.02)


def boxes(*places: tuple[list[float], list[float]]) -> tuple[Plant, np.ndarray]:
    """Return two boxes of 0.2 m and 1 kg that touch each other, and where they begin."""
    both = [FreeBody(name, coal.Box(0.2, 0.2, 0.2), 1.0) for name in ("lower", "upper")]
    return Plant(free(*both, pairs=(("lower", "upper"),))), placed(*places)


def test_a_stack_of_two_boxes_stands_and_carries_its_weight() -> None:
    plant, q = boxes(([0.0, 0.0, 0.1], [0.0] * 3), ([0.0, 0.0, 0.3], [0.0] * 3))
    results = plant.run(plant.state(q), [], 1.0, 1000)
    np.testing.assert_allclose(results[-1].state.position, q, atol=1e-12)
    push = sum(result.pair_impulse[0] for result in results) * (
        1.0 if plant.pairs[0][0] == "upper" else -1.0
    )
    np.testing.assert_allclose(push, [0.0, 0.0, 9.81], atol=1e-9)
    force = np.mean([result.contact_force for result in results], axis=0)
    ground = force[: len(plant.contacts)].sum(axis=0)
    np.testing.assert_allclose(ground, [0.0, 0.0, 19.62], atol=1e-9)


def test_a_log_of_a_stack_holds_the_poses_of_both_boxes(tmp_path: Path) -> None:
    """Logs kept the first free body alone, so a playback drew the other one at the origin."""
    plant, q = boxes(([0.0, 0.0, 0.11], [0.0] * 3), ([0.03, 0.02, 0.35], [0.1, 0.05, 0.4]))
    states, recorder = [plant.state(q)], Recorder(plant.robot)
    for _ in range(20):
        result = plant.step(states[-1], [], 5e-3)
        recorder.add(states[-1], result)
        states.append(result.state)
    log = load_log(save_log(recorder.log(), tmp_path / "stack.csv"))
    rows = states[:-1]
    np.testing.assert_allclose(configuration(plant.robot, log), [s.position for s in rows])
    np.testing.assert_allclose(measured_velocity(plant.robot, log), [s.velocity for s in rows])


def test_a_box_dropped_on_a_box_rests_on_it_or_topples_off() -> None:
    on_it = ([0.03, 0.02, 0.35], [0.1, 0.05, 0.4])
    beside = ([0.12, 0.01, 0.301], [0.0, 0.0, 0.4])
    for place, height in ((on_it, 0.3), (beside, 0.1)):
        plant, q = boxes(([0.0, 0.0, 0.1], [0.0] * 3), place)
        state, deepest = watched(plant, plant.state(q), 2.0)
        assert np.abs(state.velocity).max() < 1e-9
        assert state.position[9] == pytest.approx(height, abs=1e-6)
        assert deepest > -2e-6


def test_two_fingers_lift_a_box_by_friction() -> None:
    scene = bodies.scenes()[2]
    states = bodies.run(scene)
    held = states[300].position
    np.testing.assert_allclose(states[-1].position[2] - held[2], 0.0, atol=1e-6)
    risen = states[-1].position[0] - held[0]
    assert risen > 0.06
    assert states[-1].position[5] - held[5] == pytest.approx(risen, abs=1e-4)
    # A box too heavy for mu times the grip stays on the ground.
    heavy = replace(scene, plant=replace(scene.plant, robot=bodies.hand(mass=2.0)))
    assert bodies.run(heavy)[-1].position[5] == pytest.approx(0.04, abs=1e-6)
