"""What one tick of the controller returns, and why it had no solution."""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from typing import Any, NamedTuple

import numpy as np
from proxsuite import proxqp

from wbc.arrays import FloatArray
from wbc.control.qp.solvers import QPProblem, QPSolution
from wbc.errors import ControlError
from wbc.transmission import Direction


class Refused(NamedTuple):
    """A program without a usable solution, and the `Program` that names its rows."""

    problem: QPProblem
    names: Any


class Status(Enum):
    """How a tick ended.

    Attributes:
        usable: whether the rotor torque is that of the program, not the safe one.
    """

    SOLVED = "solved"
    INACCURATE = "inaccurate"
    LATE = "late"
    INFEASIBLE = "infeasible"
    FAILED = "failed"
    NOT_FINITE = "not finite"
    BAD_INPUT = "bad input"

    def __init__(self, told: str) -> None:
        """Tell those with the program's torque; a property would take 2 us of every tick."""
        self.usable = told in ("solved", "inaccurate", "late")


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
        forces: by name of every active contact, (3,) [N] in world axes for a point, (6,) [N, N m]
            in its frame for a surface.
        position, velocity: of the driven joints (m,) [rad], [rad/s] one tick later, as the expected
            acceleration leads there: targets of drives with a loop of their own. A tick without a
            solution asks them to stay where they are; NaN where no state was ever known.
        prospect: the `LevelAnswer` that fields are read from which are not given; None where all
            are.
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
    forces: Mapping[str, FloatArray]
    position: FloatArray
    velocity: FloatArray
    refused: Refused | None
    passed: Mapping[str, float]
    prospect: Any

    def __init__(self, **fields: Any) -> None:
        """Take some fields; the others are read from `prospect`, which is one of these."""
        self.__dict__ = fields

    def __getattr__(self, name: str) -> Any:
        """Return a field that the command was made without."""
        prospect = self.__dict__.get("prospect")
        if prospect is None or name not in Command.__annotations__:
            raise AttributeError(f"a command has no '{name}'.")
        found = self.__dict__[name] = prospect.field(name)
        return found

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields for a copy, with what the prospect leads to in its place."""
        return {name: getattr(self, name) for name in Command.__annotations__} | {"prospect": None}

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


_KEPT = 1e-4


def gear_directions(output: FloatArray, sigma: FloatArray) -> FloatArray:
    """Return the `Direction` of each gear (m,): STUCK unless it surely turns under load."""
    return np.where(np.abs(sigma) >= 1.0, np.sign(output * sigma), float(Direction.STUCK))


def explain(command: Command) -> str:
    """Return in one sentence why a tick had no solution; empty where nothing is in the way.

    For a program whose constraints contradict one another it names the one that the
    closest-to-feasible motion breaks most, and by how much. It solves a second program, which may
    break constraints in the least-squares sense and take a hundred times as long as a tick: ask
    outside the loop.

    Raises:
        ControlError: this is no command.
    """
    if not isinstance(command, Command):
        raise ControlError(f"explain takes a Command, got {type(command).__name__}.")
    if command.refused is None:
        return command.message
    problem, names = command.refused
    qp = proxqp.dense.QP(len(problem.g), len(problem.b), len(problem.lower))
    qp.settings.primal_infeasibility_solving = True
    qp.settings.max_iter = qp.settings.max_iter_in = 200
    qp.init(*problem)
    qp.solve()
    x = np.array(qp.results.x)
    if not np.isfinite(x).all():
        return "the program cannot be kept: its numbers are too large."
    rows = problem.C @ x
    beyond = np.maximum(np.maximum(rows - problem.upper, problem.lower - rows), 0.0)
    broken = np.concatenate([np.abs(problem.A @ x - problem.b), beyond])
    worst = int(np.argmax(broken)) if broken.size else -1
    if worst < 0 or broken[worst] <= _KEPT:
        return "a motion that keeps all constraints exists; the solver did not find it."
    name, scale, unit = names.label(worst, len(problem.b))
    return f"{name} cannot be kept: {scale * broken[worst]:.3g} {unit} missing."
