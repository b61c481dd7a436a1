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
from wbc.control.contact_set import FORCE_SCALE, ContactSet
from wbc.control.contacts import Contact
from wbc.control.direction_search import DirectionSearch, Found
from wbc.control.effects import EffectTorques
from wbc.control.gears import GearLaw, Slopes
from wbc.control.kinematics import Kinematics
from wbc.control.limits import JointLimit, RotorTorqueLimit
from wbc.control.plant import Plant
from wbc.control.program import ContactForceProgram
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
        tasks: Sequence[Task],
        contacts: Sequence[Contact] = (),
        limits: Sequence[RotorTorqueLimit | JointLimit] | None = None,
        settings: ControllerSettings | None = None,
    ) -> None:
        """Set the controller up.

        Args:
            robot: the robot model to obey; `robot.lossless()` makes a conservative controller.
            tasks: tasks with different names.
            contacts: contacts that may be active; all are, unless `step` says otherwise.
            limits: at most one of each kind; left out, the rotor torque limits hold.
            settings: the defaults when left out.

        Raises:
            ControlError: no tasks, two of one name, or one that does not fit the robot.
            RobotError: a contact, joint or frame that the robot does not have.
        """
        self.robot, self.tasks = robot, tuple(tasks)
        self.settings = ControllerSettings() if settings is None else settings
        _check_names("task", [task.name for task in self.tasks])
        _check_names("contact", [contact.name for contact in contacts])
        check_solver(self.settings.solver)
        if not self.tasks:
            raise ControlError("a controller without tasks has nothing to do.")
        limits = (RotorTorqueLimit(),) if limits is None else limits
        self._rotor_limit = _single(RotorTorqueLimit, limits)
        self._joint_limit = _single(JointLimit, limits)
        self._lean = _lean_robot(robot, contacts)
        self._space = Workspace(self._lean)
        self._kinematics = Kinematics(self._space.model)
        self._stack = TaskStack(robot, self.tasks)
        self._contacts = {contact.name: contact.bind(self._lean) for contact in contacts}
        self._plant = Plant(robot)
        self._law = GearLaw(robot.transmission, self.settings.rest_policy)
        self._effects = EffectTorques(robot)
        self._searches: dict[tuple[str, ...], DirectionSearch] = {}
        self._stage = RotorTorqueStage(
            robot.transmission,
            self._law,
            self.settings.solver,
            self.settings.tolerance,
            self.settings.max_iterations,
        )
        m = robot.transmission.size
        self._positive = np.zeros(m, dtype=bool)
        self._last = LastGood(np.zeros(m), None)
        self._expected = np.zeros(robot.model.nv)
        self._search: DirectionSearch | None = None

    @property
    def problem(self) -> QPProblem | None:
        """A copy of the program of the last tick, for inspection; None before the first."""
        return None if self._search is None else self._search.program.problem.copied()

    def reset(self) -> None:
        """Forget references, directions and the last good torque, as when newly made."""
        self._stack.forget()
        self._positive[:] = False
        self._expected = np.zeros(self.robot.model.nv)
        self._last = LastGood(np.zeros(self.robot.transmission.size), None)

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
        motion = Motion(state.position, state.velocity)
        given = _NO_REFERENCES if references is None else references
        problem = self._complaint(motion, given, contacts)
        if problem is not None:
            return self._safe(motion, problem[0], problem[1], start)
        try:
            return self._solve(motion, given, contacts, start)
        except (ValueError, TypeError, AttributeError, ControlError) as cause:
            return self._safe(motion, Status.BAD_INPUT, f"a reference does not fit: {cause}", start)

    def _complaint(
        self,
        motion: Motion,
        references: Mapping[str, Reference],
        contacts: Mapping[str, float] | None,
    ) -> tuple[Status, str] | None:
        model = self.robot.model
        q, v = motion.position, motion.velocity
        if np.shape(q) != (model.nq,) or np.shape(v) != (model.nv,):
            return Status.BAD_INPUT, (
                f"'{self.robot.name}' needs q of shape ({model.nq},) and v of shape ({model.nv},)."
            )
        if not (np.isfinite(q).all() and np.isfinite(v).all()):
            return Status.NOT_FINITE, "the state holds a value that is not finite."
        names = [task.name for task in self.tasks]
        for name, reference in references.items():
            if name not in names:
                return Status.BAD_INPUT, unknown_name("task", name, names)
            if not reference.is_finite():
                return Status.NOT_FINITE, f"the reference of task '{name}' is not finite."
        for name, limit in (contacts or {}).items():
            if name not in self._contacts:
                return Status.BAD_INPUT, unknown_name("contact", name, self._contacts)
            if not limit >= 0.0:
                return Status.BAD_INPUT, f"the force limit of contact '{name}' is {limit}."
        return None

    def _solve(
        self,
        motion: Motion,
        references: Mapping[str, Reference],
        contacts: Mapping[str, float] | None,
        start: float,
    ) -> Command:
        motion = self._effects.true_motion(motion)
        terms = evaluate(self._lean, motion.position, motion.velocity, self._space)
        self._kinematics.update(terms)
        self._stack.fill(self._kinematics, references)
        search = self._search_for(contacts)
        self._search = search
        program = search.program
        program.contacts.fill(self._kinematics)
        program.assemble_cost(self._stack)
        sigma, speed, expected = self._directions(terms, motion)
        program.assemble_dynamics()
        ceilings = _ceilings(program.contacts, contacts)
        program.assemble_limits(motion.position, motion.velocity, self.settings.time_step, ceilings)
        limits = self._torque_limits(motion, speed)
        slopes = self._law.slopes(sigma)
        if not np.isfinite(program.g).all() or not np.isfinite(program.b).all():
            return self._safe(motion, Status.NOT_FINITE, "the dynamics overflow here.", start)
        found = search.solve(self._positive, slopes, limits)
        status, message = self._judge(found, program)
        if not status.usable:
            return self._safe(motion, status, message, start, found)
        return self._realise(
            motion, program, found, sigma, slopes, limits, expected, status, message, start
        )

    def _search_for(self, contacts: Mapping[str, float] | None) -> DirectionSearch:
        names = tuple(self._contacts)
        if contacts is not None:
            names = tuple(name for name in names if contacts.get(name, 0.0) > 0.0)
        search = self._searches.get(names)
        if search is None:
            settings = self.settings
            active = ContactSet([self._contacts[name] for name in names], self.robot.model.nv)
            limited = np.isfinite(self.robot.transmission.torque_limit)
            if self._rotor_limit is None:
                limited = np.zeros_like(limited)
            program = ContactForceProgram(
                self._plant,
                active,
                limited,
                self._joint_limit,
                (settings.acceleration_weight, settings.force_weight),
            )
            search = DirectionSearch(
                program,
                settings.solver,
                settings.tolerance,
                settings.max_iterations,
                settings.max_rounds,
            )
            self._searches[names] = search
        return search

    def _directions(
        self, terms: Terms, motion: Motion
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Update the plant; return sigma (m,), measured and expected motor speed (m,)."""
        blend, step = self.settings.speed_blend, self.settings.time_step
        self._expected = blend.corrected(self._expected, motion.velocity, step)
        expected = self._plant.motor_speed(self._expected)
        speed = self._plant.motor_speed(motion.velocity)
        sigma = blend.certainty(expected)
        torque = self._effects.on_joints(motion, blend.certainty(self._expected))
        self._plant.update(terms, torque, speed, sigma)
        return sigma, speed, expected

    def _torque_limits(self, motion: Motion, speed: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the least and greatest N tau_phi (m,) that the motors themselves may give."""
        gears = self.robot.transmission
        ratio = gears.gear_ratio
        if self._rotor_limit is None:
            unlimited = np.full(gears.size, np.inf)
            return -unlimited, unlimited
        low, high = self._rotor_limit.bounds(self.robot, ratio * speed)
        added = self._effects.on_rotors(motion)
        if added is not None:
            low, high = low + added, high + added
        size = np.abs(ratio)
        return size * low, size * high

    def _judge(self, found: Found, program: ContactForceProgram) -> tuple[Status, str]:
        solution = found.solution
        if solution.status is QPStatus.SOLVED and np.isfinite(solution.x).all():
            return Status.SOLVED, ""
        problem = program.problem
        if solution.status is QPStatus.ITERATION_LIMIT and np.isfinite(solution.x).all():
            residual = solution.primal_residual(problem)
            if residual < 1e-4:
                return Status.INACCURATE, f"iteration limit, residual {residual:.1e}."
        conflict = Conflict.of(program)
        status = Status.INFEASIBLE if conflict.residual > 1e-4 else Status.FAILED
        return status, conflict.message

    def _realise(
        self,
        motion: Motion,
        program: ContactForceProgram,
        found: Found,
        sigma: FloatArray,
        slopes: Slopes,
        limits: tuple[FloatArray, FloatArray],
        expected: FloatArray,
        status: Status,
        message: str,
        start: float,
    ) -> Command:
        x, plant = found.solution.x, self._plant
        acceleration = x[: program.nv].copy()
        share = plant.rotor @ acceleration + plant.rotor_bias
        torque, mesh = self._stage.solve(found.output, share, sigma, slopes, limits)
        directions = self._law.directions(found.output, sigma)
        self._positive = found.output > 0.0
        self._expected = self._expected + self.settings.time_step * acceleration
        self._last = LastGood(torque, self._motor_position(motion))
        forces = x[program.nv :] * FORCE_SCALE
        set_ = program.contacts
        elapsed = perf_counter() - start
        deadline = self.settings.deadline
        if deadline is not None and elapsed > deadline:
            status, message = Status.LATE, f"{1e3 * elapsed:.2f} ms of {1e3 * deadline:.2f} ms."
        return Command(
            rotor_torque=self._to_drive(motion, torque),
            acceleration=acceleration,
            forces={
                contact.name: contact.wrench(forces[rows])
                for contact, rows in zip(set_.contacts, set_.slices, strict=True)
            },
            directions=directions,
            consistent=self._law.consistent(directions, found.output, mesh),
            output_torque=found.output,
            mesh_power=mesh * expected,
            expected_speed=expected,
            status=status,
            message=message,
            solve_time=found.solve_time,
            tick_time=perf_counter() - start,
            rounds=found.rounds,
            solution=found.solution,
        )

    def _to_drive(self, motion: Motion, torque: FloatArray) -> FloatArray:
        """Return the drive command (m,) that puts N tau_phi = `torque` on the rotors."""
        rotor = torque / self.robot.transmission.gear_ratio
        added = self._effects.on_rotors(motion)
        if added is not None:
            rotor = rotor - added
        return self._effects.to_drive(motion, rotor)

    def _motor_position(self, motion: Motion) -> FloatArray:
        driven = motion.position[self.robot.actuated_position]
        inverse = self._plant.motor_from_joint
        return driven if inverse is None else inverse @ driven

    def _safe(
        self,
        motion: Motion,
        status: Status,
        message: str,
        start: float,
        found: Found | None = None,
    ) -> Command:
        gears = self.robot.transmission
        m, nv = gears.size, self.robot.model.nv
        unknown = np.full(m, np.nan)
        fits = np.shape(motion.velocity) == (nv,) and np.shape(motion.position) == (
            self.robot.model.nq,
        )
        speed = self._plant.motor_speed(motion.velocity) if fits else unknown
        position = self._motor_position(motion) if fits else unknown
        torque = self.settings.safety.rotor_torque(self._last, position, speed)
        limit = np.abs(gears.gear_ratio) * gears.torque_limit
        torque = np.minimum(np.maximum(torque, -limit), limit)
        clean = bool(np.isfinite(speed).all() and np.isfinite(position).all())
        rotor = self._to_drive(motion, torque) if clean else torque / gears.gear_ratio
        return Command(
            rotor_torque=rotor,
            acceleration=np.zeros(nv),
            forces={},
            directions=np.zeros(m),
            consistent=False,
            output_torque=np.zeros(m),
            mesh_power=np.zeros(m),
            expected_speed=np.zeros(m),
            status=status,
            message=message,
            solve_time=0.0 if found is None else found.solve_time,
            tick_time=perf_counter() - start,
            rounds=0 if found is None else found.rounds,
            solution=None if found is None else found.solution,
        )


def _check_names(kind: str, names: Sequence[str]) -> None:
    for name in names:
        if names.count(name) > 1:
            raise ControlError(f"two {kind}s are called '{name}'; names must differ.")


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


def _ceilings(active: ContactSet, contacts: Mapping[str, float] | None) -> FloatArray:
    if contacts is None:
        return np.full(len(active.contacts), np.inf)
    return np.array([contacts[contact.name] for contact in active.contacts])
