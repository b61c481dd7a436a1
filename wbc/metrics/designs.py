"""Designs of a robot that vary together, and the contact point that a metric of theirs speaks of.

Every array of a task has a leading axis of k designs, or of 1 as long as nothing that it depends on
varies, so that a sweep of the gears alone computes the links once.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from wbc.arrays import FloatArray, checked, frozen
from wbc.dynamics import Workspace, evaluate
from wbc.dynamics.equation import rotor_coupling
from wbc.errors import DynamicsError, RobotError, require_known
from wbc.robot import ContactPoint, Robot
from wbc.transmission import GEAR_NUMBERS, Direction, wedge_backward_efficiency

GEAR_FIELDS = (
    "gear_ratio",
    "rotor_inertia",
    "forward_efficiency",
    "backward_efficiency",
    "rotor_coulomb_friction",
    "torque_limit",
)


@dataclass(frozen=True, eq=False)
class Designs:
    """k designs of one robot. Arrays have a leading axis of k, or of 1 where nothing varies.

    Attributes:
        robot: the robot that the designs start from.
        size: k.
        position: q (k or 1, nq).
        gears: the fields of `GEAR_FIELDS`, each (k or 1, m).
    """

    robot: Robot
    size: int
    position: FloatArray
    gears: Mapping[str, FloatArray]

    @classmethod
    def of(
        cls, robot: Robot, position: ArrayLike, gears: Mapping[str, ArrayLike] | None = None
    ) -> Designs:
        """Return designs from what varies; what is left out stays as in `robot`.

        Args:
            robot: the robot that the designs start from.
            position: q (nq,) for all or (k, nq).
            gears: field of `GEAR_FIELDS` -> (k,) for all gears alike, or (k, m). Without
                `backward_efficiency`, a given `forward_efficiency` brings the wedge's 2 - 1/eta_f.

        Raises:
            DynamicsError: different numbers of designs, or an unknown field.
            TransmissionError: a number of a gear outside its range.
        """
        q = checked(np.atleast_2d(position), (None, robot.model.nq), "position", DynamicsError)
        m, given = robot.transmission.size, gears or {}
        full = {name: np.array(getattr(robot.transmission, name))[None] for name in GEAR_FIELDS}
        for name, values in given.items():
            require_known(DynamicsError, "gear parameter", name, GEAR_FIELDS)
            array = np.asarray(values, dtype=np.float64)
            wide = np.repeat(array[:, None], m, axis=1) if array.ndim == 1 else array
            if wide.ndim != 2 or wide.shape[1] != m or np.isnan(wide).any():
                raise DynamicsError(
                    f"{name} has shape {array.shape}; give (k,) or (k, {m}) numbers, none NaN."
                )
            full[name] = frozen(wide)
        if "forward_efficiency" in given and "backward_efficiency" not in given:
            wedge = wedge_backward_efficiency(full["forward_efficiency"])
            full["backward_efficiency"] = frozen(wedge)
        sizes = {len(a) for a in (q, *full.values())} - {1}
        if len(sizes) > 1:
            raise DynamicsError(
                f"designs: arrays of {', '.join(map(str, sorted(sizes)))} designs cannot be "
                "combined; give every varied quantity the same number of values."
            )
        for name, numbers in full.items():
            called = f"{name} of design {{}}, gear {{}}".format
            GEAR_NUMBERS[name].require(numbers, called)
        return cls(robot, sizes.pop() if sizes else 1, q, full)


NOTHING = 1e-9  # the share of the largest lever below which a gear bears nothing
_SINGULAR = 1e10


@dataclass(frozen=True, eq=False)
class ContactTask:
    """A contact point of k designs of a robot, each at rest in its pose.

    Attributes:
        designs: the designs.
        contact: name of the contact point.
        axes: world axes in use, in order, for example "xz".
        mass_matrix: H_l (k or 1, nv, nv), rotors not in it.
        point_jacobian: (k or 1, 3, nv), velocity of the point, world axes.
        spin: a'J_omega (k or 1, m, nv), spin of each rotor's housing about its axis per v; None
            where rotors do not turn with links.
    """

    designs: Designs
    contact: str
    axes: str
    mass_matrix: FloatArray
    point_jacobian: FloatArray
    spin: FloatArray | None = None

    @property
    def jacobian(self) -> FloatArray:
        """J (k or 1, n, nv), velocity of the point along `axes`."""
        return self.point_jacobian[:, ["xyz".index(axis) for axis in self.axes]]

    @property
    def torque_from_force(self) -> FloatArray:
        """D' J_m' (k or 1, m, n) [m], torque at each motor output per force on the point."""
        robot = self.designs.robot
        across = np.swapaxes(self.jacobian[:, :, robot.actuated], 1, 2)
        return np.asarray(robot.transmission.topology.T @ across)

    def levers(self, n: FloatArray) -> FloatArray:
        """Return the size of the torque at each motor output per force along n (k or 1, m) [m].

        0 where it is rounding: a gear that bears nothing.
        """
        matrix = self.torque_from_force
        lever, largest = np.abs(matrix @ n), np.abs(matrix).max(axis=(1, 2), initial=NOTHING)
        return np.asarray(np.where(lever > NOTHING * largest[:, None], lever, 0.0))

    def direction(self, direction: ArrayLike) -> FloatArray:
        """Return `direction` (n,) along `axes` as a unit vector.

        Raises:
            DynamicsError: a wrong length, or the zero vector.
        """
        vector = checked(direction, (len(self.axes),), "direction", DynamicsError)
        length = float(np.linalg.norm(vector))
        if length == 0.0:
            raise DynamicsError(f"direction along {self.axes} must not be zero.")
        return vector / length

    def mobility(self, directions: ArrayLike) -> FloatArray:
        """Return J H^-1 J' (k, n, n) [1/kg], the acceleration of the point per force on it.

        H = K' E_s H_s K for the given directions of power (Sim & Ramos, section IV). A
        self-locking gear that would be driven backward stands still, the limit eta_b -> 0.

        Args:
            directions: (m,) or one for all: +1 forward, -1 backward, 0 without losses.
        """
        return self.jacobian @ self.response(directions, np.swapaxes(self.jacobian, 1, 2))

    def forward_mobility(self) -> FloatArray:
        """Return J H^-1 B E_m B^-1 J' (k, n, n) [1/kg], every gear driven by its motor."""
        robot, forward = self.designs.robot, self.designs.gears["forward_efficiency"]
        torque = robot.motor_rows.T @ (forward[:, :, None] * self.torque_from_force)
        return self.jacobian @ self.response(Direction.FORWARD, torque)

    def blocked(self) -> FloatArray:
        """Return the mobility (k or 1, n, n) [1/kg] with every gear blocked; 0 on a fixed base."""
        rest = self.designs.robot.unactuated
        across = self.jacobian[:, :, rest]
        base = self.mass_matrix[:, rest[:, None], rest]
        return np.asarray(across @ np.linalg.solve(base, np.swapaxes(across, 1, 2)))

    def response(self, directions: ArrayLike, forces: FloatArray) -> FloatArray:
        """Return the acceleration (k, nv, c) that joint forces (k or 1, nv, c) cause from rest."""
        robot, gears = self.designs.robot, self.designs.gears
        mode = np.broadcast_to(np.asarray(directions, dtype=np.float64), robot.transmission.size)
        backward = gears["backward_efficiency"]
        locked = (mode < 0.0) & (backward <= 0.0)
        driven = np.where(mode < 0.0, ratio(1.0, backward, 0.0, 1.0), 1.0)
        eta = np.where(mode > 0.0, gears["forward_efficiency"], driven)
        turned, rotor = gears["gear_ratio"][:, :, None] * robot.motor_rows, gears["rotor_inertia"]
        inertia = self.mass_matrix + np.swapaxes((eta * rotor)[:, :, None] * turned, 1, 2) @ turned
        if self.spin is not None:  # the rotor rows of H_s K hold I_r a'J_omega, too
            coupled = self.spin * rotor[:, :, None]
            inertia = inertia + np.swapaxes(coupled, 1, 2) @ turned
            inertia = inertia + np.swapaxes(eta[:, :, None] * turned, 1, 2) @ coupled
        if not locked.any():
            return np.asarray(np.linalg.solve(inertia, forces))
        k = len(inertia)
        locked = np.broadcast_to(locked, (k, locked.shape[1]))
        forces = np.broadcast_to(forces, (k, *forces.shape[1:]))
        moved = np.empty(forces.shape)
        for pattern in np.unique(locked, axis=0):
            members, stuck = (locked == pattern).all(axis=1), robot.motor_rows[pattern]
            free = np.linalg.svd(stuck)[2][len(stuck) :].T
            left = free.T @ inertia[members] @ free
            moved[members] = free @ np.linalg.solve(left, free.T @ forces[members])
        return moved

    def inverted(self, matrix: FloatArray, what: str) -> FloatArray:
        """Return the inverse of `matrix` (n, n), a mobility.

        Raises:
            DynamicsError: a singular pose; the message names the direction that is lost.
        """
        values, vectors = np.linalg.svd(matrix)[1:]
        if values[-1] * _SINGULAR <= values[0] or values[0] == 0.0:
            lost = ", ".join(f"{x:.3g}" for x in vectors[-1])
            raise DynamicsError(
                f"{what} of '{self.contact}' does not exist in this pose: the point cannot be "
                f"moved along [{lost}] (axes {self.axes}). Leave the singular pose, or choose "
                "the axes in which the point moves (for example axes='xz')."
            )
        return np.asarray(np.linalg.inv(matrix))


