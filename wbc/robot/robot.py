"""The robot: rigid bodies, transmission, contact points and physical effects. Immutable."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.arrays import FloatArray, IntArray, Ranged, Remade, checked, frozen, must
from wbc.errors import RobotError, require_known, unknown_name
from wbc.robot.effect import Effect, Motion
from wbc.tables import few
from wbc.transmission import Transmission, stribeck


@dataclass(frozen=True, eq=False)
class ContactPoint(Remade, Ranged):
    """A point fixed to a link that may touch the ground, or the centre of a ball that does.

    Attributes:
        name: how logs and controllers call it.
        frame: name of a frame of the pinocchio model.
        offset: (3,) [m] of the point in that frame.
        friction: Coulomb coefficient mu assumed between point and ground.
        radius: [m] of a ball around the point that touches in its stead and rolls; 0 for a point.
        sensor_gain: reported over true force, of its force sensor.
    """

    name: str
    frame: str
    offset: FloatArray
    friction: float = field(default=0.7, metadata=must(">= 0"))
    radius: float = field(default=0.0, metadata=must(">= 0 and < inf"))
    sensor_gain: float = field(default=1.0, metadata=must("> 0 and < inf"))

    _told, _raised = "contact '{0.name}': ", RobotError

    def __post_init__(self) -> None:
        """Check and freeze."""
        label = f"offset of contact '{self.name}'"
        object.__setattr__(self, "offset", checked(self.offset, (3,), label, RobotError))
        super().__post_init__()

    def placement(self) -> pin.SE3:
        """Return the placement of the point in its frame."""
        return pin.SE3(pin.SE3.Identity().rotation, self.offset)


@dataclass(frozen=True, eq=False)
class FreeBody:
    """A uniform solid that moves freely beside a robot: a box to grasp, a stone to stand on.

    Attributes:
        name: of its joint and its link.
        shape: a `coal.Sphere`, `Capsule`, `Box`, `Cylinder` or convex mesh.
        mass: [kg].
    """

    name: str
    shape: Any
    mass: float

    def inertia(self) -> pin.Inertia:
        """Return mass, centre and inertia about it.

        Raises:
            RobotError: a mass or a volume that is not positive.
        """
        volume = float(self.shape.computeVolume())
        if not (self.mass > 0.0 and volume > 0.0):
            raise RobotError(
                f"free body '{self.name}': mass and volume must be positive, got {self.mass} kg "
                f"and {volume} m^3."
            )
        turning = np.asarray(self.shape.computeMomentofInertiaRelatedToCOM())
        return pin.Inertia(self.mass, self.shape.computeCOM(), self.mass / volume * turning)


@dataclass(frozen=True, eq=False)
class LinkSolid:
    """Collision geometry of a link beside that of the model file.

    Attributes:
        link: name of a frame of the pinocchio model; also that of the solid.
        shape: a `coal.Sphere`, `Capsule`, `Box`, `Cylinder` or convex mesh, in the frame's axes.
    """

    link: str
    shape: Any


@dataclass(frozen=True)
class BodySurface(Ranged):
    """How the links of a robot touch the ground beside its contacts (`body_surfaces`).

    Attributes:
        links: names of the bodies that may touch, None for all.
        friction: Coulomb coefficient between them and the ground.
        depth: [m] that a mesh may sink into flat ground between its points.
        pairs: of bodies that touch each other, too; none without.
        solids: beside those of the model file; free bodies have one (`Robot.with_free_bodies`).
    """

    links: tuple[str, ...] | None = None
    friction: float = field(default=0.7, metadata=must(">= 0"))
    depth: float = field(default=0.02, metadata=must("> 0 m"))
    pairs: tuple[tuple[str, str], ...] = ()
    solids: tuple[LinkSolid, ...] = ()

    _told, _raised = "bodies: ", RobotError


class RotorMounting(NamedTuple):
    """The housings of the m rotors.

    Attributes:
        housing: (m,) number of the joint that moves the link carrying each motor; 0 is the world.
        axis: (m, 3) unit vector of each rotor's spin, in the frame of its housing's joint.
    """

    housing: IntArray
    axis: FloatArray


def bodies_of(model: pin.Model) -> tuple[str, ...]:
    """Return the first link that each moving joint carries, or the joint's name without any."""
    carried = dict(enumerate(model.names))
    frames = [frame for frame in model.frames if frame.type == pin.FrameType.BODY]
    carried |= {frame.parentJoint: str(frame.name) for frame in reversed(frames)}
    return tuple(carried[k] for k in range(1, model.njoints))


