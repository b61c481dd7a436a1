"""The measured tosses and their start: what a simulator is given, and what it has to predict.

Lengths of this data are too short by a common factor: free flight falls at 9.62 m/s^2 and the cube
rests at 0.978 of its half edge. `length_scale` finds the factor from the first of these on the
training tosses; the second then has to come out right by itself.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
from scipy.spatial.transform import Rotation

DATA = Path(__file__).resolve().parents[3] / "shared" / "data" / "contact_nets_cube"
HALF_EDGE, MASS, INERTIA, GRAVITY = 0.0524, 0.37, 0.00081, 9.81  # [m], [kg], [kg m^2], [m/s^2]
CORNERS = HALF_EDGE * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
FIRST = 8  # frames that give the start; the shortest free flight of the 100 tosses has 9


@dataclass(frozen=True)
class Toss:
    """One toss as measured.

    Attributes:
        number: of the source.
        time: (n,) [s].
        position: (n, 3) [m] of the centre.
        rotation: n rotations, world from body.
        held_out: whether it is kept from the fit.
    """

    number: int
    time: np.ndarray
    position: np.ndarray
    rotation: Rotation
    held_out: bool


@dataclass(frozen=True)
class Start:
    """State of the cube at the first frame.

    Attributes:
        position, velocity: (3,) [m], [m/s], world.
        rotation: world from body.
        spin: (3,) [rad/s], world. The three moments of inertia are equal: it stays in free flight.
    """

    position: np.ndarray
    velocity: np.ndarray
    rotation: Rotation
    spin: np.ndarray

    def free_flight(self, time: np.ndarray) -> tuple[np.ndarray, Rotation]:
        """Return positions (n, 3) and rotations at times (n,) [s] as if there were no ground."""
        fall = np.array([0.0, 0.0, -0.5 * GRAVITY])
        position = self.position + np.outer(time, self.velocity) + np.outer(time**2, fall)
        return position, Rotation.from_rotvec(np.outer(time, self.spin)) * self.rotation

    def after(self, time: float) -> Start:
        """Return the state after `time` [s] of free flight, as a start of its own."""
        position, rotation = self.free_flight(np.array([time]))
        velocity = self.velocity - np.array([0.0, 0.0, GRAVITY * time])
        return Start(position[0], velocity, rotation[0], self.spin)


def load(folder: Path = DATA) -> list[Toss]:
    """Return the tosses of the data set, lengths as given."""
    table = pq.read_table(folder / "tosses.parquet")
    column = {name: np.asarray(table[name]) for name in table.schema.names}
    names = np.genfromtxt(
        folder / "tosses.csv", delimiter=",", names=True, dtype=None, encoding="utf-8"
    )
    held_out = {int(row["toss"]): row["split"] == "holdout" for row in names}
    tosses = []
    for number in sorted(held_out):
        rows = column["toss"] == number
        position = np.stack([column[f"base.position.{a}"][rows] for a in "xyz"], axis=1)
        turn = np.stack([column[f"base.orientation.{a}"][rows] for a in "xyzw"], axis=1)
        time = column["time"][rows]
        tosses.append(
            Toss(number, time - time[0], position, Rotation.from_quat(turn), held_out[number])
        )
    return tosses


def scaled(toss: Toss, factor: float) -> Toss:
    """Return the toss with its lengths times `factor`."""
    return replace(toss, position=factor * toss.position)


def start_of(toss: Toss, frames: slice = slice(0, FIRST)) -> Start:
    """Return the start that fits some free frames best (least squares, known gravity)."""
    time = toss.time[frames]
    fall = np.array([0.0, 0.0, -0.5 * GRAVITY])
    rising = toss.position[frames] - np.outer(time**2, fall)
    side = np.stack([np.ones_like(time), time], axis=1)
    (position, velocity), *_ = np.linalg.lstsq(side, rising, rcond=None)
    first = toss.rotation[frames][0]
    turned = (toss.rotation[frames] * first.inv()).as_rotvec()
    (offset, spin), *_ = np.linalg.lstsq(side, turned, rcond=None)
    return Start(position, velocity, Rotation.from_rotvec(offset) * first, spin)


def lowest_corner(position: np.ndarray, rotation: Rotation) -> np.ndarray:
    """Return the height (n,) [m] of the lowest corner."""
    corners = np.stack([rotation.apply(corner) for corner in CORNERS], axis=1)
    return np.asarray((position[:, None] + corners)[..., 2].min(axis=1))


def free_frames(toss: Toss, start: Start) -> int:
    """Return how many frames lie before the first impact that the start predicts."""
    below = lowest_corner(*start.free_flight(toss.time)) < 0.0
    return int(np.argmax(below))


def fall_of(toss: Toss) -> float:
    """Return the acceleration [m/s^2] of the fall over the free frames."""
    time = toss.time[: free_frames(toss, start_of(toss))]
    return -2.0 * float(np.polyfit(time, toss.position[: len(time), 2], 2)[0])


def resting_height(toss: Toss) -> float:
    """Return the height of the centre at the end, in half edges."""
    return float(toss.position[-5:, 2].mean()) / HALF_EDGE


def length_scale(tosses: list[Toss]) -> float:
    """Return the factor by which lengths have to grow for things to fall at 9.81 m/s^2."""
    return GRAVITY / float(np.median([fall_of(toss) for toss in tosses]))


def sliding_friction(toss: Toss) -> float:
    """Return the friction coefficient of the longest slide on a face; NaN where there is none.

    The cube slides where a face is level within 3 degrees, the centre at its resting height within
    2 mm, and it moves faster than 0.1 m/s for at least 8 frames without turning.
    """
    step = toss.time[1]
    level = np.abs(toss.rotation.as_matrix()[:, 2]).max(axis=1) > np.cos(np.deg2rad(3.0))
    low = np.abs(toss.position[:, 2] - HALF_EDGE) < 2e-3
    speed = np.linalg.norm(np.gradient(toss.position[:, :2], step, axis=0), axis=1)
    turning = (toss.rotation[1:] * toss.rotation[:-1].inv()).magnitude() / step
    slides = level & low & (speed > 0.1) & (np.append(0.0, turning) < 1.0)
    edges = np.flatnonzero(np.diff(np.concatenate(([0], slides.astype(int), [0]))))
    first, last = max(edges.reshape(-1, 2), key=lambda run: run[1] - run[0], default=(0, 0))
    if last - first < 8:
        return np.nan
    path = toss.position[first:last, :2]
    along = (path[-1] - path[0]) / np.linalg.norm(path[-1] - path[0])
    return -2.0 * float(np.polyfit(toss.time[first:last], path @ along, 2)[0]) / GRAVITY
