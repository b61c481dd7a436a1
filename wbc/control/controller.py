"""The controller: from a state and references to rotor torques, every tick."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from time import perf_counter
from typing import Protocol, TypeVar

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.command import Command, Status
from wbc.control.conflict import Conflict
from wbc.control.contacts import BoundContact, Contact
from wbc.control.direction_search import DirectionSearch, Found
from wbc.control.effects import EffectTorques
from wbc.control.efforts import ContactForceTask, Effort
from wbc.control.gears import GearLaw, gear_directions
from wbc.control.inputs import (
    all_finite,
    name_complaint,
    overflow_complaint,
    state_complaint,
)
from wbc.control.kinematics import Kinematics
from wbc.control.limits import JointLimit, RotorTorqueLimit
from wbc.control.motors import Motors
from wbc.control.plant import Plant
from wbc.control.program import ContactForceProgram
from wbc.control.program_library import ProgramLibrary, Recipe
from wbc.control.qp import QPProblem, QPStatus, check_solver
from wbc.control.reference import Reference
from wbc.control.safety import LastGood
from wbc.control.settings import ControllerSettings
from wbc.control.task_stack import TaskStack
from wbc.control.tasks import Task
from wbc.control.torque_stage import RotorTorqueStage
from wbc.dynamics import Terms, Workspace, evaluate
from wbc.errors import ControlError, unknown_name
from wbc.robot import Motion, Robot

_Limit = TypeVar("_Limit", RotorTorqueLimit, JointLimit)
_NO_REFERENCES: Mapping[str, Reference] = {}


class State(Protocol):
    """What the controller reads of a state: `wbc.robot.Motion` is one."""

    @property
    def position(self) -> FloatArray:
        """q (nq,)."""

    @property
    def velocity(self) -> FloatArray:
        """v (nv,)."""


class Controller:
    """Whole-body controller of a robot with lossy gears.

    Each tick solves the contact-force program (accelerations and contact forces under the
    dissipative equation of motion, see `ContactForceProgram`) and realises its output torques
    through the gears, in the direction of power that the solution itself has. The user owns the
    loop; `step` never raises.

    Attributes:
        robot: the robot, with the effects to compensate.
        tasks: what it should do.
        settings: everything else.
    """

    def __init__(
        self,
        robot: Robot,
        tasks: Sequence[Task | Effort | ContactForceTask],
        contacts: Sequence[Contact] = (),
        limits: Sequence[RotorTorqueLimit | JointLimit] | None = None,
        settings: ControllerSettings | None = None,
    ) -> None:
        """Set the controller up.

        Args:
            robot: the robot model to obey; `robot.lossless()` makes a conservative controller.
            tasks: tasks, efforts and contact-force tasks with different names; at least one
                moves the robot at level 0.
            contacts: contacts that may be active; all are, unless `step` says otherwise.
            limits: at most one of each kind; left out, the rotor torque limits hold.
            settings: the defaults when left out.

        Raises:
            ControlError: no tasks, two of one name, or one that does not fit the robot.
            RobotError: a contact, joint or frame that the robot does not have.
        """
        self.robot, self.tasks = robot, tuple(tasks)
        self.settings = ControllerSettings() if settings is None else settings
        self._task_names = _checked_names("task", [task.name for task in self.tasks])
        _checked_names("contact", [contact.name for contact in contacts])
        check_solver(self.settings.solver)
        limits = (RotorTorqueLimit(),) if limits is None else limits
        self._lean = _lean_robot(robot, contacts)
        self._space = Workspace(self._lean)
        self._kinematics = Kinematics(self._space.model)
        self._stack, self._lower = _levels(robot, self.tasks)
        read = [point.name for point in self._lean.contacts]
        self._contacts = {contact.name: contact.bind(robot, read) for contact in contacts}
        self._plant = Plant(robot)
        self._law = GearLaw(robot.transmission, self.settings.rest_policy)
        self._effects = EffectTorques(robot)
        self._motors = Motors(robot, _single(RotorTorqueLimit, limits), self._effects)
        self._programs = ProgramLibrary(
            Recipe(
                plant=self._plant,
                contacts=self._contacts,
                limited=self._motors.limited,
                joint_limit=_single(JointLimit, limits),
                settings=self.settings,
                efforts=_checked_efforts(robot, self.tasks),
                force_tasks=_checked_force_tasks(self.tasks, self._contacts),
                locked=None if self._lower is None else self._stack.locks,
            )
        )
        self._stage = RotorTorqueStage(
            robot.transmission,
            self._law,
            self.settings.solver,
            self.settings.tolerance,
            self.settings.max_iterations,
        )
        self._search: DirectionSearch | None = None
        self.reset()

    @property
    def problem(self) -> QPProblem | None:
        """A copy of the program of the last tick, for inspection; None before the first."""
        return None if self._search is None else self._search.program.problem.copied()

    def reset(self) -> None:
        """Forget references, directions and the last good torque, as when newly made."""
        m = self.robot.transmission.size
        self._stack.forget()
        if self._lower is not None:
            self._lower.forget()
        self._positive = np.zeros(m, dtype=bool)
        self._output = np.zeros(m)
        self._expected = np.zeros(self.robot.model.nv)
        self._last = LastGood(np.zeros(m), None)

    def step(
        self,
        state: State,
        references: Mapping[str, Reference] | None = None,
        contacts: Mapping[str, float] | None = None,
    ) -> Command:
        """Return the rotor torques for a state; never raises.

        Args:
            state: position (nq,) and velocity (nv,), as the encoders report them.
            references: task name -> what it should do; see `TaskStack.fill` for those left out.
            contacts: name -> greatest normal force [N] of each active contact (infinite for no
                limit; a ramp lets a contact take up or give off its load). All contacts are
                active without limit when left out.
        """
        start = perf_counter()
        motion = Motion(np.asarray(state.position), np.asarray(state.velocity))
        given = _NO_REFERENCES if references is None else references
        complaint = state_complaint(self.robot, motion.position, motion.velocity)
        if complaint is None:
            complaint = name_complaint(given, self._task_names, contacts, self._contacts)
        if complaint is not None:
            return self._safe(motion, *complaint, start)
        motion = self._effects.true_motion(motion)
        terms = evaluate(self._lean, motion.position, motion.velocity, self._space)
        self._kinematics.update(terms)
        try:
            for stack in (self._stack, self._lower):
                if stack is not None:
                    stack.fill(self._kinematics, given)
        except (ValueError, TypeError, AttributeError) as cause:
            return self._safe(motion, Status.BAD_INPUT, f"a reference does not fit: {cause}", start)
        return self._solve(motion, terms, given, contacts, start)

    def _solve(
        self,
        motion: Motion,
        terms: Terms,
        references: Mapping[str, Reference],
        contacts: Mapping[str, float] | None,
        start: float,
    ) -> Command:
        levels = self._programs.levels(contacts)
        levels.upper.program.contacts.fill(self._kinematics)
        sigma, speed, expected = self._judge_speeds(terms, motion)
        limits = self._motors.bounds(motion, speed)
        slopes = self._law.slopes(sigma)
        found: Found | None = None
        for stack, search in ((self._stack, levels.upper), (self._lower, levels.lower)):
            if stack is None or search is None:
                continue
            program = search.program
            self._search = search
            program.assemble_cost(stack)
            program.assemble_forces(references)
            program.assemble_dynamics()
            program.assemble_limits(
                motion.position, motion.velocity, self.settings.time_step, contacts
            )
            if found is not None:
                program.assemble_lock(*self._stack.lock(found.acceleration))
                self._positive = found.output > 0.0
            if not all_finite(program.cost_gradient, program.b):
                return self._safe(motion, *overflow_complaint(references), start)
            found = search.solve(self._positive, slopes, limits, expected, self._output)
            status, message = _judged(found, program)
            if not status.usable:
                return self._safe(motion, status, message, start, found)
        if found is None:
            raise ControlError("no level has a program.")
        share = self._plant.rotor @ found.acceleration + self._plant.rotor_bias
        torque, mesh, exact = self._stage.solve(found.output, share, sigma, slopes, limits)
        self._remember(motion, found, torque)
        consistent = exact or self._law.consistent(
            gear_directions(found.output, sigma), found.output, mesh
        )
        gears = (mesh, expected, sigma)
        outcome = (status, message, consistent)
        return self._command(motion, program, found, torque, gears, outcome, start)

    def _judge_speeds(
        self, terms: Terms, motion: Motion
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Update the plant; return sigma (m,), measured and expected motor speed (m,)."""
        blend, plant = self.settings.speed_blend, self._plant
        self._expected = blend.corrected(self._expected, motion.velocity, self.settings.time_step)
        expected = plant.motor_speed(self._expected)
        speed = plant.motor_speed(motion.velocity)
        sigma = blend.certainty(expected)
        torque = None
        if self._effects.act_on_joints:
            torque = self._effects.on_joints(motion, blend.certainty(self._expected))
        plant.update(terms, torque, speed, sigma)
        return sigma, speed, expected

    def _remember(self, motion: Motion, found: Found, torque: FloatArray) -> None:
        self._positive = found.output > 0.0
        self._output = found.output
        self._expected = self._expected + self.settings.time_step * found.acceleration
        self._last = LastGood(torque, self._motors.position(motion))

    def _command(
        self,
        motion: Motion,
        program: ContactForceProgram,
        found: Found,
        torque: FloatArray,
        gears: tuple[FloatArray, FloatArray, FloatArray],
        outcome: tuple[Status, str, bool],
        start: float,
    ) -> Command:
        forces = found.solution.x[program.nv :] * program.force_scale
        set_ = program.contacts
        status, message, consistent = outcome
        elapsed = perf_counter() - start
        deadline = self.settings.deadline
        if deadline is not None and elapsed > deadline:
            status, message = Status.LATE, f"{1e3 * elapsed:.2f} ms of {1e3 * deadline:.2f} ms."
        return Command(
            rotor_torque=self._motors.to_drive(motion, torque),
            acceleration=found.acceleration,
            forces={
                contact.name: contact.wrench(forces[rows])
                for contact, rows in zip(set_.contacts, set_.slices, strict=True)
            },
            consistent=consistent,
            output_torque=found.output,
            mesh_torque=gears[0],
            expected_speed=gears[1],
            certainty=gears[2],
            status=status,
            message=message,
            solve_time=found.solve_time,
            tick_time=perf_counter() - start,
            rounds=found.rounds,
            solution=found.solution,
        )

    def _safe(
        self,
        motion: Motion,
        status: Status,
        message: str,
        start: float,
        found: Found | None = None,
    ) -> Command:
        m, nv = self.robot.transmission.size, self.robot.model.nv
        known = state_complaint(self.robot, motion.position, motion.velocity) is None
        unknown = np.full(m, np.nan)
        speed = self._plant.motor_speed(motion.velocity) if known else unknown
        position = self._motors.position(motion) if known else unknown
        torque = self.settings.safety.rotor_torque(self._last, position, speed)
        torque = self._motors.clipped(torque)
        if known:
            rotor = self._motors.to_drive(motion, torque)
        else:
            rotor = torque / self.robot.transmission.gear_ratio
        return Command(
            rotor_torque=rotor,
            acceleration=np.zeros(nv),
            forces={},
            consistent=False,
            output_torque=np.zeros(m),
            mesh_torque=np.zeros(m),
            expected_speed=np.zeros(m),
            certainty=np.zeros(m),
            status=status,
            message=message,
            solve_time=0.0 if found is None else found.solve_time,
            tick_time=perf_counter() - start,
            rounds=0 if found is None else found.rounds,
            solution=None if found is None else found.solution,
        )


