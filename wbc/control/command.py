"""What one tick of the controller returns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.gears import gear_directions
from wbc.control.qp.problem import BlockProblem, QPSolution


class Refused(NamedTuple):
    """A program without a usable solution, and the `Program` that names its rows."""

    problem: BlockProblem
    names: Any


class Status(Enum):
    """How a tick ended."""

    SOLVED = "solved"
    INACCURATE = "inaccurate"
    LATE = "late"
    INFEASIBLE = "infeasible"
    FAILED = "failed"
    NOT_FINITE = "not finite"
    BAD_INPUT = "bad input"

    @property
    def usable(self) -> bool:
        """Whether the rotor torque is that of the program, not the safe one."""
        return self in (Status.SOLVED, Status.INACCURATE, Status.LATE)


@dataclass(frozen=True, eq=False)
class Command:
    """Rotor torques for one tick, and what they were computed from.

    Attributes:
        rotor_torque: tau_phi (m,) [N m] to command to the drives, inside their limits.
        acceleration: qdd (nv,) that the program expects; zero where it found none.
        consistent: whether the mesh law allows the returned torques in the directions below.
        output_torque: T (m,) [N m] that leaves the gears.
        mesh_torque: t (m,) [N m] that enters the meshes.
        expected_speed: (m,) [rad/s] of the motor outputs that the directions were judged by.
        certainty: sigma (m,), -1 to 1, how surely each gear turns and which way.
        status: how the tick ended.
        message: what was in the way, empty when nothing was; of a solved tick the limit passed.
        solve_time: [s] in the solver; of a usual tick from the state to the torques, one call.
        tick_time: [s] of the whole tick.
        rounds: programs solved; more than one where a predicted direction was revised.
        iterations: of the solvers, counted as `ControllerSettings.max_iterations` counts them.
        solution: of the last program, None where none was solved.
        prospect: the `SolvedLevel` that other fields are read from, None where they are given.
        refused: the program where it has no usable solution, for `explain`; None elsewhere.
        passed: limit of a joint or distance -> by how much [rad/s^2, m/s^2] the acceleration is
            beyond it, because nothing that the motors and the ground can do keeps it.
    """

    rotor_torque: FloatArray
    acceleration: FloatArray
    consistent: bool
    output_torque: FloatArray
    mesh_torque: FloatArray
    expected_speed: FloatArray
    certainty: FloatArray
    status: Status
    message: str
    solve_time: float
    tick_time: float
    rounds: int
    iterations: int
    solution: QPSolution | None
    prospect: Any = field(repr=False)
    refused: Refused | None = None
    passed: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of(cls, **fields: Any) -> Command:
        """Return a command of some fields, the others as its prospect has them.

        This takes a third of the time of the class itself: a frozen dataclass sets its fields one
        by one through `object.__setattr__`.
        """
        made = object.__new__(cls)
        object.__setattr__(made, "__dict__", fields)
        return made

    def __getattr__(self, name: str) -> Any:
        """Return a field that the command was made without."""
        prospect = self.__dict__.get("prospect")
        if prospect is None or name not in self.__dataclass_fields__:
            raise AttributeError(f"a command has no '{name}'.")
        found = self.__dict__[name] = prospect.field(name)
        return found

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields for a copy, with what the prospect leads to in its place."""
        found = {name: getattr(self, name) for name in self.__dataclass_fields__}
        return {**found, "forces": self.forces, "_targets": self._targets, "prospect": None}

    @cached_property
    def forces(self) -> Mapping[str, FloatArray]:
        """Force of every active contact.

        (3,) [N] in world axes for a point, (6,) [N, N m] in its frame for a surface.
        """
        return {} if self.prospect is None else self.prospect.forces()

    @property
    def position(self) -> FloatArray:
        """Positions (m,) [rad] of the driven joints one tick later.

        As the expected acceleration leads there: targets of drives with a loop of their own. A
        tick without a solution asks them to stay where they are; NaN where no state was ever known.
        """
        return self._targets[0]

    @property
    def velocity(self) -> FloatArray:
        """Velocities (m,) [rad/s] of the driven joints one tick later, see `position`."""
        return self._targets[1]

    @cached_property
    def _targets(self) -> tuple[FloatArray, FloatArray]:
        unknown = np.full(len(self.rotor_torque), np.nan)
        return (unknown, unknown) if self.prospect is None else self.prospect.targets()

    @property
    def directions(self) -> FloatArray:
        """`Direction` per gear (m,): FORWARD or BACKWARD where it surely turns under load.

        STUCK where the torque lies inside the interval that stiction holds.
        """
        return gear_directions(self.output_torque, self.certainty)

    @property
    def mesh_power(self) -> FloatArray:
        """Power (m,) [W] predicted into each mesh: mesh torque times expected motor speed."""
        return self.mesh_torque * self.expected_speed