def require_sound(name: str, model: pin.Model, contacts: Sequence[ContactPoint]) -> None:
    """Check a robot's links and contacts.

    Raises:
        RobotError: two contacts of one name, or one at no frame; joints whose inertia matrix
            pinocchio would get wrong; rotor inertias in the model, which would count twice.
    """
    names = [contact.name for contact in contacts]
    if len(set(names)) != len(names):
        raise RobotError(f"'{name}' has two contacts of one name: {', '.join(names)}.")
    for contact in contacts:
        if not model.existFrame(contact.frame):  # a list of all frames for each robot takes time
            known = [frame.name for frame in model.frames]
            place = f"contact '{contact.name}': "
            raise RobotError(place + unknown_name(f"frame of '{name}'", contact.frame, known))
    before = zip(list(model.parents)[1:], model.supports, strict=False)
    if not all(parent in way for parent, way in before):  # the joint before, or its ancestors
        raise RobotError(
            f"the joints of '{name}' are not in depth-first order: pinocchio's inertia "
            "matrix would be wrong without a word. Add each subtree's joints in one go, as the "
            "URDF and MJCF loaders do."
        )
    if np.any(np.abs(np.asarray(model.armature)) > 0.0):
        raise RobotError(
            f"the model of '{name}' carries armature; put rotor inertias into the "
            "transmission instead (they would count twice)."
        )


_UNMOVED = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)  # q of a free-flyer at the origin
_FREE_FLYER = "JointModelFreeFlyer"


@dataclass(frozen=True)
class RobotSource:
    """Where a robot was loaded from, so that a saved file can refer to it.

    Attributes:
        name: a shipped robot's name or the path of its description.
        lossless: whether its gears were made perfect after loading.
        changed: whether bodies, gears, contacts or gravity were changed in code after loading: then
            no saved file can refer to it, but links still look and touch as the model file has
            them.
        model: the URDF or MJCF file of its links, None where there is none.
    """

    name: str
    lossless: bool = False
    changed: bool = False
    model: Path | None = None


_NAMED = 6  # names of one kind that a line shows


