"""Links that weigh, are balanced or touch the ground otherwise than drawn; where gravity leans."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Self, final

import numpy as np
import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.effects import pseudo_inertia
from wbc.effects.pseudo_inertia import LOG_CHOLESKY, USUAL
from wbc.errors import EffectError, require_known, unknown_name
from wbc.robot import Effect, Evidence, Motion, Parameter, Robot, Screen, SearchOffer, number
from wbc.robot.effect import Quantity, small_steps

_KEPT = 256  # drawn links that are remembered: a fit asks for each many times
# ... and links that differ from their drawing: a derivative changes one number of one link at a
# time, and asks for all of them.
_VARIED = 2048
_THIN = 0.1  # share of a link's length below which no radius of gyration is believed

PARAMETERS = tuple(
    Parameter(name, "1", 0.0, -limit, limit, USUAL)
    for name, limit in zip(LOG_CHOLESKY, pseudo_inertia.LARGEST.tolist(), strict=True)
)


@dataclass(frozen=True, eq=False)
class DrawnInertia:
    """The pseudo-inertia of a drawn link, with its Cholesky factor.

    Where the drawing is thinner than a tenth of its length (or cannot exist) F is that of a body
    which is not; the difference stays.

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
        matrix = pin.PseudoInertia.FromInertia(inertia).toMatrix()
        mass, center = inertia.mass, np.array(inertia.lever)
        second = matrix[:3, :3] - mass * np.outer(center, center)
        factor = np.zeros((4, 4))
        wide = pseudo_inertia.raised(second, mass * (_THIN * _length(robot, joint)) ** 2)
        factor[:3, :3] = pseudo_inertia.upper_factor(wide)
        factor[:3, 3] = np.sqrt(mass) * center
        factor[3, 3] = np.sqrt(mass)
        return cls(inertia, factor)

    @lru_cache(maxsize=_VARIED)  # noqa: B019 - as many as are kept, and they are small
    def changed(self, numbers: tuple[float, ...]) -> pin.Inertia:
        """Return the inertia with these log-Cholesky parameters (10,); it is not to be changed."""
        if not any(numbers):
            return self.inertia
        changed = pseudo_inertia.matrix_of(np.array(numbers))
        beside = self.factor @ (changed - np.eye(4)) @ self.factor.T
        change = pin.PseudoInertia.FromMatrix(beside).toDynamicParameters()
        return pin.Inertia.FromDynamicParameters(self.inertia.toDynamicParameters() + change)


def _length(robot: Robot, joint: int) -> float:
    """Return how long the link of a joint is, by its centre of mass and the joints it carries."""
    model = robot.model
    ends = [model.jointPlacements[k].translation for k in range(1, model.njoints)]
    own = [*(ends[k - 1] for k in model.children[joint]), model.inertias[joint].lever]
    longest = max([float(np.linalg.norm(end)) for end in own])
    return longest or max([float(np.linalg.norm(end)) for end in ends]) or 0.1


def _screens(
    kind: type[Effect], robot: Robot, where: str, evidence: Evidence
) -> tuple[Screen, ...]:
    """Return small steps of every number, put together as links need them: linearly."""

    (steps,) = small_steps(kind, robot, where, evidence)

    def combine(coefficients: FloatArray) -> dict[str, float]:
        small = steps.combine(coefficients)
        each = np.reshape(list(small.values()), (-1, _COUNT))
        return dict(
            zip(small, np.ravel([pseudo_inertia.of_first_order(own) for own in each]), strict=True)
        )

    return (replace(steps, combine=combine),)


_LEFT = 0.5  # share of the drawn mass below which a part of the link is taken to be missing
_COUNT = len(LOG_CHOLESKY)


def _excess(effect: RedrawnLinks, *_: object) -> float:
    """Return what links cost that are more wrong than drawings usually are.

    The same people draw all links of a robot, so that one factor says how wrong the drawing is. If
    each link cost on its own, one as wrong as usual would cost a quarter of a nat.
    """
    numbers = np.array([*effect.drawn().values()])
    return pseudo_inertia.excess(pseudo_inertia.departures(numbers))


def _missing(effect: LinkInertia, robot: Robot, motions: Sequence[Motion]) -> float:
    """Return what one link costs that lacks more than drawings usually have too much.

    First moments do not count: logs seldom tell how much of the second ones belongs to them.
    """
    matrix = pseudo_inertia.matrix_of(np.array([*effect.values.values()]))
    matrix[:3, 3] = matrix[3, :3] = 0.0
    return pseudo_inertia.lacking(matrix)


