"""The controller: from a state and references to rotor torques, every tick."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from time import perf_counter

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.admission import (
    checked_efforts,
    checked_force_tasks,
    checked_names,
    single_limit,
    stacks_by_level,
)
from wbc.control.command import Command, Status
from wbc.control.contacts import Contact
from wbc.control.effects import EffectTorques
from wbc.control.efforts import ContactForceTask, Effort
from wbc.control.kinematics import Kinematics
from wbc.control.limits import JointLimit, RotorTorqueLimit
from wbc.control.outcome import Outcome
from wbc.control.plant import Plant
from wbc.control.program.level import Answer, GearState, Level, Refusal
from wbc.control.program.library import ProgramLibrary, Recipe
from wbc.control.reference import Reference
from wbc.control.safety.fallback import Fallback
from wbc.control.safety.inputs import (
    Complaint,
    as_motion,
    name_complaint,
    overflow_complaint,
    state_complaint,
)
from wbc.control.settings import ControllerSettings
from wbc.control.solvers import QPProblem, check_solver
from wbc.control.state import State
from wbc.control.tasks import Task
from wbc.control.torque.direction_search import Found
from wbc.control.torque.gears import GearLaw
from wbc.control.torque.motors import Motors
from wbc.control.torque.speed import SpeedBlend
from wbc.control.torque.torque_stage import RotorTorqueStage
from wbc.robot import Motion, Robot

_NO_REFERENCES: Mapping[str, Reference] = {}


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
        self._task_names = checked_names("task", [task.name for task in self.tasks])
        checked_names("contact", [contact.name for contact in contacts])
        check_solver(self.settings.solver)
        limits = (RotorTorqueLimit(),) if limits is None else limits
        self._stacks = stacks_by_level(robot, self.tasks)
        self._contacts = {contact.name: contact.bind(robot) for contact in contacts}
        frames = [f for bound in self._contacts.values() for f in bound.frames(robot.model)]
        self._kinematics = Kinematics(robot, frames)
        self._plant = Plant(robot)
        self._law = GearLaw(robot.transmission, self.settings.rest_policy)
        self._effects = EffectTorques(robot)
        self._motors = Motors(robot, single_limit(RotorTorqueLimit, limits), self._effects)
        self._outcome = Outcome(self._law, self._motors, self.settings.deadline)
        self._fallback = Fallback(robot, self._plant, self._motors)
        joint_limit = single_limit(JointLimit, limits)
        self._brakes = joint_limit is not None and joint_limit.braking is not None
        self._programs = ProgramLibrary(
            Recipe(
                plant=self._plant,
                contacts=self._contacts,
                limited=self._motors.limited,
                joint_limit=joint_limit,
                settings=self.settings,
                efforts=checked_efforts(robot, self.tasks),
                force_tasks=checked_force_tasks(self.tasks, self._contacts),
                stacks=self._stacks,
                law=self._law,
                stage=RotorTorqueStage(
                    robot.transmission,
                    self._law,
                    self.settings.solver,
                    self.settings.tolerance,
                    self.settings.max_iterations,
                ),
            )
        )
        self._level: Level | None = None
        self._gears: GearState | None = None
        self.reset()

    @property
    def problem(self) -> QPProblem | None:
        """A copy of the program of the last tick, for inspection; None before the first."""
        return None if self._level is None else self._level.problem(self._gears)

    def reset(self) -> None:
        """Forget references, directions and the last good torque, as when newly made."""
        m = self.robot.transmission.size
        for stack in self._stacks:
            stack.forget()
        self._output = np.zeros(m)
        self._expected = np.zeros(self.robot.model.nv)
        self._fallback.forget()
        self._plant.forget()

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
        motion = as_motion(state)
        given = _NO_REFERENCES if references is None else references
        complaint = state_complaint(self.robot, motion.position, motion.velocity)
        if complaint is None:
            complaint = name_complaint(given, self._task_names, contacts, self._contacts)
        if complaint is not None:
            return self._safe(motion, complaint, start)
        motion = self._effects.true_motion(motion)
        self._kinematics.update(motion.position, motion.velocity)
        try:
            for stack in self._stacks:
                stack.fill(self._kinematics, given)
        except (ValueError, TypeError, AttributeError) as cause:
            complaint = Status.BAD_INPUT, f"a reference does not fit: {cause}"
            return self._safe(motion, complaint, start)
        return self._solve(motion, given, contacts, start)

    def _solve(
        self,
        motion: Motion,
        references: Mapping[str, Reference],
        contacts: Mapping[str, float] | None,
        start: float,
    ) -> Command:
        levels = self._programs.levels(contacts)
        levels[0].program.contacts.fill(self._kinematics)
        sigma, speed, expected = self._judge_speeds(motion)
        limits = self._motors.bounds(motion, speed)
        gears = GearState(sigma, limits, expected, self._output)
        answer = self._descend(levels, motion, references, contacts, gears)
        if isinstance(answer, Refusal):
            complaint = answer.complaint or overflow_complaint(references)
            return self._safe(motion, complaint, start, answer.found)
        self._remember(motion, answer)
        return self._outcome.command(levels[0].program, answer, gears, motion, start)

    def _descend(
        self,
        levels: Sequence[Level],
        motion: Motion,
        references: Mapping[str, Reference],
        contacts: Mapping[str, float] | None,
        gears: GearState,
    ) -> Answer | Refusal:
        """Solve one level after the other; one that finds nothing leaves it at those above."""
        first, *lower = levels
        self._level, self._gears = first, gears
        first.assemble(motion, references, contacts, None)
        answer = first.solve(gears, self._output)
        for level in lower:
            if isinstance(answer, Refusal):
                break
            found = answer.found
            level.assemble(motion, references, contacts, found.solution.x)
            deeper = level.solve(gears, found.output)
            if isinstance(deeper, Refusal) and deeper.complaint is not None:
                return answer.without_lower(deeper.complaint)
            self._level, answer = level, deeper
        return answer

    def _judge_speeds(self, motion: Motion) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Update the plant; return sigma (m,), measured and expected motor speed (m,)."""
        blend, plant = self.settings.speed_blend, self._plant
        self._expected = blend.corrected(self._expected, motion.velocity, self.settings.time_step)
        expected = plant.motor_speed(self._expected)
        speed = plant.motor_speed(motion.velocity)
        sigma = blend.certainty(expected)
        torque = None
        if self._effects.act_on_joints:
            torque = self._effects.on_joints(motion, blend.certainty(self._expected))
        plant.update(self._kinematics, torque, speed, sigma)
        return sigma, speed, expected

    def _remember(self, motion: Motion, answer: Answer) -> None:
        self._output = answer.found.output
        self._expected = SpeedBlend.advanced(
            self._expected, answer.found.acceleration, self.settings.time_step
        )
        self._fallback.remember(motion, answer.realised.torque)
        if self._brakes:
            self._plant.remember(answer.found.acceleration, answer.found.output)

    def _safe(
        self, motion: Motion, complaint: Complaint, start: float, found: Found | None = None
    ) -> Command:
        return self._fallback.command(self.settings.safety, motion, complaint, start, found)
