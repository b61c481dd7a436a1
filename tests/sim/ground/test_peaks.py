"""Planks on height fields that stick out between their corners: they lie there, as on a stair."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.interpolate import RectBivariateSpline

from wbc import load_robot
from wbc.robot import FreeBody, bare_robot
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
    "a peak between nodes": (peak(0.025, 0.025), [0.02, 0.01, 0.2], [0.0, 0.0, 0.0]),
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
    body = FreeBody("plank", coal.Box(*(2.0 * _HALF)), 2.0)
    return Plant(bare_robot(pin.Model()).with_free_bodies(body), HeightField(_GRID, _GRID, heights))


def depth(heights: np.ndarray, position: np.ndarray) -> float:
    """Return how deep the smooth surface, or what is under it, is in the plank [m]."""
    fine = np.linspace(-0.8, 0.8, 321)
    x, y = np.meshgrid(fine, fine, indexing="ij")
    z = RectBivariateSpline(_GRID, _GRID, heights, s=0.0)(fine, fine)
    ground = np.stack([(x, y, z - below) for below in (0.0, 0.01, 0.02)]).transpose(0, 2, 3, 1)
    own = (ground - position[:3]) @ pin.Quaternion(position[3:]).matrix()
    return float((_HALF - np.abs(own)).min(axis=-1).max())


@pytest.mark.parametrize("name", GROUNDS)
def test_a_plank_on_peaks_sinks_no_further_than_they_stick_out_between_nodes(name: str) -> None:
    """Its corners alone met the ground: the peaks went through it."""
    heights, place, turn = GROUNDS[name]
    plant = plank(heights)
    quaternion = pin.Quaternion(pin.rpy.rpyToMatrix(*turn)).coeffs()
    state = plant.state(np.r_[place, quaternion])
    energy = total = plant.mechanical_energy(state)
    for _ in range(1500):
        result = plant.step(state, [], 1e-3)
        state, after = result.state, plant.mechanical_energy(result.state)
        assert after < energy + 1e-5 * total  # the step's own error: turning is of second order
        assert {event.kind for event in result.events} <= {"coarse"}
        assert len(result.parts) <= 5  # no chatter
        energy = after
        if np.abs(state.velocity).max() < 1e-9:
            break
    assert np.abs(state.velocity).max() < 1e-9
    # An eighth of the curvature times the spacing squared, along both axes.
    spline = RectBivariateSpline(_GRID, _GRID, heights, s=0.0)
    fine = np.linspace(-0.5, 0.5, 101)
    bends = [-spline(fine, fine, *order).min() for order in ((2, 0), (0, 2))]
    assert depth(heights, state.position) < sum(bends) * (_GRID[1] - _GRID[0]) ** 2 / 8.0


def test_a_robot_that_is_switched_off_on_waves_comes_to_rest_on_them() -> None:
    """Each of its meshes has barriers of its own on nodes and lines."""
    plant = Plant(load_robot("solo12"), HeightField(_GRID, _GRID, waves()))
    q = plant.robot.pose()
    q[2] = 0.5
    for _ in range(20):
        q[2] -= plant.gaps(plant.state(q)).min()
    q[2] += 1e-3
    state = plant.state(q)
    energy = plant.mechanical_energy(state)
    for _ in range(3000):
        result = plant.step(state, np.zeros(12), 1e-3)
        state, after = result.state, plant.mechanical_energy(result.state)
        assert after < energy + 1e-5
        assert {event.kind for event in result.events} <= {"coarse"}
        energy = after
        if np.abs(state.velocity).max() < 1e-9:
            break
    assert np.abs(state.velocity).max() < 1e-9


def test_a_flat_field_is_a_plane() -> None:
    """Its nodes stick out nowhere: only corners touch it."""
    plant = plank(np.zeros_like(_X))
    q = np.r_[0.0, 0.0, 0.025, 0.0, 0.0, 0.0, 1.0]
    assert np.isinf(plant.pair_gaps(plant.state(q))).all()
    state = plant.state(q, [0.5, 0.0, 0.0, 0.0, 0.0, 0.0])
    state = plant.run(state, [], 0.2, 200).state
    assert np.abs(state.velocity).max() < 1e-9
    assert state.position[0] == pytest.approx(0.5**2 / (2.0 * 0.7 * 9.81), abs=3e-4)