def _judged(found: Found, program: ContactForceProgram) -> tuple[Status, str]:
    """Return how usable a solution is, and what is in its way."""
    solution = found.solution
    if not all_finite(solution.x):
        return Status.FAILED, "the solver returned values that are not finite."
    if solution.status is QPStatus.SOLVED:
        return Status.SOLVED, ""
    if solution.status is QPStatus.ITERATION_LIMIT:
        residual = solution.primal_residual(program.problem)
        if residual < 1e-4:
            return Status.INACCURATE, f"iteration limit, residual {residual:.1e}."
    conflict = Conflict.of(program)
    status = Status.INFEASIBLE if conflict.residual > 1e-4 else Status.FAILED
    return status, conflict.message


def _checked_names(kind: str, names: Sequence[str]) -> frozenset[str]:
    for name in names:
        if names.count(name) > 1:
            raise ControlError(f"two {kind}s are called '{name}'; names must differ.")
    return frozenset(names)


def _levels(robot: Robot, tasks: Sequence[object]) -> tuple[TaskStack, TaskStack | None]:
    """Return the stacks of level 0 and of level 1, the latter None where it has no task."""
    moving = [task for task in tasks if isinstance(task, Task)]
    upper = [task for task in moving if task.level == 0]
    lower = [task for task in moving if task.level == 1]
    if not upper:
        raise ControlError("a controller without tasks of level 0 has nothing to do.")
    return TaskStack(robot, upper), TaskStack(robot, lower) if lower else None


