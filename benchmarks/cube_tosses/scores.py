"""How far a predicted toss is from the measured one, and contact parameters that make it less.

The path after several impacts is no measure: a cube that lands a degree differently goes another
way. What counts is the free flight, the speed after the first impact, and where the cube ends.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from benchmarks.cube_tosses.data import (
    FIRST,
    INERTIA,
    MASS,
    Start,
    Toss,
    free_frames,
    start_of,
)
from benchmarks.cube_tosses.engines import ENGINES, Path, Throw

GYRATION = np.sqrt(INERTIA / MASS)  # [m]
WINDOW = (1, 4)  # frames after the first impact between which the speed after it is taken


@dataclass(frozen=True)
class Trial:
    """A measured toss and the start that is given to the engines.

    Attributes:
        toss: as measured, lengths corrected.
        start: from its first free frames.
        free: how many frames lie before the first impact.
    """

    toss: Toss
    start: Start
    free: int

    @classmethod
    def of(cls, toss: Toss, every: slice = slice(None)) -> Trial:
        """Return the trial of a toss; `every` picks some of the first frames for the start."""
        free = free_frames(toss, start_of(toss))
        used = np.arange(len(toss.time))[: min(FIRST, free - 1)][every]
        start = start_of(toss, used)
        return cls(toss, start, free_frames(toss, start))

    @property
    def path(self) -> Path:
        """As measured."""
        return self.toss.position, self.toss.rotation

    def speed_after(self, path: Path, first: int | None = None) -> np.ndarray:
        """Return (6,) [m/s] of a path after the first impact: linear, and angular times radius.

        Between two frames of `WINDOW`, for measured and predicted paths alike; with the radius of
        gyration its square is twice the kinetic energy over the mass. `first` is the frame just
        before the impact in the path's own count, where that starts later than the toss.
        """
        (one, other), (position, rotation) = WINDOW, path
        before = self.free - 1 if first is None else first
        one, other = before + 1 + one, before + 1 + other
        time = (other - one) * self.toss.time[1]
        turn = (rotation[other] * rotation[one].inv()).as_rotvec()
        return np.concatenate([position[other] - position[one], GYRATION * turn]) / time

    def jump(self) -> float:
        """Return the measured change of that speed through the first impact [m/s]."""
        free = self.start.free_flight(self.toss.time)
        return float(np.linalg.norm(self.speed_after(self.path) - self.speed_after(free)))

    def travel(self) -> float:
        """Return how far [m] the cube comes over the board after the first impact."""
        return float(np.linalg.norm((self.toss.position[-1] - self.toss.position[self.free])[:2]))


def miss_after_impact(trial: Trial, throw: Throw) -> float:
    """Return the error of the speed after the first impact [m/s], thrown just before it."""
    time = trial.toss.time[: WINDOW[1] + 2]
    path = throw(trial.start.after(trial.toss.time[trial.free - 1]), time)
    missed = trial.speed_after(path, first=0) - trial.speed_after(trial.path)
    return float(np.linalg.norm(missed))


def face(rotation: Rotation) -> tuple[int, int]:
    """Return which axis of the cube points up or down at the end of a path, and which of both."""
    up = rotation[-1].as_matrix()[2]
    axis = int(np.abs(up).argmax())
    return axis, int(np.sign(up[axis]))


def scores(trial: Trial, path: Path) -> dict[str, float]:
    """Return what a prediction is judged by."""
    position, rotation = path
    last = trial.free - 1
    turned = (rotation[last] * trial.toss.rotation[last].inv()).magnitude()
    return {
        "before impact [mm]": 1e3 * float(np.linalg.norm(position - trial.path[0], axis=1)[last]),
        "before impact [deg]": float(np.rad2deg(turned)),
        "speed after [m/s]": float(
            np.linalg.norm(trial.speed_after(path) - trial.speed_after(trial.path))
        ),
        "final place [mm]": 1e3 * float(np.linalg.norm((position - trial.path[0])[-1, :2])),
        "face": float(face(rotation) == face(trial.path[1])),
    }


FRICTION = (0.1, 0.4)
RANGES: dict[str, tuple[tuple[float, float], ...]] = {
    "wbc": (FRICTION, (0.05, 1.0)),
    "wbc, compliant": (FRICTION, (3e4, 3e6), (0.1, 10.0)),
    "MuJoCo": (FRICTION, (3e-3, 0.05), (0.2, 2.0)),
    "Drake": (FRICTION, (1e3, 1e5), (0.1, 10.0)),
}
"""Where the parameters of an engine are sought, friction first; on logarithmic axes."""


def fit(name: str, trials: Sequence[Trial]) -> tuple[float, ...]:
    """Return an engine's parameters with the least mean error of the speed after the impact."""

    def cost(parameters: np.ndarray) -> float:
        throw = ENGINES[name](*np.exp(parameters))
        return float(np.mean([miss_after_impact(trial, throw) for trial in trials]))

    return best_of(cost, RANGES[name])


def best_of(
    cost: Callable[[np.ndarray], float], ranges: Sequence[tuple[float, float]], points: int = 5
) -> tuple[float, ...]:
    """Return the best of a grid on logarithmic axes, made better by a simplex that starts there."""
    limits = np.log(np.array(ranges))
    axes = [np.linspace(low, high, points) for low, high in limits]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(ranges))
    best = grid[int(np.argmin([cost(point) for point in grid]))]
    reach = np.array([axis[1] - axis[0] for axis in axes]) / 2.0
    simplex = np.clip(np.vstack([best, best + np.diag(reach)]), limits[:, 0], limits[:, 1])
    options = {"initial_simplex": simplex, "xatol": 0.02, "fatol": 2e-4, "maxfev": 60}
    found = minimize(cost, best, method="Nelder-Mead", bounds=limits, options=options)
    return tuple(np.exp(found.x).tolist())
