"""Where the robot touches the world."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray, checked, remade
from wbc.errors import RobotError


@dataclass(frozen=True, eq=False)
class ContactPoint:
    """A point fixed to a link that may touch the ground, or the centre of a ball that does.

    Attributes:
        name: how logs and controllers call it.
        frame: name of a frame of the pinocchio model.
        offset: (3,) [m] of the point in that frame.
        friction: Coulomb coefficient mu assumed between point and ground.
        radius: [m] of a ball around the point that touches in its stead and rolls; 0 for a point.
    """

    name: str
    frame: str
    offset: FloatArray
    friction: float = 0.7
    radius: float = 0.0

    def __reduce__(self) -> tuple[type, tuple[Any, ...]]:
        """Make it anew where it is copied or unpickled."""
        return remade(self)

    def __post_init__(self) -> None:
        """Check and freeze."""
        label = f"offset of contact '{self.name}'"
        object.__setattr__(self, "offset", checked(self.offset, (3,), label, RobotError))
        if not self.friction >= 0.0:
            raise RobotError(f"contact '{self.name}': friction must be >= 0, got {self.friction}.")
        if not 0.0 <= self.radius < np.inf:
            raise RobotError(f"contact '{self.name}': radius must be >= 0, got {self.radius}.")

    def placement(self) -> pin.SE3:
        """Return the placement of the point in its frame."""
        return pin.SE3(pin.SE3.Identity().rotation, self.offset)


@dataclass(frozen=True)
class BodySurface:
    """How the links of a robot touch the ground beside its contacts (`body_contacts`).

    Attributes:
        links: names of the bodies that may touch, None for all.
        friction: Coulomb coefficient between them and the ground.
        depth: [m] that a mesh may sink into flat ground between its points.
    """

    links: tuple[str, ...] | None = None
    friction: float = 0.7
    depth: float = 0.02

    def __post_init__(self) -> None:
        """Check the ranges."""
        if not self.friction >= 0.0:
            raise RobotError(f"bodies: friction must be >= 0, got {self.friction}.")
        if not self.depth > 0.0:
            raise RobotError(f"bodies: depth must be positive, got {self.depth}.")