def _quantities(effect: RedrawnLinks, robot: Robot) -> dict[str, Quantity]:
    """Mass, centre of mass and moments of each link; `BODY.mass` and so on where it has many."""
    changed, found = effect.change(robot), dict[str, Quantity]()
    for body in effect.drawn():
        own = "" if effect.parameters is PARAMETERS else f"{body}."
        for name, one in link_quantities(changed, robot.body_joint(body)).items():
            found[own + name] = replace(one, instead=one.instead and own + one.instead)
    return found


def _remarks(effect: LinkInertia, robot: Robot) -> tuple[str, ...]:
    """Say where much of the mass that is drawn is not there."""
    joint = robot.body_joint(effect.where)
    drawn, mass = (one.model.inertias[joint].mass for one in (robot, effect.change(robot)))
    return (mass_left(drawn - mass, drawn, effect.where),) if mass < _LEFT * drawn else ()


@dataclass(frozen=True)
class RedrawnLinks(Effect, ABC):
    """Base of the effects that replace the inertias of links by others near those drawn."""

    search = SearchOffer(
        claims=3,  # mass, centre of mass and inertia
        drawn=True,
        implausibility=_excess,
        quantities=_quantities,
        screens=_screens,
    )

    @abstractmethod
    def drawn(self) -> dict[str, tuple[float, ...]]:
        """Return the ten log-Cholesky parameters of every body that it changes."""

    def change(self, robot: Robot) -> Robot:
        """Return the robot with the inertias of the bodies changed."""
        joints = {robot.body_joint(body): numbers for body, numbers in self.drawn().items()}
        return robot.with_inertias(
            {joint: DrawnInertia.of(robot, joint).changed(own) for joint, own in joints.items()}
        )


@final
@dataclass(frozen=True)
class LinkInertia(RedrawnLinks):
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

    parameters = PARAMETERS
    explanation = (
        "The CAD inertia of this link is wrong: cables, covers and motors were left out, or its "
        "mass is spread otherwise. Mass, centre of mass and inertia differ together."
    )
    experiment = (
        "Move this joint and those before it fast in several poses, and hold still in many: weigh "
        "the link if it can be taken off."
    )
    search = replace(RedrawnLinks.search, expected=1.0, implausibility=_missing, remarks=_remarks)

    @classmethod
    def places(cls, robot: Robot) -> tuple[str, ...]:
        """Every body that has a mass."""
        return heavy_bodies(robot)

    def drawn(self) -> dict[str, tuple[float, ...]]:
        """Return the numbers of its one body."""
        return {self.where: tuple(self.values.values())}


@final
@dataclass(frozen=True)
class LinkInertias(RedrawnLinks):
    """The whole drawing is wrong: the inertias of all links at once, as one cause.

    Each body has the ten numbers of `link_inertia`, called `BODY.alpha` and so on. Each is drawn to
    its own drawing.

    Attributes:
        links: (body, its ten log-Cholesky parameters); no body twice.
    """

    links: tuple[tuple[str, tuple[float, ...]], ...]

    parameters = PARAMETERS  # of every link
    explanation = (
        "The CAD inertias of several links are wrong at once, as those are that leave out cables, "
        "screws and motors, or take castings for solid."
    )
    experiment = (
        "Move all joints at once along rich, fast motions and hold still in many poses: only then "
        "the links are told from one another."
    )
    # As likely as friction: no machine weighs what its drawing says.
    search = replace(RedrawnLinks.search, expected=2.0)

    def __post_init__(self) -> None:
        """Give every number its name and check it."""
        names = [body for body, _ in self.links]
        if len(set(names)) < len(names) or any(len(own) != _COUNT for _, own in self.links):
            raise EffectError(f"{self.name}: each body once, with {_COUNT} numbers.")
        object.__setattr__(self, "parameters", _named(tuple(names)))
        super().__post_init__()

    @cached_property
    def values(self) -> Mapping[str, float]:
        """The numbers of all bodies by name."""
        own = (value for _, numbers in self.links for value in numbers)
        return {p.name: float(value) for p, value in zip(self.parameters, own, strict=True)}

    @classmethod
    def at(cls, where: str, values: Mapping[str, float] | None = None) -> Self:
        """Return the effect for the bodies that `values` names; all else is as drawn.

        Raises:
            EffectError: a number that no body has.
        """
        known = defaultdict[str, dict[str, float]](lambda: dict.fromkeys(LOG_CHOLESKY, 0.0))
        for name, value in (values or {}).items():
            body, _, own = name.rpartition(".")
            if own not in LOG_CHOLESKY or not body:
                raise EffectError(unknown_name(f"parameter of {cls.name}", name, LOG_CHOLESKY))
            known[body][own] = float(value)
        return cls(where, tuple((body, tuple(own.values())) for body, own in known.items()))

    @classmethod
    def places(cls, robot: Robot) -> tuple[str, ...]:
        """The robot, where it has several links."""
        return ("robot",) if len(heavy_bodies(robot)) > 1 else ()

    @classmethod
    def null_values(cls, robot: Robot, where: str) -> dict[str, float]:
        """Every link as drawn."""
        return {f"{body}.{own}": 0.0 for body in heavy_bodies(robot) for own in LOG_CHOLESKY}

    def check_place(self, robot: Robot) -> None:
        """Raise EffectError unless every body is one of `robot` that has a mass."""
        super().check_place(robot)
        bodies = heavy_bodies(robot)
        for body, _ in self.links:
            require_known(EffectError, f"body for {self.name}", body, bodies)

    def drawn(self) -> dict[str, tuple[float, ...]]:
        """Return the numbers of all its bodies."""
        return dict(self.links)


