"""A link whose drawing is wrong: mass, centre of mass and inertia together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, final

from wbc.arrays import FloatArray
from wbc.effects.pseudo_inertia import PARAMETERS, DrawnInertia, departures, excess
from wbc.robot import Effect, Parameter, Robot


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

    name: ClassVar[str] = "link_inertia"
    parameters: ClassVar[tuple[Parameter, ...]] = PARAMETERS
    explanation: ClassVar[str] = (
        "The drawing of this link is wrong: cables, covers and motors were left out, or its mass "
        "is spread otherwise. Mass, centre of mass and inertia differ together."
    )
    experiment: ClassVar[str] = (
        "Move this joint and those before it fast in several poses, and hold still in many: weigh "
        "the link if it can be taken off."
    )

    @classmethod
    def places(cls, robot: Robot) -> tuple[str, ...]:
        """Every body that has a mass."""
        return heavy_bodies(robot)

    @property
    def departures(self) -> FloatArray:
        """(10,) distance from the drawing, in units of how wrong drawings usually are."""
        return departures(tuple(self.values.values()))

    @property
    def implausibility(self) -> float:
        """What a drawing costs that is more wrong than drawings usually are [nats]."""
        return excess(self.departures)

    def change(self, robot: Robot) -> Robot:
        """Return the robot with the inertia of the body changed."""
        joint = robot.body_joint(self.where)
        after = DrawnInertia.of(robot, joint).changed(tuple(self.values.values()))
        return robot.with_inertia(joint, after)


def heavy_bodies(robot: Robot) -> tuple[str, ...]:
    """Return the bodies that have a mass."""
    return tuple(b for b in robot.bodies if robot.model.inertias[robot.body_joint(b)].mass > 0.0)
