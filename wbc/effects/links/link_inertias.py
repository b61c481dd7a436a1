"""A drawing that is wrong in all of its links."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import islice
from typing import Self, final

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects.links.link_inertia import heavy_bodies, link_quantities
from wbc.effects.links.pseudo_inertia import (
    LOG_CHOLESKY,
    PARAMETERS,
    DrawnInertia,
    departures,
    excess,
)
from wbc.errors import EffectError, unknown_name
from wbc.robot import (
    Effect,
    Evidence,
    Motion,
    Parameter,
    Quantity,
    Robot,
    Screen,
    SearchOffer,
    small_steps,
)

_COUNT = len(LOG_CHOLESKY)


@lru_cache(maxsize=64)
def _parameters(bodies: tuple[str, ...]) -> tuple[Parameter, ...]:
    return tuple(replace(p, name=f"{body}.{p.name}") for body in bodies for p in PARAMETERS)


def _screens(
    kind: type[LinkInertias], robot: Robot, where: str, evidence: Evidence
) -> tuple[Screen, ...]:
    """Return a small step of every number of every link."""
    null = kind.null_values(robot, where)
    return small_steps(kind.at(where, null).parameters, null)


def _departures(effect: LinkInertias) -> FloatArray:
    """(10 n,) distances from the drawing, in units of how wrong drawings usually are."""
    return np.concatenate([departures(numbers) for _, numbers in effect.links])


def _implausibility(effect: LinkInertias, robot: Robot, motions: Sequence[Motion]) -> float:
    """Return what a drawing costs that is worse than usual [nats], all links together.

    The same people draw all links of a robot, so that one factor says how wrong the drawing is.
    If each link cost on its own, a link as wrong as usual would cost a quarter of a nat.
    """
    return excess(_departures(effect))


def _quantities(effect: LinkInertias, robot: Robot) -> dict[str, Quantity]:
    """Mass, centre of mass and moments of every link, `BODY.mass` and so on."""
    changed = effect.change(robot)
    return {
        f"{body}.{name}": replace(
            quantity, instead=quantity.instead and f"{body}.{quantity.instead}"
        )
        for body, _ in effect.links
        for name, quantity in link_quantities(changed, robot.body_joint(body)).items()
    }


@final
@dataclass(frozen=True)
class LinkInertias(Effect):
    """The whole drawing is wrong: the inertias of all links at once, as one cause.

    Each body has the ten numbers of `link_inertia`, called `BODY.alpha` and so on, also as
    attributes. Each is drawn to its own drawing.

    Attributes:
        links: (body, its ten log-Cholesky parameters); no body twice.
    """

    links: tuple[tuple[str, tuple[float, ...]], ...]

    name = "link_inertias"
    parameters = PARAMETERS  # of every link
    explanation = (
        "The CAD inertias of several links are wrong at once, as those are that leave out cables, "
        "screws and motors, or take castings for solid."
    )
    experiment = (
        "Move all joints at once along rich, fast motions and hold still in many poses: only then "
        "the links are told from one another."
    )
    search = SearchOffer(
        expected=2.0,  # as friction: no machine weighs what its drawing says
        claims=3,  # mass, centre of mass and inertia
        screens=_screens,
        departures=_departures,
        implausibility=_implausibility,
        quantities=_quantities,
    )

    def __post_init__(self) -> None:
        """Give every number its name and check it."""
        names = [body for body, _ in self.links]
        if len(set(names)) < len(names) or any(len(own) != _COUNT for _, own in self.links):
            raise EffectError(f"{self.name}: each body once, with {_COUNT} numbers.")
        parameters = _parameters(tuple(names))
        values = [value for _, numbers in self.links for value in numbers]
        for parameter, value in zip(parameters, values, strict=True):
            object.__setattr__(self, parameter.name, float(value))
        object.__setattr__(self, "parameters", parameters)
        super().__post_init__()

    @classmethod
    def at(cls, where: str, values: Mapping[str, float] | None = None) -> Self:
        """Return the effect for the bodies that `values` names; all else is as drawn.

        Raises:
            EffectError: a number that no body has.
        """
        known: dict[str, dict[str, float]] = {}
        for name, value in (values or {}).items():
            body, _, own = name.rpartition(".")
            if own not in LOG_CHOLESKY or not body:
                raise EffectError(unknown_name(f"parameter of {cls.name}", name, LOG_CHOLESKY))
            known.setdefault(body, dict.fromkeys(LOG_CHOLESKY, 0.0))[own] = float(value)
        return cls(where, tuple((body, tuple(own.values())) for body, own in known.items()))

    @classmethod
    def places(cls, robot: Robot) -> tuple[str, ...]:
        """The robot, where it has several links."""
        return ("robot",) if len(heavy_bodies(robot)) > 1 else ()

    @classmethod
    def null_values(cls, robot: Robot, where: str) -> dict[str, float]:
        """Every link as drawn."""
        return {f"{body}.{own}": 0.0 for body in heavy_bodies(robot) for own in LOG_CHOLESKY}

    def with_values(self, values: Mapping[str, float]) -> Self:
        """Return the same with some numbers changed."""
        known = self.values
        for name in values:
            if name not in known:
                raise EffectError(unknown_name(f"parameter of {self.name}", name, known))
        changed = iter([float(value) for value in {**known, **values}.values()])
        links = tuple((body, tuple(islice(changed, _COUNT))) for body, _ in self.links)
        return type(self)(self.where, links)

    def check_place(self, robot: Robot) -> None:
        """Raise EffectError unless every body is one of `robot` that has a mass."""
        super().check_place(robot)
        bodies = heavy_bodies(robot)
        for body, _ in self.links:
            if body not in bodies:
                raise EffectError(unknown_name(f"body for {self.name}", body, bodies))

    def change(self, robot: Robot) -> Robot:
        """Return the robot with the inertias of the bodies changed."""
        joints = [(robot.body_joint(body), numbers) for body, numbers in self.links]
        return robot.with_inertias(
            {joint: DrawnInertia.of(robot, joint).changed(numbers) for joint, numbers in joints}
        )
