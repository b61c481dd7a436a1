"""Planks on height fields that stick out between their corners: they lie there, as on a stair."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.interpolate import RectBivariateSpline

from tests.sim.bodies import placed, solid, watched
from wbc import load_robot
from wbc.sim import HeightField, Plant

_HALF = np.array([0.3, 0.2, 0.025])
_GRID = np.linspace(-1.0, 1.0, 41)
_X, _Y = np.meshgrid(_GRID, _GRID, indexing="ij")
_HEIGHT, _WIDTH = 0.1, 0.1  # [m] of a peak, and how wide it is


def peak(x: float, y: float, height: float = _HEIGHT) -> np.ndarray:
    return height * np.exp(-0.5 * ((_X - x) ** 2 + (_Y - y) ** 2) / _WIDTH**2)


def waves() -> np.ndarray:
    """Bumps of 4 cm in all directions, 0.3 to 0.6 m long."""
    random = np.random.default_rng(7)
    ways = random.uniform(10.0, 20.0, 8), random.uniform(0.0, 2.0 * np.pi, (2, 8))
    return sum(
        0.015 * np.sin(k * (np.cos(turn) * _X + np.sin(turn) * _Y) + phase)
        for k, turn, phase in zip(ways[0], *ways[1], strict=True)
    )


GROUNDS = {
    "two peaks": (peak(-0.2, 0.0) + peak(0.2, 0.0), [0.01, 0.0, 0.2], [0.0, 0.0, 0.0]),
    "three peaks": (
        peak(-0.2, 0.05) + peak(0.2, 0.1, 0.08) + peak(0.0, -0.15, 0.08),
        [0.01, 0.0, 0.3],
        [0.2, 0.1, 0.0],
    ),
    "a ridge on its side": (peak(0.0, 0.0) + 0.0 * _Y, [0.25, 0.0, 0.25], [0.0, 0.3, 0.4]),
    "waves": (waves(), [0.01, 0.0, 0.3], [0.2, 0.1, 0.4]),
}


def plank(heights: np.ndarray) -> Plant:
    return solid(coal.Box(*(2.0 * _HALF)), HeightField(_GRID, _GRID, heights))


def depth(heights: np.ndarray, position: np.ndarray) -> float:
    """Return how deep the smooth surface, or what is under it, is in the plank [m]."""
    fine = np.linspace(-0.8, 0.8, 321)
    x, y = np.meshgrid(fine, fine, indexing="ij")
    z = RectBivariateSpline(_GRID, _GRID, heights, s=0.0)(fine, fine)
    ground = np.stack([(x, y, z - below) for below in (0.0, 0.01, 0.02)]).transpose(0, 2, 3, 1)
    own = (ground - position[:3]) @ pin.Quaternion(position[3:]).matrix()
    return float((_HALF - np.abs(own)).min(axis=-1).max())


@pytest.mark.parametrize("name", GROUNDS)
def test_a_plank_lies_on_peaks_without_sinking_into_them(name: str) -> None:
    """It met the nodes of the grid alone: what stuck out between them went into it."""
    heights, *place = GROUNDS[name]
    plant = plank(heights)
    state, _ = watched(plant, plant.state(placed(place)), 1.5)
    assert np.abs(state.velocity).max() < 1e-9
    assert depth(heights, state.position) < 2e-6


def test_a_plank_rocks_on_a_peak_between_nodes_without_sinking() -> None:
    """Nothing brings it to rest on a round top. It lay there on four nodes, 6 mm deep."""
    heights, plant = peak(0.025, 0.025), plank(peak(0.025, 0.025))
    state = plant.state([0.02, 0.01, 0.2, 0.0, 0.0, 0.0, 1.0])
    for _ in range(10):
        state, _ = watched(plant, state, 0.05)
        assert depth(heights, state.position) < 2e-6


@pytest.mark.parametrize("seed", [1, 3, 9, 15, 17, 23, 31, 39, 43, 48, 54, 60, 62, 66, 74, 79])
def test_what_is_thrown_on_a_rough_field_makes_no_energy_and_sinks_nowhere(seed: int) -> None:
    """Balls overran the other side of a hollow by up to 15 mm; to lift them out made 0.12 J."""
    random, coarse = np.random.default_rng(seed), np.linspace(-2.0, 2.0, 21)
    if seed % 2:
        shape = coal.Capsule(random.uniform(0.03, 0.1), random.uniform(0.1, 0.4))
    else:
        shape = coal.Box(*random.uniform(0.1, 0.5, 3))
    field = HeightField(_GRID, _GRID, waves())
    if seed % 4 > 1:
        field = HeightField(coarse, coarse, 0.08 * random.normal(size=(21, 21)))
    plant = solid(shape, field)
    start, turn = random.uniform(-0.2, 0.2, 2), random.normal(size=4)
    quaternion = pin.Quaternion(*(turn / np.linalg.norm(turn))).coeffs()
    speed = random.normal(size=6) * [1.0, 1.0, 1.0, 3.0, 3.0, 3.0]
    state = plant.state(np.r_[start, 0.8, quaternion], speed)
    watched(plant, state, 0.6, gain=2e-5)


def test_a_ball_in_a_groove_that_is_narrower_than_itself_touches_both_sides() -> None:
    """It knew one nearest place, and went into the other side."""
    radius, steep = 0.1, 0.8 * np.sqrt(_GRID**2 + 0.02**2)
    groove = HeightField(_GRID, _GRID, np.repeat(steep[:, None], 41, axis=1))
    plant = solid(coal.Sphere(radius), groove)
    state = plant.state([0.06, 0.01, 0.2, 0.0, 0.0, 0.0, 1.0])
    state = plant.run(state, [], 1.0, 1000)[-1].state
    assert np.abs(state.velocity).max() < 1e-9
    fine = np.linspace(-0.2, 0.2, 4001)
    z = RectBivariateSpline(_GRID, _GRID, groove.heights, s=0.0)(fine, state.position[1])[:, 0]
    away = np.hypot(fine - state.position[0], z - state.position[2])
    assert away[:2000].min() == pytest.approx(radius, abs=2e-6)
    assert away[2000:].min() == pytest.approx(radius, abs=2e-6)


def test_a_robot_that_is_switched_off_on_waves_comes_to_rest_on_them() -> None:
    """Each of its meshes has barriers of its own on nodes and lines."""
    plant = Plant(load_robot("solo12"), HeightField(_GRID, _GRID, waves()))
    q = plant.robot.pose()
    q[2] = 0.5
    for _ in range(20):
        q[2] -= plant.gaps(plant.state(q)).min()
    q[2] += 1e-3
    state, _ = watched(plant, plant.state(q), 3.0, gain=5e-7)
    assert np.abs(state.velocity).max() < 1e-9


def test_the_ends_of_a_capsule_know_how_far_a_field_is() -> None:
    """Places of round bodies are barriers of pairs; their ends are contact points all the same."""
    plant = solid(coal.Capsule(0.05, 0.2), HeightField(_GRID, _GRID, 0 * _X))
    state = plant.state([0.1, 0.2, 0.25, 0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5)])
    assert plant.gaps(state) == pytest.approx([0.2, 0.2])


def test_a_flat_field_is_a_plane() -> None:
    """Its nodes stick out nowhere: only corners touch it."""
    plant = plank(np.zeros_like(_X))
    q = np.r_[0.0, 0.0, 0.025, 0.0, 0.0, 0.0, 1.0]
    assert np.isinf(plant.pair_gaps(plant.state(q))).all()
    state = plant.state(q, [0.5, 0.0, 0.0, 0.0, 0.0, 0.0])
    state = plant.run(state, [], 0.2, 200)[-1].state
    assert np.abs(state.velocity).max() < 1e-9
    assert state.position[0] == pytest.approx(0.5**2 / (2.0 * 0.7 * 9.81), abs=3e-4)
