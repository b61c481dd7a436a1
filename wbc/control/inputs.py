"""What a controller is given in a tick, and what is wrong with it, said in words."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from math import inf
from typing import Any, Protocol, TypeAlias

import numpy as np

from wbc.arrays import FloatArray, Ranged, frozen, is_real, reals
from wbc.compiled import Places, Vector, compiled
from wbc.control.command import Status
from wbc.errors import ControlError, unknown_name
from wbc.robot import Motion, Robot

Target: TypeAlias = Any
"""A task's own kind of value: an array (k,), a rotation matrix (3, 3), or a `pin.SE3`."""


@dataclass(frozen=True, eq=False, slots=True)
class Reference:
    """Target, velocity and feed-forward acceleration of one task.

    Attributes:
        position: where the task's value should be, of the kind that `Task.value` returns; None
            holds the value that the task had when the controller first saw it.
        velocity: (k,) rate of change of the target, in the task's rows; None is zero.
        acceleration: (k,) feed-forward, in the task's rows; None is zero.
    """

    position: Target | None = None
    velocity: FloatArray | None = None
    acceleration: FloatArray | None = None

    def is_finite(self) -> bool:
        """Whether every number in it is finite."""
        position = self.position
        parts = (getattr(position, "homogeneous", position), self.velocity, self.acceleration)
        return all(p is None or bool(np.isfinite(np.asarray(p, np.float64)).all()) for p in parts)


class State(Protocol):
    """What the controller reads of a state: `wbc.robot.Motion` is one."""

    @property
    def position(self) -> FloatArray:
        """q (nq,)."""

    @property
    def velocity(self) -> FloatArray:
        """v (nv,)."""


class Checked(Ranged):
    """Base of what a controller is told, of which a wrong number is a ControlError."""

    _raised = ControlError

    def wrong(self, what: str) -> ControlError:
        """Return the error that says what is wrong with it."""
        return ControlError(self._told.format(self) + what)


Complaint = tuple[Status, str]


class TickInputError(ControlError):
    """What is wrong with the inputs of a tick, and the status that it gets."""

    def __init__(self, message: str, status: Status = Status.BAD_INPUT) -> None:
        """Take the message."""
        super().__init__(message)
        self.status = status


def complaint_of(cause: Exception) -> Complaint:
    """Return status and message of a tick in which something was raised."""
    if isinstance(cause, TickInputError):
        return cause.status, str(cause)
    return Status.FAILED, f"{type(cause).__name__}: {cause}"


_FLOAT = np.dtype(np.float64)  # numpy keeps one of it, and comparing types takes 0.2 us
LONGEST = 0.1
"""[s] longest time step: 1 / sqrt(k) with the default stiffness k = 100 of a task.

With qdd = -k q - 2 sqrt(k) v held over a step h, q and v after it are A (q, v), and the
eigenvalues of A lie inside the unit circle where h sqrt(k) < 1. A longer step is mostly one that
was given in milliseconds.
"""
_UNIT = 1e-3  # single precision leaves 1e-7, integrating for a while without normalising 1e-4