@lru_cache(maxsize=64)
def _named(bodies: tuple[str, ...]) -> tuple[Parameter, ...]:
    return tuple(replace(p, name=f"{body}.{p.name}") for body in bodies for p in PARAMETERS)


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
        found[f"principal_inertia_{k}"] = Quantity(float(moment), "kg m^2", "inertia_")
    for axis, center in zip("xyz", inertia.lever, strict=True):
        found[f"moment_{axis}"] = Quantity(float(inertia.mass * center), "kg m")
    about_origin = inertia.toDynamicParameters()[[4, 6, 9]]  # Ixx, Iyy, Izz
    for axis, moment in zip("xyz", about_origin, strict=True):
        found[f"inertia_{axis}{axis}"] = Quantity(float(moment), "kg m^2")
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


def _payload_remarks(effect: PayloadMass, robot: Robot) -> tuple[str, ...]:
    """Say of a negative mass that it is drawn and not there."""
    if effect.mass >= 0.0:
        return ()
    joint, _ = effect._place(robot)
    return (mass_left(-effect.mass, robot.model.inertias[joint].mass, effect.where),)


@final
@dataclass(frozen=True)
class PayloadMass(Effect):
    """A point mass fixed to a body at its centre of mass, or to a contact point.

    Attributes:
        mass: [kg]; negative takes away.
    """

    mass: float = field(metadata=number("kg", 0.0, -1000.0, 1000.0, 0.3))

    explanation = "Something was mounted, filled or left out: a body is heavier or lighter."
    experiment = (
        "Hold still in several poses, then move fast: the extra torque follows gravity and "
        "inertia together, at one place of the chain."
    )
    search = SearchOffer(remarks=_payload_remarks)

    @classmethod
    def places(cls, robot: Robot) -> tuple[str, ...]:
        """Every body that has a mass, and every contact point."""
        return (*heavy_bodies(robot), *(contact.name for contact in robot.contacts))

    def _place(self, robot: Robot) -> tuple[int, FloatArray]:
        """Return the joint that moves the mass, and its point (3,) [m] in that joint's frame."""
        if self.where in robot.bodies:
            joint = robot.body_joint(self.where)
            return joint, robot.model.inertias[joint].lever
        return robot.contact_place(robot.contact(self.where))

    def change(self, robot: Robot) -> Robot:
        """Return the robot that carries the mass.

        Raises:
            EffectError: so much is taken away that no body is left that can exist.
        """
        if self.mass == 0.0:
            return robot
        joint, point = self._place(robot)
        before = robot.model.inertias[joint]
        if before.mass + self.mass <= 0.0:
            raise EffectError(
                f"payload of {self.mass:g} kg at '{self.where}' leaves no mass there "
                f"(the body has {before.mass:g} kg)."
            )
        after = add_point_mass(before, self.mass, point)
        return robot.with_inertia(joint, require_physical(before, after, self.where))


def _freedom(effect: Effect) -> int:
    """The number of directions in which a centre of mass moved, or gravity leans."""
    return max(1, sum(value != 0.0 for value in effect.values.values()))


def _center_implausibility(effect: CenterOfMass, robot: Robot, motions: Sequence[Motion]) -> float:
    """Return what a centre costs that is shifted by much of the link's reach [nats].

    Drawings are usually wrong by the share of it that `link_inertia` takes, too.
    """
    shift = float(np.linalg.norm([effect.x, effect.y, effect.z]))
    size = reach(robot, robot.body_joint(effect.where))
    return 0.5 * (shift / (USUAL * size)) ** 2 if size > 0.0 else 0.0


