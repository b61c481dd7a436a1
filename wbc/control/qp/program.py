"""The contact-force program: accelerations and contact forces under the dissipative dynamics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import chain, pairwise
from math import sqrt
from typing import Any, TypeVar

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.compiled import OutDense, OutPlaces, OutRow, Places, Row, compiled, inner
from wbc.control.drivetrain import GearModel
from wbc.control.kinematics import Kinematics
from wbc.control.memory import COUNT, GEAR, NUMBER, PART, PROGRAM, ProgramMemory
from wbc.control.qp.active_set import SOLVER
from wbc.control.qp.linalg import extend_basis
from wbc.control.qp.lock_rows import LOCK
from wbc.control.qp.solvers import INFINITE, QPProblem, QPSolution
from wbc.control.rows.collision import CollisionLimit, CollisionRows
from wbc.control.rows.contacts import Contact, ContactSet
from wbc.control.rows.limits import Effort, JointLimit, RotorTorqueLimit
from wbc.control.rows.task_stack import TaskStack
from wbc.control.rows.tasks import Task
from wbc.control.settings import ControllerSettings
from wbc.errors import ControlError
from wbc.mechanics.linear import add_times, copy_to, dot
from wbc.robot import Robot

# Directions that move the rows less than this share are left to the tasks: near such a pose a
# metre per second squared at the rows would ask a million of the joints.
_WEAK = 1e-6
_REACH = 30.0  # tolerances
# Limits that give way cost FIRM times the heaviest task, and what costs less than that task over
# FIRM is raised to it while bounds that bind are looked for: with costs that span more decades daqp
# needs more iterations and calls programs infeasible that are not. With 5, 10 and 30 it takes 78,
# 84 and 93 in the mean of 5000 hostile ticks of Talos, and one passed limit in twenty is passed
# 9, 3 and 0 % farther.
FIRM = 1e1
Label = tuple[str, float, str]
"""What a row is called in messages, and scale and unit of a violation."""
_TOLD = 0.01  # share of the largest passing from which a limit counts as passed


class Recipe:
    """What the programs of a controller are made of.

    Attributes:
        robot: the robot.
        settings: of the controller.
        contacts: that may be active, by name.
        kinematics: of the controller.
        drivetrain: what is between gears and motors.
        efforts, effort_kinds: see PROGRAM; the least important level bears them.
        collision: distances to keep, or None.
        joint_limit: limits of joints, or of none.
        joints: their JOINTS.
        stacks: tasks by level, the most important first.
        asks_ahead: whether every state is asked for more than the joints' motion before a tick.
    """

    def __init__(
        self,
        robot: Robot,
        tasks: Sequence[Task | Effort],
        contacts: Sequence[Contact],
        limits: Sequence[RotorTorqueLimit | JointLimit | CollisionLimit],
        settings: ControllerSettings,
    ) -> None:
        """Take the arguments of a `Controller`; errors as there."""
        self.robot, self.settings = robot, settings
        for kind, things in (("task", tasks), ("contact", contacts)):
            names = [one.name for one in things]
            if twice := [name for name in names if names.count(name) > 1]:
                raise ControlError(f"two {kind}s are called '{twice[0]}'; names must differ.")
        self.contacts = {contact.name: contact.bind(robot) for contact in contacts}
        frames = [frame for contact in self.contacts.values() for frame in contact.frames]
        self.kinematics = Kinematics(robot, frames)
        model, rotors = self.kinematics.model, _single(RotorTorqueLimit, limits)
        self.drivetrain = GearModel(robot, self.kinematics, settings, rotors)
        efforts = [task for task in tasks if isinstance(task, Effort)]
        weights = [effort.weights(robot) for effort in efforts]
        self.efforts: FloatArray = np.array(weights).reshape(-1, robot.transmission.size)
        kinds = [(float(effort.of_rotors), effort.least_torque) for effort in efforts]
        self.effort_kinds: FloatArray = np.array(kinds).reshape(-1, 2)
        apart, stops = _single(CollisionLimit, limits), _single(JointLimit, limits)
        self.collision = None if apart is None else CollisionRows(apart, model)
        if stops is None or not stops.joints:
            stops = JointLimit.of(robot, () if stops is None else None)
        self.joint_limit, self.joints = stops, stops.structure(robot.model.nv)
        moving = [task for task in tasks if isinstance(task, Task)]
        ranks = sorted({task.level for task in moving})
        if not ranks or ranks[0] != 0:
            raise ControlError("a controller without tasks of level 0 has nothing to do.")
        by_rank = [[task for task in moving if task.level == rank] for rank in ranks]
        self.stacks = tuple(TaskStack(robot, some, model) for some in by_rank)
        alone = self.kinematics.known_by_joints and not self.drivetrain.coupled
        self.asks_ahead = not alone or self.collision is not None

    @property
    def load(self) -> float:
        """What forces are measured by [N]: the weight, 1 kN where nothing weighs."""
        return self.robot.weight if self.robot.weight > 0.0 else 1e3


_Limit = TypeVar("_Limit", RotorTorqueLimit, JointLimit, CollisionLimit)


def _single(kind: type[_Limit], limits: Sequence[object]) -> _Limit | None:
    """Return the limit of a kind, None where there is none; two of a kind would contradict."""
    found = [limit for limit in limits if isinstance(limit, kind)]
    if len(found) > 1:
        raise ControlError(f"at most one {kind.__name__} can be given.")
    return found[0] if found else None


@inner
def add_square(row: Row, right: float, weight: float, H: OutDense, g: OutRow) -> None:
    """Add weight (row x - right)^2 / 2 to x'Hx / 2 + g'x."""
    for i in range(len(row)):
        if row[i] != 0.0:
            share = weight * row[i]
            g[i] -= share * right
            add_times(share, row, H[i])


@compiled
def written(
    program: ProgramMemory, wanted: Places
) -> tuple[OutDense, OutRow, OutDense, OutDense, OutDense]:
    """Return a program as it stands: Hessian (n, n), gradient (n,), and e equalities over r bounds.

    Of these the rows (e + r, n), and what lies below and above them (2, e + r): without limits of
    joints and distances, and all.

    Args:
        wanted: (r,) 1 or -1 for bounds that are tasks for the time being, as well.
    """
    solver, counts, hard = program.solver, program.counts, program.counts[COUNT.hard]
    n, count = len(solver.diagonal), hard + len(wanted)
    H, g, rows = np.zeros((n, n)), np.empty(n), np.empty((count, n))
    lower, upper = np.empty((2, count)), np.empty((2, count))
    for j in range(n):
        H[j, j], g[j] = solver.diagonal[j], -solver.pull[j]
    for i in range(counts[COUNT.cost]):
        add_square(solver.rows[i], solver.right[i], 1.0 / solver.softness[i], H, g)
    for i in range(hard):
        copy_to(solver.rows[counts[COUNT.cost] + i], rows[i])
        lower[:, i] = upper[:, i] = solver.right[counts[COUNT.cost] + i]
    for i in range(len(wanted)):
        copy_to(solver.C[i], rows[hard + i])
        lower[:, hard + i], upper[:, hard + i] = solver.lower[i], solver.upper[i]
        if wanted[i] != 0:
            right = solver.upper[i] if wanted[i] > 0 else solver.lower[i]
            add_square(solver.C[i], right, 1.0 / solver.give[i], H, g)
        if i >= program.joint:
            lower[0, hard + i], upper[0, hard + i] = -INFINITE, INFINITE
    return H, g, rows, lower, upper


@compiled
def place_prices(program: ProgramMemory, wanted: OutPlaces) -> None:
    """Make costs more even, and limits of joints and distances that ask for motion tasks, too.

    Such as that of a joint that has to brake. Torque limits, cones, contacts at rest and the
    balance are what the motors and the ground can do; they stay as they are.

    Args:
        program: PROGRAM; small costs are raised, and limits get a price.
        wanted: result (r,), 1 where an upper bound asks for motion, -1 where a lower one does.
    """
    solver = program.solver
    heaviest = solver.diagonal.max()
    for i in range(program.counts[COUNT.cost]):
        heaviest = max(heaviest, 1.0 / solver.softness[i])
    least = heaviest / FIRM
    for j in range(len(solver.diagonal)):
        if 0.0 < solver.diagonal[j] < least:
            solver.pull[j] *= least / solver.diagonal[j]
        solver.diagonal[j] = max(solver.diagonal[j], least)
    for i in range(program.joint, len(solver.give)):
        solver.give[i] = 1.0 / (FIRM * heaviest)
        wanted[i] = 1 if solver.upper[i] < 0.0 else -1 if solver.lower[i] > 0.0 else 0


@compiled
def excess_of(program: ProgramMemory, x: Row, z: Row) -> OutDense:
    """Return by how much x (n,) passes each bound (r,), and how hard it pushes with z (r,).

    A limit that is a task and not passed pushes nothing: it gives way itself.
    """
    solver, start, found = program.solver, program.joint, np.empty((2, len(z)))
    for i in range(len(z)):
        value, high, low = dot(solver.C[i], x), solver.upper[i], solver.lower[i]
        found[0, i] = max(value - high, low - value, 0.0)
        gives = i >= start and (high < 0.0 or low > 0.0) and found[0, i] == 0.0
        found[1, i] = 0.0 if gives else abs(z[i]) * sqrt(dot(solver.C[i], solver.C[i]))
    return found


class Program:
    """Lays out, for one set of contacts and one level, the program in x = [qdd, f / force_scale].

        min   sum of task costs + regularisation of qdd and of f towards a shared load
        s.t.  (M qdd + bias - J'f)_undriven = 0
              J qdd = -dJ/dt v - damping J v
              -limit <= e (D'(M qdd + bias - J'f)_m) + rotor qdd + rotor_bias <= limit
              friction cones, normal forces, joint limits, distances

    with e the slope of the mesh law in the direction predicted for each gear. Contact rows that
    repeat each other are met in the least-squares sense (see `place_basis`). All memory is made
    once, and written by `wbc.control.memory`.

    Attributes:
        recipe: what it is made of.
        memory: the PROGRAM.
        lock: memory of what the level above has decided, None at the first level.
        contacts: the active contacts.
        stack: the tasks.
        n, nv: numbers of variables and of accelerations.
        force_scale: [N] per unit of force variable, a tenth of the robot's weight, so that
            accelerations and forces are of one size and tolerances mean the same on any robot.
        unlocked: how many equalities are the robot's own; those of a lock follow.
        bounds: how many bounds there are, two for every gear that has a limit.
        has_efforts: whether it bears efforts.
        repeats: whether some rows of the contacts repeat others, so that `place_basis` is needed.
        labels: of every bound.
        at, rows, size: parts of the block of results, see `wbc.control.memory`, its rows of the
            gears (m,), and its size.
    """

    def __init__(self, recipe: Recipe, contacts: ContactSet, rank: int) -> None:
        """Lay out the rows of a level for some contacts."""
        robot, last = recipe.robot, rank == len(recipe.stacks) - 1
        self.contacts, self.stack, self.recipe = contacts, recipe.stacks[rank], recipe
        self.nv, self.n = robot.model.nv, robot.model.nv + contacts.rows
        self.force_scale = 0.1 * recipe.load
        self._efforts = recipe.efforts if last else recipe.efforts[:0]
        self.has_efforts, self.repeats = len(self._efforts) > 0, contacts.rank < contacts.rows
        self._undriven, m = robot.floating_size, robot.transmission.size
        self.unlocked = self._undriven + contacts.rank
        above = sum(len(stack.memory.wanted) for stack in recipe.stacks[:rank])
        cost = len(self.stack.memory.rows.jacobian) + m * len(self._efforts)
        most = self.unlocked + (max(above, self.n) if rank else 0)
        self._lay_out_bounds()
        parts = [robot.model.nq, *[self.nv] * 3, m * len(GEAR), self.n, self.bounds, most]
        ends = np.cumsum([0, *parts])
        self.size, self.at = int(ends[-1]), [slice(a, b) for a, b in pairwise(ends.tolist())]
        starts = [self.at[PART.by_gear].start + m * row for row in range(len(GEAR))]
        self.rows = [slice(start, start + m) for start in starts]
        self._lay_out_rows(cost, most, rank, ends)
        self._ceilings: Mapping[str, float] | None = None
        room = max(most + self.n, self.bounds, above)
        sizes = {"a": above, "n": self.n, "k": room, "r": self.bounds}
        self.lock: Any = LOCK.of(sizes) if rank else None

    def _lay_out_bounds(self) -> None:
        """Number and name the bounds by kind: torques, cones, normal forces, joints, distances."""
        contacts, recipe, scale = self.contacts, self.recipe, self.force_scale
        names, apart = recipe.robot.transmission.joints, recipe.collision
        torques = [f"rotor torque limit of '{names[i]}'" for i in recipe.drivetrain.limited]
        kinds: list[list[Label]] = [
            [(label, 1.0, "N m at the motor output") for label in torques] * 2,
            [(f"contact {label}", scale, unit) for label, unit in contacts.cone_labels],
            [(f"contact {c.name}: normal force", scale, "N") for c in contacts.contacts],
            [(f"joint limit of '{joint}'", 1.0, "rad/s^2") for joint in recipe.joint_limit.joints],
            [(label, 1.0, "m/s^2") for label in (apart.labels if apart else ())],
        ]
        ends = np.cumsum([0, *map(len, kinds)]).tolist()
        self.torque, self.cone, self.normal, self.joint, self.distance = (
            slice(a, b) for a, b in pairwise(ends)
        )
        self.bounds, self.labels = ends[-1], list(chain(*kinds))

    def _lay_out_rows(self, cost: int, most: int, rank: int, parts: IntArray) -> None:
        """Make all memory, for `cost` soft rows and `most` hard ones, and parts of a block."""
        recipe, n, nv, contacts = self.recipe, self.n, self.nv, self.contacts
        size, bounds, m = cost + most + n, self.bounds, recipe.drivetrain.size
        settings, self.wanted = recipe.settings, np.zeros(bounds, dtype=np.int_)
        tolerance, regular = settings.tolerance, settings.acceleration_weight
        sizes = {"k": size, "n": n, "r": bounds}
        solver = SOLVER.of(sizes, tolerance=np.array([tolerance]))
        shared = contacts.load_share * recipe.robot.weight / self.force_scale
        solver.diagonal[:nv], solver.diagonal[nv:] = regular, settings.force_weight
        solver.pull[nv:] = settings.force_weight * shared
        solver.C[self.cone, nv:], solver.C[self.normal, nv:] = contacts.cone, contacts.normals
        solver.C[np.arange(self.joint.start, self.joint.stop), recipe.joint_limit.rows] = 1.0
        solver.lower[:], solver.upper[:], solver.upper[self.cone] = -INFINITE, INFINITE, 0.0
        stated = solver.lower, solver.upper
        if rank > 0:
            stated = solver.lower.copy(), solver.upper.copy()
        greatest, reach = tolerance / np.finfo(np.float64).eps, _REACH * tolerance
        numbers = [recipe.kinematics.mass, self.force_scale, regular, greatest, reach]
        self.memory: Any = PROGRAM.of(
            {"m": m, "n": n, "v": nv, "q": recipe.robot.model.nq},
            tree=recipe.kinematics.tree,
            tasks=self.stack.memory,
            contacts=contacts.memory,
            gears=recipe.drivetrain.memory,
            joints=recipe.joints,
            solver=solver,
            limited=np.array(recipe.drivetrain.limited, dtype=np.int_),
            undriven=np.array(recipe.robot.unactuated, dtype=np.int_),
            joint=self.joint.start,
            ends=parts,
            numbers=np.array(numbers),
            efforts=self._efforts,
            effort_kinds=recipe.effort_kinds,
            stated_lower=stated[0],
            stated_upper=stated[1],
        )
        self.memory.counts[COUNT.own] = self.unlocked
        self._room = np.zeros((2, contacts.rows, nv))

    def take(self, ceilings: Mapping[str, float]) -> None:
        """Take the greatest normal forces of a tick [N], and the distances of solids."""
        memory, apart = self.memory, self.recipe.collision
        memory.counts[COUNT.hard] = self.unlocked
        if ceilings is not self._ceilings:
            lower, upper, scale = memory.stated_lower, memory.stated_upper, self.force_scale
            for row, bound in enumerate(self.contacts.contacts, self.normal.start):
                top = min(bound.contact.normal_maximum, ceilings[bound.name])
                upper[row] = min(top / scale, INFINITE)
                # a low ceiling lowers it
                lower[row] = min(bound.contact.normal_minimum, top) / scale
            self._ceilings = ceilings
        if apart is not None:
            memory.solver.C[self.distance, : self.nv] = apart.rows
            memory.stated_lower[self.distance] = apart.least

    def place_basis(self) -> None:
        """Write rows of contacts that repeat each other as an orthonormal basis B of them.

        B qdd = y where y minimises |J B' y - t|^2. Points of one rigid body can move only as it
        does. What is asked of them differs from that by rounding, by noise of the velocities
        (w x (w x r) sets two points apart) and by their own gains; as equalities such rows would
        contradict each other, their least-squares solution exists. Where a pose leaves fewer
        independent rows, the rest ask nothing: 0 = 0, with a softness that keeps the solver's
        system regular.
        """
        solver, (left, kept) = self.memory.solver, self._room
        jacobian, target = self.contacts.memory.rows.jacobian, self.contacts.memory.target
        top = int(self.memory.counts[COUNT.cost]) + self._undriven
        basis = slice(top, top + self.contacts.rank)
        rows, right = solver.rows[basis, : self.nv], solver.right[basis]
        softness = solver.softness[basis]
        count = min(extend_basis(jacobian, left, kept, 0, self.nv), self.contacts.rank)
        rows[:count], rows[count:] = kept[:count], 0.0
        right[:] = 0.0
        right[:count] = np.linalg.lstsq(jacobian @ kept[:count].T, target, rcond=_WEAK)[0]
        softness[:count], softness[count:] = 0.0, 1.0

    def excess(self, solution: QPSolution) -> FloatArray:
        """Return by how much each bound is passed (r,), and how hard it pushes (r,)."""
        return excess_of(self.memory, solution.x, solution.z)

    def told(self, excess: FloatArray) -> tuple[dict[str, float], str]:
        """Return what limits are passed, by how much [rad/s^2 or m/s^2], and that in words."""
        (beyond, push), start = excess, self.joint.start
        reach = self.memory.numbers[NUMBER.reach]
        passed = beyond > max(_TOLD * beyond[start:].max(initial=0.0), reach)
        passed[:start] = False
        found = {self.labels[i][0]: float(beyond[i]) for i in np.flatnonzero(passed)}
        if not found:
            return found, ""
        others = np.where(passed, 0.0, push)
        stops = "what rests on the ground" if self.contacts.rows else "the balance of forces"
        if others.max() > _TOLD * push.max():
            stops = self.labels[int(np.argmax(others))][0]
        worst = max(found, key=lambda label: found[label])
        more = f", and {len(found) - 1} more" if len(found) > 1 else ""
        told = f"{worst} is passed by {found[worst]:.3g} per s^2{more}: {stops} leaves no more."
        return found, told

    def dense(self) -> QPProblem:
        """Return a copy of the program as it stands, Hessian and gradient written out."""
        H, g, rows, lower, upper = written(self.memory, self.wanted)
        hard = int(self.memory.counts[COUNT.hard])
        low, high = lower[1, hard:], upper[1, hard:]
        return QPProblem(H, g, rows[:hard], upper[1, :hard], rows[hard:], low, high)

    def label(self, row: int, equalities: int) -> Label:
        """Return what a constraint is called, and scale and unit of a violation.

        Args:
            row: its number, the equalities before the bounds.
            equalities: how many there are.
        """
        if row >= equalities:
            return self.labels[row - equalities]
        if row < self._undriven:
            coordinate = int(self.recipe.robot.unactuated[row])
            return f"balance of undriven coordinate {coordinate}", 1.0, "N or N m"
        if row >= self.unlocked:
            return "what the more important tasks have decided", 1.0, "m/s^2"
        names = [bound.name for bound in self.contacts.contacts for _ in bound.axes]
        which = names[row - self._undriven]
        told = "the contacts at rest" if self.repeats else f"contact {which} at rest"
        return told, 1.0, "m/s^2"