class InputCheck:
    """Checks what a controller is given in a tick."""

    def __init__(
        self, robot: Robot, tasks: Collection[str], weighed: Collection[str], feet: Collection[str]
    ) -> None:
        """Find the parts of q that must be of length one: quaternions and pairs (cos, sin).

        Args:
            robot: whose states are checked.
            tasks: names of everything that takes a reference.
            weighed: names of the tasks that have a weight to change.
            feet: names of all contacts.
        """
        self._names = tasks, weighed, feet
        self._name, self._sizes = robot.name, (robot.model.nq, robot.model.nv)
        parts = []
        for joint in robot.model.joints:
            if joint.nq - joint.nv == 1 and joint.nv in (1, 3, 6):
                length = 2 if joint.nv == 1 or "Planar" in joint.shortname() else 4
                parts.append((int(joint.idx_q) + joint.nq - length, length))
        self._starts = frozen([start for start, _ in parts], np.int_)
        self._lengths = frozen([length for _, length in parts], np.int_)

    def admitted(self, state: State) -> Motion:
        """Return the state as a motion of arrays.

        Raises:
            TickInputError: it is none, or none of this robot.
        """
        try:
            q, v = state.position, state.velocity
            # an array with a mask is no plain one
            plain = type(q) is type(v) is np.ndarray and q.dtype is v.dtype is _FLOAT
            if not plain:
                q, v = reals(q), reals(v)
        except AttributeError:
            kind = type(state).__name__
            raise TickInputError(f"a state has position and velocity; got {kind}.") from None
        except (TypeError, ValueError) as cause:
            message = f"position and velocity of a state are numbers: {cause}."
            raise TickInputError(message) from cause
        nq, nv = self._sizes
        if q.shape != (nq,) or v.shape != (nv,):
            raise TickInputError(
                f"'{self._name}' needs q of shape ({nq},) and v of shape ({nv},), "
                f"got {q.shape} and {v.shape}."
            )
        error = state_error(q, v, self._starts, self._lengths)
        if error == inf:
            raise TickInputError("the state holds a value that is not finite.", Status.NOT_FINITE)
        if error > _UNIT:
            raise TickInputError(
                "a quaternion of the state (or a pair cos, sin) must have length one; "
                f"its square is off by {error:.2g}."
            )
        if plain and isinstance(state, Motion):
            return state
        motion = object.__new__(Motion)  # a third of the time of the class, which sets all fields
        motion.__dict__.update(position=q, velocity=v)
        return motion

    def check(
        self,
        references: Mapping[str, Reference],
        contacts: Mapping[str, float] | None,
        weights: Mapping[str, float] | None,
        activation: Mapping[str, float] | None,
        dt: float,
    ) -> None:
        """Raise TickInputError where something besides the state is wrong."""
        tasks, weighed, feet = self._names
        if type(references) is not dict and not isinstance(references, Mapping):
            kind = type(references).__name__
            raise TickInputError(f"references map a task's name to a Reference; got {kind}.")
        for name, reference in references.items():
            if name not in tasks:
                raise TickInputError(unknown_name("task with a reference", str(name), tasks))
            if type(reference) is not Reference and not isinstance(reference, Reference):
                kind = type(reference).__name__
                raise TickInputError(f"task '{name}' needs a Reference, got {kind}.")
        _check_numbers("contacts, the greatest normal forces [N],", "contact", contacts, feet)
        _check_numbers("weights", "task", weights, weighed)
        _check_numbers("activation", "task", activation, weighed, 1.0)
        check_step(dt)


@compiled
def state_error(position: Vector, velocity: Vector, starts: Places, lengths: Places) -> float:
    """Return by how much squared lengths of unit parts miss one; inf where a number is not finite.

    A vector whose squared length overflows counts as not finite.

    Args:
        position, velocity: q (nq,) and v (nv,).
        starts, lengths: of the parts of q that must be of length one (k,).
    """
    total, worst = 0.0, 0.0
    for i in range(len(position)):
        total += position[i] * position[i]
    for i in range(len(velocity)):
        total += velocity[i] * velocity[i]
    if not total < inf:
        return inf
    for k in range(len(starts)):
        square = 0.0
        for i in range(starts[k], starts[k] + lengths[k]):
            square += position[i] * position[i]
        worst = max(worst, abs(square - 1.0))
    return worst


def _check_numbers(
    told: str, of: str, given: object, names: Collection[str], most: float = inf
) -> None:
    """Check numbers given by name.

    Args:
        told: what they are called, with their unit.
        of: "task" or "contact".
        given: by name, None for none.
        names: that there are.
        most: greatest number; that of a contact may be infinite.
    """
    if given is None:
        return
    if type(given) is not dict and not isinstance(given, Mapping):
        example = f"{{'{next(iter(names), of)}': 1.0}}"
        kind = type(given).__name__
        raise TickInputError(f"{told} map the name of a {of} to a number ({example}); got {kind}.")
    for name, value in given.items():
        if name not in names:
            raise TickInputError(unknown_name(of, str(name), names))
        fits = (type(value) is float or is_real(value)) and 0.0 <= value <= most
        if not fits or (value == inf and of == "task"):
            end = "" if most == inf else f" and <= {most:g}"
            raise TickInputError(
                f"{told} of {of} '{name}' must be a number >= 0{end}, got {value!r}."
            )


def is_step(dt: object) -> bool:
    """Whether a time step [s] can be one."""
    return is_real(dt) and 0.0 < dt <= LONGEST


def check_step(dt: object, told: str = "dt") -> None:
    """Raise TickInputError where a time step [s] cannot be one; `told` is what it is called."""
    if not is_step(dt):
        raise TickInputError(
            f"{told} must be a number > 0 s and <= {LONGEST:g} s, got {dt!r:.40}; 1 ms is 0.001."
        )


TOO_LARGE: Complaint = (
    Status.NOT_FINITE,
    "the accelerations or forces of this state are too large.",
)


def size_complaint(references: Mapping[str, Reference]) -> Complaint:
    """Return why the program of a finite state holds numbers that are not finite or too large."""
    for name, reference in references.items():
        if not reference.is_finite():
            return Status.NOT_FINITE, f"the reference of task '{name}' is not finite."
    return TOO_LARGE