def contact_task(robot: Robot, position: ArrayLike, contact: str, axes: str = "xyz") -> ContactTask:
    """Return the task of one contact point of one robot in one pose; its leading axis is 1.

    Args:
        position: q (nq,).
        contact: name of the contact point.
        axes: some of the world axes "x", "y", "z", each at most once.

    Raises:
        DynamicsError: axes that do not exist, a position of wrong shape or not finite.
        RobotError: no such contact point.
    """
    q = checked(position, (robot.model.nq,), "position", DynamicsError)
    return designs_task(Designs.of(robot, q), contact, axes)


def designs_task(designs: Designs, contact: str, axes: str = "xyz") -> ContactTask:
    """Return the task of one contact point of every design; errors as of `contact_task`."""
    upward(axes)
    robot, gears = designs.robot, designs.robot.transmission
    row = 3 * robot.contacts.index(robot.contact(contact))
    # What rotors and housings ask of one another, per rotor inertia, in which designs differ.
    unit = robot.with_transmission(gears.replace(rotor_inertia=np.ones(gears.size)))
    space, rest = Workspace(unit), np.zeros(robot.model.nv)
    inertia, jacobian, spin = list[FloatArray](), list[FloatArray](), list[FloatArray]()
    for q in designs.position:
        terms = evaluate(unit, q, rest, space)
        inertia.append(terms.mass_matrix)
        jacobian.append(terms.contact_jacobian[row : row + 3])
        if robot.rotors_turn_with_links:
            spin.append(rotor_coupling(unit, rest, terms.data).inertia)
    arrays = np.array(inertia), np.array(jacobian), np.array(spin) if spin else None
    return ContactTask(designs, contact, axes, *arrays)


