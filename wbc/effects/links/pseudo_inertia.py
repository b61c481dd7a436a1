"""Inertias near a drawn one: log-Cholesky parameters, and how far they are from the drawing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray, frozen
from wbc.robot import Parameter, Robot

LOG_CHOLESKY = ("alpha", "d1", "d2", "d3", "s12", "s23", "s13", "t1", "t2", "t3")
"""The ten numbers, named as by Rucker and Wensing (2022)."""

# How wrong drawings usually are, as a standard deviation of the log-Cholesky parameters: 28 % of
# the mass, 28 % of every second moment, and a centre of mass that is off by a fifth of the radius
# of gyration (2 cm for a forearm of 0.35 m): CAD leaves out cables, grease and screws, and takes
# castings for solid. Measured on the recorded Staubli TX40 against its CAD links: rms departures of
# links 3 to 6 are 1.0, 0.6, 0.6 and 0.3 in this unit (links 1 and 2 cannot be told from rotors).
USUAL = 0.2

_SPREAD = 0.5  # standard deviation of the logarithm of how wrong drawings are beside USUAL
_LARGEST_LOG = 1.5  # a mass between 1 / 20 and 20 times that drawn
_LARGEST = 20.0  # of shears, and of shifts in radii of gyration
_KEPT = 256  # drawn links that are remembered: a fit asks for each many times
# ... and links that differ from their drawing: a derivative changes one number of one link at a
# time, and asks for all of them.
_VARIED = 2048
_THIN = 0.1  # share of a link's length below which no radius of gyration is believed

_BESIDE = np.triu_indices(4, 1)

PARAMETERS = tuple(
    Parameter(name, "1", 0.0, -limit, limit, USUAL)
    for name, limit in zip(LOG_CHOLESKY, [_LARGEST_LOG] * 4 + [_LARGEST] * 6, strict=True)
)


@dataclass(frozen=True, eq=False)
class DrawnInertia:
    """The pseudo-inertia of a drawn link, with its Cholesky factor.

    The pseudo-inertia is P = sum over the mass of (x, 1)(x, 1)', (4, 4). A link with log-Cholesky
    parameters p has F L(p) L(p)' F' with F F' = P as drawn: p = 0 is the drawing, and every p is a
    body that can exist. Where the drawing is thinner than a tenth of its length (or cannot exist)
    F is that of a body which is not; the difference stays.

    Attributes:
        inertia: as drawn, in the joint's frame.
        factor: F (4, 4), upper triangular.
    """

    inertia: pin.Inertia
    factor: FloatArray

    @classmethod
    @lru_cache(maxsize=_KEPT)
    def of(cls, robot: Robot, joint: int) -> DrawnInertia:
        """Return that of the link that a joint of `robot` moves."""
        inertia = robot.model.inertias[joint]
        matrix = pin.PseudoInertia.FromDynamicParameters(inertia.toDynamicParameters()).toMatrix()
        mass, center = inertia.mass, np.array(inertia.lever)
        second = matrix[:3, :3] - mass * np.outer(center, center)
        squares, axes = np.linalg.eigh(second)
        thin = mass * (_THIN * _length(robot, joint)) ** 2
        second = (axes * np.maximum(squares, thin)) @ axes.T
        factor = np.zeros((4, 4))
        factor[:3, :3] = np.linalg.cholesky(second[::-1, ::-1])[::-1, ::-1]
        factor[:3, 3] = np.sqrt(mass) * center
        factor[3, 3] = np.sqrt(mass)
        return cls(inertia, factor)

    @lru_cache(maxsize=_VARIED)  # noqa: B019 - as many as are kept, and they are small
    def changed(self, numbers: tuple[float, ...]) -> pin.Inertia:
        """Return the inertia with these log-Cholesky parameters (10,); it is not to be changed."""
        if not any(numbers):
            return self.inertia
        change = _parameters(self.factor @ lower(numbers)) - _parameters(self.factor)
        return pin.Inertia.FromDynamicParameters(self.inertia.toDynamicParameters() + change)


def lower(numbers: Sequence[float]) -> FloatArray:
    """Return L (4, 4), upper triangular, of log-Cholesky parameters (10,)."""
    alpha, d1, d2, d3, s12, s23, s13, t1, t2, t3 = numbers
    stretch1, stretch2, stretch3 = np.exp([d1, d2, d3])
    shape = [
        [stretch1, s12, s13, t1],
        [0.0, stretch2, s23, t2],
        [0.0, 0.0, stretch3, t3],
        [0.0, 0.0, 0.0, 1.0],
    ]
    return np.asarray(np.exp(alpha) * np.array(shape))


@lru_cache(maxsize=_VARIED)
def departures(numbers: tuple[float, ...]) -> FloatArray:
    """Return (10,) how far an inertia is from its drawing, in units of how wrong drawings are.

    Their squares sum up to the log-determinant divergence of the two pseudo-inertias,
    tr(Q) - log det Q - 4 with Q = L L', over USUAL^2 (Lee, Wensing and Park, 2020). It does not
    depend on frames or units.
    """
    factor = lower(numbers)
    x = np.log(np.diagonal(factor))
    stretched = np.sign(x) * np.sqrt(np.maximum(np.expm1(2.0 * x) - 2.0 * x, 0.0))
    return frozen(np.concatenate([stretched, factor[_BESIDE]]) / USUAL)


def excess(distances: FloatArray) -> float:
    """Return what a drawing costs that is more wrong than drawings usually are [nats].

    By what factor drawings are wrong differs: its logarithm has a standard deviation of 0.5, as
    that of drives has. What ten free numbers could explain is paid by holding out.
    """
    size = float(np.sqrt(np.mean(distances**2)))
    return float(0.5 * (np.log(max(size, 1.0)) / _SPREAD) ** 2)


def _parameters(factor: FloatArray) -> FloatArray:
    return np.asarray(pin.PseudoInertia.FromMatrix(factor @ factor.T).toDynamicParameters())


def _length(robot: Robot, joint: int) -> float:
    """Return how long the link of a joint is, by its centre of mass and the joints it carries."""
    model = robot.model
    ends = [model.jointPlacements[k].translation for k in range(1, model.njoints)]
    own = [end for k, end in enumerate(ends, start=1) if model.parents[k] == joint]
    own.append(model.inertias[joint].lever)
    longest = max([float(np.linalg.norm(end)) for end in own])
    return longest or max([float(np.linalg.norm(end)) for end in ends]) or 0.1
