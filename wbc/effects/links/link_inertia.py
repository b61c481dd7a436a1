"""A link whose drawing is wrong: mass, centre of mass and inertia together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.effects.links.pseudo_inertia import PARAMETERS, DrawnInertia, departures, excess
from wbc.robot import Effect, Motion, Quantity, Robot, SearchOffer

_LEFT = 0.5  # share of the drawn mass below which a part of the link is taken to be missing
_ABOUT_ORIGIN = "inertia_"


def _departures(effect: LinkInertia) -> FloatArray:
    """(10,) distance from the drawing, in units of how wrong drawings usually are."""
    return departures(tuple(effect.values.values()))


def _implausibility(effect: LinkInertia, robot: Robot, motions: Sequence[Motion]) -> float:
    """Return what a drawing costs that is more wrong than drawings usually are [nats]."""
    return excess(_departures(effect))


def _quantities(effect: LinkInertia, robot: Robot) -> dict[str, Quantity]:
    """Mass, centre of mass and moments of the body."""
    return link_quantities(effect.change(robot), robot.body_joint(effect.where))


def _remarks(effect: LinkInertia, robot: Robot) -> tuple[str, ...]:
    """Say where much of the mass that is drawn is not there."""
    joint = robot.body_joint(effect.where)
    drawn, mass = (one.model.inertias[joint].mass for one in (robot, effect.change(robot)))
    return (mass_left(drawn - mass, drawn, effect.where),) if mass < _LEFT * drawn else ()


@final
@dataclass(frozen=True)
class LinkInertia(Effect):
    """Mass, centre of mass and inertia of a body are not those of its drawing.

    Its numbers are the log-Cholesky parameters of the pseudo-inertia in units of the drawn one, so
    that every body that they describe can exist. A fit is drawn to the drawing by the
    log-determinant divergence, in units of how wrong drawings usually are: what logs do not tell
    stays as drawn.

    Attributes:
        alpha: the mass is exp(2 alpha) times that drawn, its distribution the same.
        d1, d2, d3: stretch of the distribution of mass.
        s12, s23, s13: its shear.
        t1, t2, t3: shift of the centre of mass in radii of gyration.
    """

    alpha: float
    d1: float
    d2: float
    d3: float
    s12: float
    s23: float
    s13: float
    t1: float
    t2: float
    t3: float

    name = "link_inertia"
    parameters = PARAMETERS
    explanation = (
        "The CAD inertia of this link is wrong: cables, covers and motors were left out, or its "
        "mass is spread otherwise. Mass, centre of mass and inertia differ together."
    )
    experiment = (
        "Move this joint and those before it fast in several poses, and hold still in many: weigh "
        "the link if it can be taken off."
    )
    search = SearchOffer(
        expected=1.0,
        claims=3,  # mass, centre of mass and inertia
        departures=_departures,
        implausibility=_implausibility,
        quantities=_quantities,
        remarks=_remarks,
    )

    @classmethod
    def places(cls, robot: Robot) -> tuple[str, ...]:
        """Every body that has a mass."""
        return heavy_bodies(robot)

    def change(self, robot: Robot) -> Robot:
        """Return the robot with the inertia of the body changed."""
        joint = robot.body_joint(self.where)
        after = DrawnInertia.of(robot, joint).changed(tuple(self.values.values()))
        return robot.with_inertia(joint, after)


def link_quantities(robot: Robot, joint: int) -> dict[str, Quantity]:
    """Return what a person can check of the link that a joint moves, in the joint's frame.

    Mass, centre of mass, principal inertias about it from small to large; where logs do not tell
    these, the first moments (mass times centre) and the inertia about the joint's origin.
    """
    inertia = robot.model.inertias[joint]
    found = {"mass": Quantity(inertia.mass, "kg")}
    for axis, center in zip("xyz", inertia.lever, strict=True):
        found[f"center_{axis}"] = Quantity(float(center), "m", f"moment_{axis}")
    for k, moment in enumerate(np.linalg.eigvalsh(inertia.inertia), start=1):
        found[f"principal_inertia_{k}"] = Quantity(float(moment), "kg m^2", _ABOUT_ORIGIN)
    for axis, center in zip("xyz", inertia.lever, strict=True):
        found[f"moment_{axis}"] = Quantity(float(inertia.mass * center), "kg m")
    about_origin = pin.PseudoInertia.FromDynamicParameters(inertia.toDynamicParameters())
    second = np.diagonal(about_origin.toMatrix())[:3]
    for axis, square in zip("xyz", second, strict=True):
        found[f"inertia_{axis}{axis}"] = Quantity(float(second.sum() - square), "kg m^2")
    return found


def mass_left(lost: float, drawn: float, body: str) -> str:
    """Say that a mass that the robot file has is not there."""
    return (
        f"{lost:.3g} kg of the {drawn:.3g} kg that the robot file has at '{body}' are not there: a "
        "tool or gripper that is in the CAD model and not mounted?"
    )


def heavy_bodies(robot: Robot) -> tuple[str, ...]:
    """Return the bodies that have a mass."""
    return tuple(b for b in robot.bodies if robot.model.inertias[robot.body_joint(b)].mass > 0.0)
