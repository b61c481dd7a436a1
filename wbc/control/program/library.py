"""One program and one solver per set of active contacts, made when first needed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from wbc.arrays import BoolArray
from wbc.control.contacts import BoundContact
from wbc.control.contacts.contact_ranks import ContactRanks
from wbc.control.contacts.contact_set import ContactSet
from wbc.control.efforts import ContactForceTask, Effort
from wbc.control.kinematics import Kinematics
from wbc.control.limits import CollisionRows, JointLimit
from wbc.control.output_torques import OutputTorques
from wbc.control.program.contact_force_program import ContactForceProgram
from wbc.control.program.level import Level
from wbc.control.program.level_lock import LevelLock, greatest_lock
from wbc.control.program.task_stack import TaskStack
from wbc.control.program.usual_tick import UsualTick
from wbc.control.settings import ControllerSettings
from wbc.control.solvers import DualActiveSet
from wbc.control.solvers.cascade import Cascade
from wbc.control.solvers.warm_start import WarmStart
from wbc.control.torque.direction_search import DirectionSearch
from wbc.control.torque.gears import GearLaw
from wbc.control.torque.motors import TorqueBounds
from wbc.control.torque.torque_stage import RotorTorqueStage

# Tolerances by which a level may at most be beyond a bound, which the next one then lets pass.
_SLACK = 30.0
_FEW = 4


@dataclass(frozen=True, eq=False)
class Recipe:
    """What the programs of a controller are made of.

    Attributes:
        plant: the dynamics.
        kinematics: of the controller; moved about once when programs are first made.
        contacts: every contact there may be, by name.
        limited: (m,) bool, gears that have a torque limit.
        joint_limit: limits of joints, or None.
        collision: distances to keep, or None.
        settings: of the controller.
        efforts: costs on torques, which the least important level bears.
        force_tasks: costs on contact forces, likewise.
        stacks: tasks by level, the most important first.
        law: of the meshes.
        bounds: least and greatest N tau_phi (m,) [N m] where no effect acts within a tick and they
            are always the same, so that ticks may be usual; None elsewhere.
        stage: what finds the rotor torques.
    """

    plant: OutputTorques
    kinematics: Kinematics
    contacts: Mapping[str, BoundContact]
    limited: BoolArray
    joint_limit: JointLimit | None
    collision: CollisionRows | None
    settings: ControllerSettings
    efforts: Sequence[Effort]
    force_tasks: Sequence[ContactForceTask]
    stacks: tuple[TaskStack, ...]
    law: GearLaw
    bounds: TorqueBounds | None
    stage: RotorTorqueStage


class ProgramLibrary:
    """Keeps the programs of the contact sets met so far, each with its own warm start.

    With up to four contacts those of all sets are made at once, so that no tick has to: one takes
    as long as ten ticks.
    """

    def __init__(self, recipe: Recipe) -> None:
        """Remember what programs are made of."""
        self._recipe = recipe
        self._all = tuple(recipe.contacts)
        self._ranks = ContactRanks(recipe.plant.robot, recipe.kinematics, recipe.contacts)
        self._made: dict[tuple[str, ...], tuple[Level, ...]] = {}
        self._last: tuple[dict[str, float] | None, tuple[Level, ...]] | None = None
        if len(self._all) <= _FEW:
            for count in range(len(self._all) + 1):
                for names in combinations(self._all, count):
                    self._of(names)

    def forget(self) -> None:
        """Start the next tick of every contact set from nothing."""
        for levels in self._made.values():
            for level in levels:
                level.forget()

    def levels(self, active: Mapping[str, float] | None) -> tuple[Level, ...]:
        """Return the levels for the contacts that may carry force, all when None."""
        if self._last is not None and active == self._last[0]:
            return self._last[1]
        names = self._all
        if active is not None:
            names = tuple([name for name in names if active.get(name, 0.0) > 0.0])
        levels = self._of(names)
        self._last = None if active is None else dict(active), levels
        return levels

    def _of(self, names: tuple[str, ...]) -> tuple[Level, ...]:
        """Return the levels for some contacts, in the order of all."""
        levels = self._made.get(names)
        if levels is None:
            recipe = self._recipe
            chosen = [recipe.contacts[name] for name in names]
            contacts = ContactSet(chosen, recipe.kinematics.model, self._ranks.rank(names))
            levels = tuple(self._level(contacts, rank) for rank in range(len(recipe.stacks)))
            self._made[names] = levels
        return levels

    def _level(self, contacts: ContactSet, rank: int) -> Level:
        recipe, settings = self._recipe, self._recipe.settings
        last = rank == len(recipe.stacks) - 1
        tasks, above = recipe.stacks[rank], recipe.stacks[:rank]
        program = ContactForceProgram(
            recipe.plant,
            contacts,
            recipe.limited,
            recipe.joint_limit,
            (settings.acceleration_weight, settings.force_weight),
            recipe.efforts if last else (),
            recipe.force_tasks if last else (),
            greatest_lock(above),
            len(tasks.wanted),
            rank * _SLACK * settings.tolerance,
            any(bool(np.isinf(task.weight).any()) for task in tasks.tasks),
            recipe.collision,
        )
        own_first = settings.warm_start is WarmStart.ACTIVE_SET
        whole, gears = len(program.rows.labels), len(program.gears)
        search = DirectionSearch(
            program,
            _cascade(program, settings, whole, own_first),
            _cascade(program, settings, whole + gears, own_first),
            settings.max_rounds,
        )
        guess = _own_solver(program, settings, whole - gears) if own_first else None
        lock = LevelLock(program, tasks, above, settings.tolerance) if above else None
        return Level(
            tasks,
            program,
            lock,
            search,
            guess,
            recipe.law,
            recipe.stage,
            settings.tolerance,
            self._usual(tasks, program, guess),
        )

    def _usual(
        self, tasks: TaskStack, program: ContactForceProgram, guess: DualActiveSet | None
    ) -> UsualTick | None:
        """Return what does a usual tick in one call, None where parts are to be asked."""
        recipe = self._recipe
        alone = len(recipe.stacks) == 1 and recipe.kinematics.memory is not None
        known = program.is_fixed and program.contacts.is_known
        known = known and not recipe.plant.robot.rotors_turn_with_links
        if guess is None or recipe.bounds is None or not alone or not known:
            return None
        blend = recipe.settings.speed_blend
        return UsualTick(recipe.kinematics, tasks, program, guess, recipe.law, blend, recipe.bounds)


def _own_solver(
    program: ContactForceProgram, settings: ControllerSettings, inequalities: int
) -> DualActiveSet | None:
    """Return the controller's own solver, None where the program's diagonal has zeros."""
    if not settings.force_weight > 0.0:
        return None
    return DualActiveSet(
        program.n,
        program.most_rows,
        inequalities,
        program.more_rows,
        tolerance=settings.tolerance,
        max_iterations=settings.max_iterations,
    )


def _cascade(
    program: ContactForceProgram, settings: ControllerSettings, inequalities: int, own_first: bool
) -> Cascade:
    return Cascade(
        _own_solver(program, settings, inequalities),
        settings.solver,
        own_first=own_first,
        tolerance=settings.tolerance,
        max_iterations=settings.max_iterations,
    )