@final
@dataclass(frozen=True)
class CenterOfMass(Effect):
    """The centre of mass of a body is shifted; mass and inertia about it stay.

    Attributes:
        x: shift in the frame of the body's joint [m].
        y: likewise.
        z: likewise.
    """

    x: float = field(metadata=number("m", 0.0, -10.0, 10.0, 0.02))
    y: float = field(metadata=number("m", 0.0, -10.0, 10.0, 0.02))
    z: float = field(metadata=number("m", 0.0, -10.0, 10.0, 0.02))

    explanation = (
        "Cables, covers or a battery sit elsewhere than in the CAD model: the body is as heavy "
        "as the model says but hangs differently."
    )
    experiment = (
        "Hold the body still at many angles: the extra gravity torque is a shifted sine of the "
        "angle, while the total weight on the ground is right."
    )
    search = SearchOffer(freedom=_freedom, implausibility=_center_implausibility)

    @classmethod
    def places(cls, robot: Robot) -> tuple[str, ...]:
        """Every body that has a mass."""
        return heavy_bodies(robot)

    def change(self, robot: Robot) -> Robot:
        """Return the robot with the centre of mass moved.

        Raises:
            EffectError: no body has its centre of mass there with this inertia about it.
        """
        joint = robot.body_joint(self.where)
        before = robot.model.inertias[joint]
        after = before.copy()  # pinocchio makes none anew of what rounding takes below zero
        after.lever = before.lever + np.array([self.x, self.y, self.z])
        return robot.with_inertia(joint, require_physical(before, after, self.where))


@final
@dataclass(frozen=True)
class GravityDirection(Effect):
    """Gravity leans against the model's: the base or the ground is tilted.

    Attributes:
        roll: rotation of the field about the world's x axis [rad].
        pitch: about the world's y axis [rad].
    """

    roll: float = field(metadata=number("rad", 0.0, -3.2, 3.2, 0.02))
    pitch: float = field(metadata=number("rad", 0.0, -3.2, 3.2, 0.02))

    explanation = "Mounting, ground or attitude sensor is tilted: gravity pulls sideways."
    experiment = "Use a spirit level; or hold mirrored poses: their gravity torques do not cancel."
    search = SearchOffer(freedom=_freedom)

    def change(self, robot: Robot) -> Robot:
        """Return the robot in the tilted field."""
        field = np.asarray(robot.model.gravity.linear)
        return robot.with_gravity(pin.rpy.rpyToMatrix(self.roll, self.pitch, 0.0) @ field)


def add_point_mass(inertia: pin.Inertia, mass: float, point: FloatArray) -> pin.Inertia:
    """Return `inertia` with a mass [kg] added at a point (3,) [m]; a negative one is taken away."""
    unit = pin.Inertia(1.0, np.asarray(point), np.zeros((3, 3))).toDynamicParameters()
    return pin.Inertia.FromDynamicParameters(inertia.toDynamicParameters() + mass * unit)


def require_physical(before: pin.Inertia, after: pin.Inertia, place: str) -> pin.Inertia:
    """Return `after` if some distribution of positive mass has these parameters.

    That is so where the pseudo-inertia (4, 4) is positive semidefinite (Wensing, Kim & Slotine,
    2018). A drawing that was not physical to begin with must not become less so.

    Raises:
        EffectError: no body could have this inertia.
    """
    least = min(_smallest(before), 0.0)
    if _smallest(after) < least - 1e-9 * max(abs(after.mass), 1.0):
        raise EffectError(f"the change at '{place}' leaves an inertia that no body can have.")
    return after


def _smallest(inertia: pin.Inertia) -> float:
    return float(np.linalg.eigvalsh(pin.PseudoInertia.FromInertia(inertia).toMatrix())[0])


def reach(robot: Robot, joint: int) -> float:
    """Return how far [m] a link is known to reach from its joint, or from its centre of mass.

    To the joints and contact points that it carries, to its drawn centre of mass, and by two radii
    of gyration about that.
    """
    inertia = robot.model.inertias[joint]
    sizes = [float(np.linalg.norm(point)) for point in (*robot.ends(joint), inertia.lever)]
    if inertia.mass > 0.0:
        about_center = max(float(np.trace(inertia.inertia)), 0.0)  # of a point: 0, but for rounding
        sizes.append(2.0 * float(np.sqrt(0.5 * about_center / inertia.mass)))
    return max(sizes)