def upward(axes: str) -> FloatArray:
    """Return the unit vector along z of some world axes; along the last one where z is missing.

    Raises:
        DynamicsError: no axis, one twice, or another letter than x, y, z.
    """
    if not axes or len(set(axes)) != len(axes) or not set(axes) <= set("xyz"):
        raise DynamicsError(f"axes '{axes}': name some of x, y, z, each once.")
    return np.array([float(axis == ("z" if "z" in axes else axes[-1])) for axis in axes])


def with_contact_at(robot: Robot, name: str) -> Robot:
    """Return the robot with a contact called `name`: its own, or the origin of a frame.

    An arm's description names no contacts; its metrics are those of a frame, for example its last
    link or its tool.

    Raises:
        RobotError: neither a contact nor a frame of that name.
    """
    contacts = [point.name for point in robot.contacts]
    if name in contacts:
        return robot
    known = contacts + [frame.name for frame in robot.model.frames]
    require_known(RobotError, f"contact or frame of '{robot.name}'", name, known)
    point = ContactPoint(name=name, frame=name, offset=np.zeros(3))
    return replace(robot, contacts=(*robot.contacts, point))


def ratio(
    above: FloatArray | float, below: FloatArray, least: FloatArray | float, otherwise: float
) -> FloatArray:
    """Return above / below where below > least, `otherwise` elsewhere."""
    some = below > least
    return np.asarray(np.where(some, above / np.where(some, below, 1.0), otherwise))
