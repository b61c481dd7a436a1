"""The controller: from a state and references to rotor torques, every tick."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from threading import Lock
from time import perf_counter
from typing import NoReturn

import numpy as np

from wbc.arrays import FloatArray
from wbc.compiled import make_ready
from wbc.control.admission import (
    checked_efforts,
    checked_force_tasks,
    checked_names,
    single_limit,
    stacks_by_level,
)
from wbc.control.command import Command, Refused, Status
from wbc.control.contacts import Contact
from wbc.control.disturbance import DisturbanceEstimate
from wbc.control.effects import EffectTorques
from wbc.control.efforts import ContactForceTask, Effort
from wbc.control.kinematics import Kinematics
from wbc.control.limits import CollisionLimit, CollisionRows, JointLimit, RotorTorqueLimit
from wbc.control.outcome import Outcome
from wbc.control.output_torques import OutputTorques
from wbc.control.program.level import Answer, Level, Refusal, descend
from wbc.control.program.library import ProgramLibrary, Recipe
from wbc.control.program.usual_tick import DONE
from wbc.control.reference import Reference
from wbc.control.safety.fallback import Fallback
from wbc.control.safety.inputs import (
    Complaint,
    StateCheck,
    size_complaint,
    step_complaint,
)
from wbc.control.safety.standing import Standing
from wbc.control.settings import ControllerSettings
from wbc.control.solvers import QPProblem, check_solver
from wbc.control.state import State
from wbc.control.tasks import Task
from wbc.control.tick import InputCheck, ReadyTick, RefusedTick, TickInputs
from wbc.control.torque.direction_search import DirectedSolution
from wbc.control.torque.gears import GearLaw, GearState
from wbc.control.torque.motors import Motors
from wbc.control.torque.speed import SpeedBlend
from wbc.control.torque.torque_stage import RotorTorqueStage
from wbc.errors import ControlError
from wbc.robot import Motion, Robot

_BUSY: Complaint = (
    Status.BAD_INPUT,
    "step is called while another thread is in it; give every thread a controller of its own.",
)
_NO_REFERENCES: Mapping[str, Reference] = {}


class Controller:
    """Whole-body controller of a robot with lossy gears.

    Each tick solves the contact-force program (accelerations and contact forces under the
    dissipative equation of motion, see `ContactForceProgram`) and realises its output torques
    through the gears, in the direction of power that the solution itself has. The user owns the
    loop; `step` never raises. One thread at a time may be in `step`; a second one gets the last
    good torque and is told so.

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
        limits: Sequence[RotorTorqueLimit | JointLimit | CollisionLimit] | None = None,
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
        make_ready("wbc.control")
        self.robot, self.tasks = robot, tuple(tasks)
        self.settings = ControllerSettings() if settings is None else settings
        names = checked_names("task", [task.name for task in self.tasks])
        checked_names("contact", [contact.name for contact in contacts])
        check_solver(self.settings.solver)
        limits = (RotorTorqueLimit(),) if limits is None else limits
        self._states = StateCheck(robot)
        self._contacts = {contact.name: contact.bind(robot) for contact in contacts}
        frames = [f for bound in self._contacts.values() for f in bound.frames(robot.model)]
        self._kinematics = Kinematics(robot, frames)
        self._stacks = stacks_by_level(robot, self.tasks, self._kinematics.model)
        self._plant = OutputTorques(robot)
        self._law = GearLaw(
            robot.transmission, self.settings.rest_policy, self.settings.rest_margin
        )
        self._effects = EffectTorques(robot)
        self._disturbance = DisturbanceEstimate(robot, self.settings.disturbance)
        self._motors = Motors(robot, single_limit(RotorTorqueLimit, limits), self._effects)
        self._outcome = Outcome(self._law, self._motors, self.settings.deadline)
        self._fallback = Fallback(
            robot,
            self._plant,
            self._motors,
            Standing(robot, self._effects, frames),
            self.settings.safety,
            tuple(self._contacts.values()),
        )
        force_tasks = checked_force_tasks(self.tasks, self._contacts)
        weighed = frozenset(task.name for task in self.tasks if isinstance(task, Task))
        self._inputs = InputCheck(names, weighed, self._contacts, force_tasks)
        joint_limit = single_limit(JointLimit, limits)
        apart = single_limit(CollisionLimit, limits)
        self._collision = None if apart is None else CollisionRows(apart, self._kinematics.model)
        self._brakes = joint_limit is not None and joint_limit.braking is not None
        asks = self._effects.act_within_ticks or self._brakes or self._disturbance.on
        self._programs = ProgramLibrary(
            Recipe(
                plant=self._plant,
                kinematics=self._kinematics,
                contacts=self._contacts,
                limited=self._motors.limited,
                joint_limit=joint_limit,
                collision=self._collision,
                settings=self.settings,
                efforts=checked_efforts(robot, self.tasks),
                force_tasks=force_tasks,
                stacks=self._stacks,
                law=self._law,
                bounds=None if asks else self._motors.constant,
                stage=RotorTorqueStage(
                    robot.transmission,
                    self._law,
                    self.settings.solver,
                    self.settings.tolerance,
                    self.settings.max_iterations,
                ),
            )
        )
        self._free = Lock()
        self._level: Level | None = None
        self._gears: GearState | None = None
        self.reset()

    @property
    def problem(self) -> QPProblem | None:
        """A copy of the program of the last tick, for inspection; None before the first."""
        return None if self._level is None else self._level.problem(self._gears)

    @property
    def disturbance(self) -> FloatArray:
        """A copy of the torque (nv,) [N m, N] that the observer has learned, zero without one."""
        return self._disturbance.torque.copy()

    def __reduce__(self) -> NoReturn:
        """Raise TypeError: the parts of a controller share memory that a copy would tear apart."""
        raise TypeError(
            "a Controller is neither copied nor pickled; make another one of the same robot, "
            "tasks, contacts, limits and settings."
        )

    def reset(self) -> None:
        """Forget references, directions and the last good torque, as when newly made."""
        m = self.robot.transmission.size
        for stack in self._stacks:
            stack.forget()
        self._output = np.zeros(m)
        self._anchors: Mapping[str, FloatArray] = {}
        self._expected = np.zeros(self.robot.model.nv)
        self._disturbance.forget()
        self._fallback.forget()
        self._plant.forget()
        self._programs.forget()

    def step(
        self,
        state: State,
        references: Mapping[str, Reference] | None = None,
        contacts: Mapping[str, float] | None = None,
        *,
        weights: Mapping[str, float] | None = None,
        activation: Mapping[str, float] | None = None,
        dt: float | None = None,
    ) -> Command:
        """Return the rotor torques for a state; never raises.

        Args:
            state: position (nq,) and velocity (nv,), as the encoders report them.
            references: task name -> what it should do; see `TaskStack.fill` for those left out.
            contacts: name -> greatest normal force [N] of each active contact (infinite for no
                limit; a ramp lets a contact take up or give off its load). All contacts are
                active without limit when left out.
            weights: task name -> weight of all its rows in this tick, in place of the task's own.
            activation: task name -> 0 (off) to 1 (on, as when left out), what its weight is
                multiplied with; numbers in between blend a task in or out.
            dt: time until the next tick [s], at most 0.1; that of the settings when left out.
        """
        start = perf_counter()
        if not self._free.acquire(blocking=False):
            return self._fallback.busy(_BUSY, start)
        try:
            step = self.settings.time_step if dt is None else dt
            wanted = _NO_REFERENCES if references is None else references
            given = TickInputs(state, wanted, contacts, weights, activation, step)
            return self._step(given, start)
        finally:
            self._free.release()

    def _step(self, given: TickInputs, start: float) -> Command:
        motion = None
        try:
            admitted = self._admitted(given.state)
            if not isinstance(admitted, Motion):
                return self._safe(None, admitted, given.dt, start)
            motion = admitted
            complaint = self._inputs.complaint(given)
            if complaint is not None:
                return self._safe(motion, complaint, given.dt, start)
            motion = self._effects.true_motion(motion)
            command = self._usual(motion, given, start)
            if command is not None:
                return command
            ready = self._prepare(motion, given)
            if isinstance(ready, RefusedTick):
                return self._safe(ready.motion, ready.complaint, given.dt, start)
            return self._solve(ready, start)
        except Exception as cause:  # what a hook, a task or an effect of the user's own may raise
            complaint = Status.FAILED, f"{type(cause).__name__}: {cause}"
            return self._safe(motion, complaint, given.dt, start)

    def build(
        self,
        state: State,
        references: Mapping[str, Reference] | None = None,
        contacts: Mapping[str, float] | None = None,
        *,
        weights: Mapping[str, float] | None = None,
        activation: Mapping[str, float] | None = None,
        dt: float | None = None,
    ) -> QPProblem:
        """Return the program of level 0 that `step` would solve first; nothing is remembered.

        Its torque limits stand in the directions of the last tick. Arguments as for `step`.

        Raises:
            ControlError: `step` would not solve a program for these arguments.
        """
        motion = self._admitted(state)
        if not isinstance(motion, Motion):
            raise ControlError(motion[1])
        step = self.settings.time_step if dt is None else dt
        wanted = _NO_REFERENCES if references is None else references
        given = TickInputs(state, wanted, contacts, weights, activation, step)
        complaint = self._inputs.complaint(given)
        if complaint is not None:
            raise ControlError(complaint[1])
        ready = self._prepare(self._effects.true_motion(motion), given)
        if isinstance(ready, RefusedTick):
            raise ControlError(ready.complaint[1])
        first = ready.levels[0]
        tick = ready.motion, ready.references, ready.contacts, ready.dt, ready.gears
        first.assemble(*tick, None)
        return first.built(ready.gears, self._output)

    def _admitted(self, state: State) -> Motion | Complaint:
        """Return the state that the settings' hook makes of a state, or what is wrong with it."""
        hook = self.settings.state_hook
        return self._states.admitted(state if hook is None else hook(state))

    def _usual(self, motion: Motion, given: TickInputs, start: float) -> Command | None:
        """Return the command of a tick that one call can do, None where parts are to be asked."""
        levels, dt = self._programs.levels(given.contacts), given.dt
        first, usual, asked = levels[0], levels[0].usual, given[1:5]
        try:
            passed = first.pass_usual(motion, asked, dt, self._expected, self._output)
        except ControlError as cause:
            return self._safe(motion, (Status.BAD_INPUT, str(cause)), dt, start)
        if passed is None or usual is None:
            return None
        self._level, self._gears = first, passed.gears
        block, at, active = passed.block, usual.at, first.program.contacts.contacts
        if passed.ended != DONE:
            self._expected = block[at.expected]
            ready = ReadyTick(
                *(motion, given.references, given.contacts, dt, levels),
                *(passed.gears, self._expected, self._disturbance.torque),
            )
            return self._finish(ready, first.finish(passed, self._output), start)
        self._hold_targets()
        self._expected, self._output, self._anchors = block[at.advanced], block[at.output], {}
        self._fallback.remember(block[at.position], block[at.torque], active)
        return self._outcome.usual(usual, passed, dt, start)

    def _prepare(self, motion: Motion, given: TickInputs) -> ReadyTick | RefusedTick:
        """Evaluate the state, tasks and contacts; remember nothing."""
        self._kinematics.update(motion.position, motion.velocity)
        if self._collision is not None:
            self._collision.fill(self._kinematics)
        try:
            for stack in self._stacks:
                stack.weigh(given.weights, given.activation)
                stack.fill(self._kinematics, given.references)
        except ControlError as cause:
            return RefusedTick(motion, (Status.BAD_INPUT, str(cause)))
        levels = self._programs.levels(given.contacts)
        levels[0].program.contacts.fill(self._kinematics, self._anchors)
        active, mass = levels[0].program.contacts.contacts, self._kinematics.mass_matrix
        disturbance = self._disturbance.updated(motion.velocity, mass, active)
        gears, expected = self._judge_speeds(motion, given.dt, disturbance)
        return ReadyTick(
            *(motion, given.references, given.contacts, given.dt),
            *(levels, gears, expected, disturbance),
        )

    def _solve(self, ready: ReadyTick, start: float) -> Command:
        self._expected, self._gears = ready.expected, ready.gears
        tick = ready.motion, ready.references, ready.contacts, ready.dt, ready.gears
        self._level, answer = descend(ready.levels, tick, self._output)
        return self._finish(ready, answer, start)

    def _finish(self, ready: ReadyTick, answer: Answer | Refusal, start: float) -> Command:
        """Return the command of an answer, the safe one for a refusal; remember either."""
        motion, levels, gears = ready.motion, ready.levels, ready.gears
        if isinstance(answer, Refusal):
            complaint = answer.complaint or size_complaint(ready.references)
            if complaint[0] is not Status.NOT_FINITE:
                self._hold_targets()
            refused = None
            if answer.found is not None:
                refused = Refused(answer.level.program.blocks.copied(), answer.level.program)
            return self._safe(motion, complaint, ready.dt, start, answer.found, refused)
        self._hold_targets()
        self._remember(ready, answer)
        return self._outcome.command(levels[0].program, answer, gears, motion, ready.dt, start)

    def _judge_speeds(
        self, motion: Motion, dt: float, disturbance: FloatArray
    ) -> tuple[GearState, FloatArray]:
        """Update the plant; return what is known of the gears, and the expected v (nv,)."""
        blend, plant = self.settings.speed_blend, self._plant
        expected, turning, speed, sigma = blend.judged(
            self._expected, motion.velocity, dt, self.robot.actuated, plant.from_joints
        )
        torque = None
        if self._effects.act_on_joints:
            torque = self._effects.on_joints(motion, blend.certainty(expected))
        if self._disturbance.on:
            torque = disturbance if torque is None else torque + disturbance
        if self._effects.act_on_gears:
            self._law.follow(*self.robot.gear_efficiencies(motion))
        plant.update(self._kinematics, torque, speed, sigma)
        limits = self._motors.bounds(motion, speed)
        return GearState(sigma, limits, turning, self._output), expected

    def _hold_targets(self) -> None:
        for stack in self._stacks:
            stack.remember()

    def _remember(self, ready: ReadyTick, answer: Answer) -> None:
        self._output = answer.found.output
        self._expected = SpeedBlend.advanced(self._expected, answer.found.acceleration, ready.dt)
        active = ready.levels[0].program.contacts.contacts
        self._fallback.remember(ready.motion.position.copy(), answer.realised.torque, active)
        self._anchors = ready.levels[0].program.contacts.anchored(self._anchors)
        if self._disturbance.on:
            self._disturbance.remember(
                *(ready.disturbance, ready.motion.velocity, answer.found.acceleration),
                *(ready.dt, active),
            )
        if self._brakes:
            self._plant.remember(answer.found.acceleration, answer.found.output)

    def _safe(
        self,
        motion: Motion | None,
        complaint: Complaint,
        dt: float,
        start: float,
        found: DirectedSolution | None = None,
        refused: Refused | None = None,
    ) -> Command:
        self._disturbance.interrupt()
        step = dt if step_complaint(dt) is None else self.settings.time_step
        return self._fallback.command(motion, complaint, step, start, found, refused)