@dataclass(frozen=True, eq=False, repr=False)
class Robot(Remade):
    """One robot model that controller, simulator and identification share.

    The pinocchio model holds the links only: its `armature`, `friction` and `damping` are zero and
    the rotors live in `transmission`. Treat it as immutable; `with_...` methods copy it.

    Attributes:
        name: what the user calls it.
        model: pinocchio model of the links, world z up.
        transmission: gears of the driven joints.
        contacts: points that may touch the ground.
        effects: physical effects added so far, in order; already folded in where they change a
            number of the bodies or gears.
        rotors_turn_with_links: whether the spin of each rotor couples inertially to the motion of
            its housing (the paper's full H_s); without it rotors only feel their own spin.
        source: where it was loaded from, None for a robot built in code.
        poses: named configurations q (nq,) of the description, the first one its usual one.
        notes: what the loader read but could not use, for the user to see.
        loops: that the model file closes and nothing accounts for: here its links form a tree.
        torque_sensors: driven joints with a torque sensor behind their gear, in the order of the
            transmission: logs then show what the gear gives, apart from what the links need.
        sensor_only: driven joints of whose gears nothing is known: what a torque sensor behind
            them shows counts as the report of a perfect gear.
        surface: how its links touch the ground where they may (`body_surfaces`).
        before_effects: the robot to which the effects were added, None where there is none: no
            effect was added, or bodies, gears or contacts were changed in code since.
    """

    name: str
    model: pin.Model
    transmission: Transmission
    contacts: tuple[ContactPoint, ...] = ()
    effects: tuple[Effect, ...] = ()
    rotors_turn_with_links: bool = False
    source: RobotSource | None = None
    poses: Mapping[str, FloatArray] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    loops: tuple[str, ...] = ()
    torque_sensors: tuple[str, ...] = ()
    sensor_only: tuple[str, ...] = ()
    surface: BodySurface = field(default_factory=BodySurface)
    before_effects: Robot | None = field(default=None, repr=False)
    actuated: IntArray = field(init=False)
    actuated_position: IntArray = field(init=False)
    unactuated: IntArray = field(init=False)

    def __post_init__(self) -> None:
        """Resolve names to indices and check that everything refers to something."""
        object.__setattr__(self, "contacts", tuple(self.contacts))
        for joint in self.torque_sensors:
            self.transmission.index(joint)
        sensed = tuple(j for j in self.transmission.joints if j in self.torque_sensors)
        object.__setattr__(self, "torque_sensors", sensed)
        poses = {name: frozen(q) for name, q in self.poses.items()}
        object.__setattr__(self, "poses", MappingProxyType(poses))
        model = self.model
        driven = [(name, model.joints[self._joint_id(name)]) for name in self.transmission.joints]
        for name, joint in driven:
            if joint.nv != 1 or joint.nq != 1:
                raise RobotError(
                    f"joint '{name}' of '{self.name}' has {joint.nv} degrees of freedom; a gear "
                    "drives a joint with one (revolute with limits or prismatic)."
                )
        rows, places = [j.idx_v for _, j in driven], [j.idx_q for _, j in driven]
        rest = sorted({*range(model.nv)} - {*rows})
        parts = {"actuated": rows, "actuated_position": places, "unactuated": rest}
        for field_name, numbers in parts.items():
            object.__setattr__(self, field_name, frozen(numbers, np.int_))
        require_sound(self.name, model, self.contacts)

    def require_tree(self) -> None:
        """Raise RobotError where the model file closes a loop that nothing accounts for."""
        if self.loops:
            raise RobotError(
                f"the model file of '{self.name}' closes a loop ({'; '.join(self.loops)}), and "
                "links form a tree here: without the loop they move otherwise. Where it couples "
                "motors and joints, as a parallelogram or belt does, give the topology of "
                "[transmission]; cut_loops = true in robot.toml leaves it out on purpose."
            )

    def _joint_id(self, joint: str) -> int:
        if not self.model.existJointName(joint):
            raise RobotError(unknown_name(f"joint of '{self.name}'", joint, self.joints))
        return int(self.model.getJointId(joint))

    def __repr__(self) -> str:
        """Return the robot in a line or two: its joints, contacts and effects."""
        loose = [joint for joint in self.joints if joint not in self.transmission.joints]
        parts = {
            "driven": self.transmission.joints,
            "not driven": loose,
            "contacts": [contact.name for contact in self.contacts],
            "effects": [f"{effect.name} at {effect.where}" for effect in self.effects],
        }
        said = [f"{what}: {few(names, _NAMED)}" for what, names in parts.items() if names]
        return f"Robot({'; '.join((self.name, *said))})"

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of all moving joints, driven or not, in pinocchio's order."""
        return tuple(self.model.names)[1:]

    @property
    def single_joints(self) -> tuple[str, ...]:
        """Names of the joints with one degree of freedom, driven or not."""
        model = self.model
        return tuple(n for n in self.joints if model.joints[model.getJointId(n)].nv == 1)

    @cached_property
    def passive_joints(self) -> tuple[str, ...]:
        """Names of the joints with one position that no gear drives, other than those of a base.

        The coordinates of a base are those between the world and the first driven joint of a robot
        with contact points: they stand for a body that moves freely.
        """
        loose = [joint for joint in self.single_joints if joint not in self.transmission.joints]
        if self.contacts:
            driven, behind = set(map(self._joint_id, self.transmission.joints)), self.model.supports
            loose = [joint for joint in loose if driven & set(behind[self._joint_id(joint)])]
        return tuple(loose)

    @property
    def has_free_flyer(self) -> bool:
        """Whether the first joint is a free-flyer (base.* columns in a log)."""
        return len(self.joints) > 0 and self.model.joints[1].shortname() == _FREE_FLYER

    @property
    def free_flyers(self) -> dict[str, tuple[int, int]]:
        """Owner of the columns of each free-flyer -> its first place in q and in v.

        The owner is `base` where the free-flyer is the first joint, else the name of the free body.
        """
        return {
            "base" if number == 1 else str(self.model.names[number]): (joint.idx_q, joint.idx_v)
            for number, joint in enumerate(self.model.joints)
            if number and joint.shortname() == _FREE_FLYER
        }

    @cached_property
    def mounting(self) -> RotorMounting:
        """Which link carries each motor and about which axis its rotor spins.

        A motor sits on the link that the transmission names, else on the link before its joint,
        and spins about the joint's axis (along the slide for a prismatic joint) as it lies in the
        neutral configuration.

        Raises:
            RobotError: the transmission names a housing that is no link.
        """
        model, gears, data = self.model, self.transmission, self.model.createData()
        pin.forwardKinematics(model, data, pin.neutral(model))
        links = [frame.name for frame in model.frames if frame.type == pin.FrameType.BODY]
        housings, axes = [], []
        for joint, link in zip(gears.joints, gears.housings or ("",) * gears.size, strict=True):
            number = model.getJointId(joint)
            housing = model.parents[number]
            if link:
                place = f"housing of the motor of '{joint}'"
                require_known(RobotError, "link", link, links, place)
                housing = model.frames[model.getBodyId(link)].parentJoint
            subspace = np.asarray(data.joints[number].S).reshape(6, -1)[:, 0]
            axis = data.oMi[number].rotation @ (subspace[3:] + subspace[:3])
            housings.append(int(housing))
            axes.append(data.oMi[housing].rotation.T @ axis)
        return RotorMounting(frozen(housings, np.int_), frozen(np.reshape(axes, (-1, 3))))

    @cached_property
    def motor_rows(self) -> FloatArray:
        """How the motors turn, behind their gears, with the coordinates: dpsi = rows v, (m, nv)."""
        rows = np.zeros((self.transmission.size, self.model.nv))
        rows[:, self.actuated] = self.transmission.motor_from_joint
        return frozen(rows)

    @property
    def floating_size(self) -> int:
        """b, the number of coordinates that no gear drives."""
        return int(self.unactuated.size)

    @property
    def weight(self) -> float:
        """Weight of all moving bodies [N]."""
        return float(pin.computeTotalMass(self.model) * np.linalg.norm(self.model.gravity.linear))

    @cached_property
    def bodies(self) -> tuple[str, ...]:
        """One name per moving joint: the link that it carries, of which fixed ones are part."""
        return bodies_of(self.model)

    def body_joint(self, body: str) -> int:
        """Return the number of the joint that moves `body`.

        Raises:
            RobotError: no such body.
        """
        bodies = self.bodies
        require_known(RobotError, f"body of '{self.name}'", body, bodies)
        return bodies.index(body) + 1

    def velocity_index(self, joint: str) -> int:
        """Return the row of a joint's (first) velocity in v.

        Raises:
            RobotError: no such joint; the message lists those there are.
        """
        return int(self.model.joints[self._joint_id(joint)].idx_v)

    def position_index(self, joint: str) -> int:
        """Return the row of a joint's (first) position in q; raises as `velocity_index`."""
        return int(self.model.joints[self._joint_id(joint)].idx_q)

    def contact(self, name: str) -> ContactPoint:
        """Return the contact point called `name`.

        Raises:
            RobotError: no such contact; the message lists those there are.
        """
        named = {contact.name: contact for contact in self.contacts}
        require_known(RobotError, f"contact of '{self.name}'", name, named)
        return named[name]

    def contact_place(self, contact: ContactPoint) -> tuple[int, FloatArray]:
        """Return the joint that moves a contact point, 0 for the world, and its place (3,) [m]."""
        frame = self.model.frames[self.model.getFrameId(contact.frame)]
        return int(frame.parentJoint), np.asarray(frame.placement.act(contact.offset))

    def ends(self, joint: int) -> list[FloatArray]:
        """Return the places (3,) [m] on a link of the joints, then of the contacts that it carries.

        Args:
            joint: number of the joint that moves the link, 0 for the world. Places are in its axes.
        """
        model, contacts = self.model, map(self.contact_place, self.contacts)
        joints = [np.array(model.jointPlacements[k].translation) for k in model.children[joint]]
        return joints + [place for carrier, place in contacts if carrier == joint]

    def with_effect(self, effect: Effect) -> Robot:
        """Return a new robot that has `effect` too.

        Raises:
            EffectError: the effect cannot sit where it says on this robot.
        """
        return self.with_effects(effect)

    def with_effects(self, *effects: Effect) -> Robot:
        """Return a new robot that has all `effects` too, added in order.

        Raises:
            EffectError: one of them cannot sit where it says on this robot.
        """
        changed = self
        for effect in effects:
            effect.check_place(changed)
            changed = effect.change(changed)
        own, before = (*self.effects, *effects), self.before_effects if self.effects else self
        return changed._with(effects=own, source=self.source, before_effects=before)

    def with_acting(self, effects: Iterable[Effect]) -> Robot:
        """Return the same bodies and gears on which these effects act in place of its own.

        What its own effects changed of bodies and gears stays.
        """
        return self._with(effects=tuple(effects))

    def without_effects(self) -> Robot:
        """Return the robot to which the effects were added; itself where that is not known."""
        return self.before_effects or self

    @cached_property
    def sensed(self) -> IntArray:
        """Numbers (s,) of the gears with a torque sensor behind them."""
        return frozen([self.transmission.index(j) for j in self.torque_sensors], np.int_)

    def gear_efficiencies(self, motion: Motion) -> tuple[FloatArray, FloatArray]:
        """Return eta_f and eta_b of all gears at a motion, (..., m); (m,) where it matters nowhere.

        Args:
            motion: one sample or many.
        """
        gears = self.transmission
        if not gears.slow_loss.any():
            return gears.forward_efficiency, gears.backward_efficiency
        share = stribeck(motion.velocity @ self.motor_rows.T, gears.slow_loss, gears.slow_speed)
        return gears.forward_efficiency * (1.0 - share), gears.backward_efficiency / (1.0 + share)

    def with_contacts(self, contacts: Iterable[ContactPoint]) -> Robot:
        """Return the same robot with other offsets, balls or friction at its contacts.

        Raises:
            RobotError: other contacts, or in another order; `replace(robot, contacts=...)` has any.
        """
        changed = tuple(contacts)
        if [(c.name, c.frame) for c in changed] != [(c.name, c.frame) for c in self.contacts]:
            names = ", ".join(contact.name for contact in self.contacts) or "none"
            raise RobotError(
                f"'{self.name}' keeps its contacts ({names}), their order and their frames; use "
                "dataclasses.replace(robot, contacts=...) for others."
            )
        return self._changed(contacts=changed)

    def with_torque_sensors(self, joints: Iterable[str]) -> Robot:
        """Return the same robot with torque sensors behind the gears of these joints.

        Raises:
            TransmissionError: a joint that no gear drives.
        """
        chosen = tuple(joints)
        before = self.before_effects and self.before_effects.with_torque_sensors(chosen)
        return replace(self, torque_sensors=chosen, before_effects=before)

    def with_transmission(self, transmission: Transmission) -> Robot:
        """Return a copy with other gears."""
        changed = self._changed(transmission=transmission)
        return changed if transmission.joints == self.transmission.joints else replace(changed)

    def with_drive_times(self, times: Mapping[str, ArrayLike]) -> Robot:
        """Return the same robot with other times of its drives; a saved file has them.

        Args:
            times: (m,) [s] of each of `DRIVE_TIMES`.
        """
        before = self.before_effects and self.before_effects.with_drive_times(times)
        return self._with(transmission=self.transmission.replace(**times), before_effects=before)

    def with_inertia(self, joint_number: int, inertia: pin.Inertia) -> Robot:
        """Return a copy whose link at that joint has `inertia`."""
        return self.with_inertias({joint_number: inertia})

    def with_inertias(self, inertias: Mapping[int, pin.Inertia]) -> Robot:
        """Return a copy whose links at these joints have these inertias."""
        model = self.model.copy()
        for joint_number, inertia in inertias.items():
            model.inertias[joint_number] = inertia
        return self._changed(model=model)

    def with_gravity(self, gravity: ArrayLike) -> Robot:
        """Return a copy in a gravity field `gravity` (3,) [m/s^2], world frame."""
        model = self.model.copy()
        model.gravity.linear = checked(gravity, (3,), "gravity", RobotError)
        return self._changed(model=model)

    def with_free_bodies(self, *bodies: FreeBody, pairs: Iterable[tuple[str, str]] = ()) -> Robot:
        """Return the same robot with free bodies behind its own coordinates, at the origin.

        Args:
            bodies: to add; q gets seven entries of each, v six.
            pairs: of bodies, the robot's or free ones, that touch each other beside the ground.

        Raises:
            RobotError: a body without mass or volume.
        """
        model, more = self.model.copy(), np.tile(_UNMOVED, len(bodies))
        for body in bodies:
            joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), body.name)
            model.appendBodyToJoint(joint, body.inertia(), pin.SE3.Identity())
            model.addBodyFrame(body.name, joint, pin.SE3.Identity(), 0)
        own, solids = self.surface, [LinkSolid(body.name, body.shape) for body in bodies]
        surface = replace(own, solids=(*own.solids, *solids), pairs=(*own.pairs, *pairs))
        poses = {name: np.concatenate((q, more)) for name, q in self.poses.items()}
        return replace(self, model=model, surface=surface, poses=poses, before_effects=None)

    def lossless(self) -> Robot:
        """Return the same robot with perfect gears (eta = 1, frictionless rotors).

        Effects that changed a gear before are overruled; effects added afterwards act.
        """
        changed = self._changed(transmission=self.transmission.lossless())
        if self.source is not None and not self.effects:
            changed = changed._with(source=replace(self.source, lossless=True))
        return changed._with(before_effects=self.before_effects and self.before_effects.lossless())

    def _changed(self, **changes: Any) -> Robot:
        """Return a copy with some fields changed, to which no file can refer."""
        source = None if self.source is None else replace(self.source, changed=True)
        return self._with(**changes, source=source, before_effects=None)

    def neutral(self) -> FloatArray:
        """Return pinocchio's neutral configuration, (nq,)."""
        return np.asarray(pin.neutral(self.model), dtype=np.float64)

    def pose(self, name: str | None = None) -> FloatArray:
        """Return a named configuration (nq,); the usual one when no name is given.

        Raises:
            RobotError: no such pose, or a robot without any.
        """
        wanted = next(iter(self.poses), "(usual)") if name is None else name
        require_known(RobotError, f"pose of '{self.name}'", wanted, self.poses)
        return self.poses[wanted].copy()

    def configuration(self, **joints: float) -> FloatArray:
        """Return the neutral configuration (nq,) with some one-degree joints set by name.

        Raises:
            RobotError: no such joint.
        """
        q = self.neutral()
        for name, value in joints.items():
            q[self.position_index(name)] = value
        return q
