"""The numbers of a robot: one source for the plant and for the folder that the library loads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

GRAVITY = 9.81
Contact = tuple[str, int, np.ndarray]
"""Its name, the number of its link, and its point in the link's frame [m]."""


@dataclass(frozen=True, eq=False)
class Link:
    """A rigid body with the joint that carries it.

    Attributes:
        name: of the body.
        joint: of its joint.
        kind: `hinge`, `slide` or `free`.
        parent: number of the parent link; -1 is the world.
        axis: (3,) of the joint.
        origin: (3,) of the joint in the parent's frame [m].
        mass: [kg].
        com: (3,) centre of mass in the joint's frame [m].
        inertia: (3, 3) about the centre of mass [kg m^2].
    """

    name: str
    joint: str
    kind: str
    parent: int
    axis: np.ndarray
    origin: np.ndarray
    mass: float
    com: np.ndarray
    inertia: np.ndarray

    def with_point(self, mass: float, point: np.ndarray) -> Link:
        """Return the link with a point mass fixed to it."""
        total = self.mass + mass
        com = (self.mass * self.com + mass * point) / total
        inertia = (
            self.inertia
            + self.mass * _steiner(self.com - com)
            + mass * _steiner(np.asarray(point) - com)
        )
        return replace(self, mass=total, com=com, inertia=inertia)


@dataclass(frozen=True, eq=False)
class Machine:
    """A robot as the user believes it to be, with perfect gears.

    Attributes:
        family: what kind it is, for the tables.
        links: in depth-first order.
        driven: joints with a motor.
        ratio: (m,) gear ratios.
        reflected: (m,) N^2 I_r [kg m^2].
        topology: (m, m) D, dq = D dpsi.
        contacts: points that may touch.
        gravity: (3,) field [m/s^2].
        center: (m,) middle of the driven joints' range [rad].
    """

    family: str
    links: tuple[Link, ...]
    driven: tuple[str, ...]
    ratio: np.ndarray
    reflected: np.ndarray
    topology: np.ndarray
    contacts: tuple[Contact, ...]
    gravity: np.ndarray
    center: np.ndarray

    @property
    def base_size(self) -> int:
        """Number of undriven coordinates; they come first."""
        return (6 if self.floating else 0) + sum(
            link.joint not in self.driven and link.kind != "free" for link in self.links
        )

    @property
    def floating(self) -> bool:
        """Whether the base is a free body in space."""
        return self.links[0].kind == "free"

    @property
    def bodies(self) -> tuple[str, ...]:
        """Links with a mass worth the name."""
        return tuple(link.name for link in self.links if link.mass > 1e-6)

    @property
    def coupled(self) -> tuple[str, ...]:
        """Joints whose motors other joints turn, too."""
        turned_by = np.count_nonzero(np.linalg.inv(self.topology), axis=1)
        return tuple(self.driven[k] for k in np.flatnonzero(turned_by > 1))

    def body(self, name: str) -> int:
        """Return the number of the link called `name`."""
        return [link.name for link in self.links].index(name)

    def with_link(self, number: int, link: Link) -> Machine:
        """Return the machine with one link changed."""
        links = list(self.links)
        links[number] = link
        return replace(self, links=tuple(links))


def _steiner(arm: np.ndarray) -> np.ndarray:
    return float(arm @ arm) * np.eye(3) - np.outer(arm, arm)


def rod(mass: float, com: Sequence[float], length: float, thickness: float) -> np.ndarray:
    """Return the inertia (3, 3) of a box about its centre, long in the direction of `com`."""
    size = np.full(3, thickness)
    size[int(np.argmax(np.abs(com)))] = length
    return np.diag([mass / 12.0 * (size @ size - size[k] ** 2) for k in range(3)])