def _checked_efforts(robot: Robot, tasks: Sequence[object]) -> tuple[Effort, ...]:
    efforts = tuple(task for task in tasks if isinstance(task, Effort))
    for effort in efforts:
        effort.check(robot)
    return efforts


def _checked_force_tasks(
    tasks: Sequence[object], contacts: Mapping[str, BoundContact]
) -> tuple[ContactForceTask, ...]:
    found = tuple(task for task in tasks if isinstance(task, ContactForceTask))
    for task in found:
        if task.contact not in contacts:
            raise ControlError(
                f"task '{task.name}': " + unknown_name("contact", task.contact, contacts)
            )
    return found


def _single(kind: type[_Limit], limits: Sequence[object]) -> _Limit | None:
    found = [limit for limit in limits if isinstance(limit, kind)]
    if len(found) > 1:
        raise ControlError(f"at most one {kind.__name__} can be given.")
    return found[0] if found else None


def _lean_robot(robot: Robot, contacts: Sequence[Contact]) -> Robot:
    """Return the robot with only those contact points that the contacts read each tick."""
    wanted = [name for contact in contacts for name in contact.points()]
    for name in wanted:
        robot.contact(name)
    points = tuple(point for point in robot.contacts if point.name in wanted)
    return replace(robot, contacts=points)
