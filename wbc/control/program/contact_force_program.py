"""The contact-force program: accelerations and contact forces under the dissipative dynamics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from wbc.arrays import BoolArray, FloatArray
from wbc.control.contacts.contact_set import ContactSet
from wbc.control.efforts import ContactForceTask, Effort
from wbc.control.limits import CollisionRows, JointLimit
from wbc.control.output_torques import OutputTorques, TorqueTerms
from wbc.control.program.contact_force_cost import ContactForceCost
from wbc.control.program.effort_cost import EffortCost
from wbc.control.program.placing import Placing
from wbc.control.program.rows.gear_torque_rows import GearTorqueRows, Judged
from wbc.control.program.rows.inequality_rows import InequalityRows, place_passing
from wbc.control.program.rows.row_basis import RowBasis
from wbc.control.program.task_stack import TaskStack
from wbc.control.reference import Reference
from wbc.control.solvers import BlockProblem

_NOTHING_SEEN: tuple[FloatArray | None, tuple[FloatArray, FloatArray]]
_NOTHING_SEEN = None, (np.zeros(0), np.zeros(0))
_Views = tuple[BlockProblem, BlockProblem, BlockProblem]
"""The whole program, the one whose directions are searched, and the one without torque limits."""


class ContactForceProgram:
    """Assembles, for one set of contacts, the quadratic program in x = [qdd, f / force_scale].

        min   sum of task costs + regularisation of qdd and of f towards a shared load
        s.t.  (M qdd + bias - J'f)_undriven = 0
              J qdd = -dJ/dt v - damping J v
              -limit <= e (D'(M qdd + bias - J'f)_m) + rotor qdd + rotor_bias <= limit
              friction cones, normal forces, joint limits

    with e the slope of the mesh law in the direction predicted for each gear. Contact rows that
    repeat each other are met in the least-squares sense (see `RowBasis`). All memory is
    allocated once; `problem` is overwritten by the next assembly.

    Attributes:
        contacts: the active contacts.
        n: number of variables.
        force_scale: [N] per unit of force variable, a tenth of the robot's weight, so that
            accelerations and forces are of one size and tolerances mean the same on any robot.
        force_cost: cost of the contact forces.
        effort_cost: cost of the efforts, with its rows below those of tasks.
        A, b: the equalities.
        cost_rows: most rows of tasks and efforts, above the equalities.
        most_rows: greatest number of rows, tasks, efforts and equalities, without bounds.
        more_rows: how many bounds may be equalities below a more important level.
        passing: x (n,) of the level above, which the bounds let pass; None where there is none.
        blocks: the whole program, without rows of tasks that have no weight.
        unbound: the program without its torque limits.
        unlocked: how many equalities are the robot's own; those of a lock follow.
        rows: the inequalities.
        placing: what writes balance and tasks.
        off: how many rows of tasks are left out.
        hardens: whether a task has an infinite weight.
        gear_torques: what solutions ask of the gears, and the rows that limit it.
    """

    def __init__(
        self,
        plant: OutputTorques,
        contacts: ContactSet,
        limited: BoolArray,
        joint_limit: JointLimit | None,
        weights: tuple[float, float],
        efforts: Sequence[Effort] = (),
        force_tasks: Sequence[ContactForceTask] = (),
        locked: int = 0,
        task_rows: int = 0,
        slack: float = 0.0,
        hardens: bool = False,
        collision: CollisionRows | None = None,
    ) -> None:
        """Lay out the rows.

        Args:
            plant: the dynamics.
            contacts: the active contacts.
            limited: (m,) bool, gears that have a torque limit.
            joint_limit: limits of joints, or None.
            weights: regularisation of qdd and of the force variables.
            efforts: costs on the torques of the gears.
            force_tasks: costs on contact forces; those of inactive contacts stay idle.
            locked: greatest number of equality rows that a more important level hands down.
            task_rows: rows of the tasks.
            slack: how far an inequality's bound may lie beyond what it stands for.
            hardens: whether a task has an infinite weight.
            collision: distances to keep, filled by the controller; or None.
        """
        self._collision = collision
        self.hardens = hardens
        robot = plant.robot
        self.plant, self.contacts, self.joint_limit = plant, contacts, joint_limit
        self.nv, self.forces = robot.model.nv, contacts.rows
        self.n = self.nv + self.forces
        self.undriven = robot.floating_size
        self.gears = np.flatnonzero(limited)
        self.weights = weights
        weight = plant.weight
        self.force_scale = 0.1 * weight if weight > 0.0 else 100.0
        self._force_scales = np.full(self.forces, self.force_scale)
        self.force_cost = ContactForceCost(
            contacts, force_tasks, weights[1], weight, self.force_scale
        )
        self.efforts = tuple(efforts)
        self.diagonal, self.pull = np.full(self.n, weights[0]), np.zeros(self.n)
        self._take_forces()
        rest = self.undriven + contacts.rank
        cost_rows = task_rows + robot.transmission.size * len(self.efforts)
        self.unlocked, self.cost_rows = rest, cost_rows
        self.most_rows = cost_rows + rest + locked
        self.more_rows = max(self.n - locked, 0) if locked else 0
        self.passing: FloatArray | None = None
        size = self.most_rows + self.more_rows
        self._stacked, self._right = np.zeros((size, self.n)), np.zeros(size)
        self._softness = np.zeros(size)
        self._softness[:cost_rows] = 1.0
        mine = slice(task_rows, cost_rows)
        self.effort_cost = EffortCost(efforts, plant, self._stacked[mine], self._right[mine])
        self.A, self.b = self._stacked[cost_rows:size], self._right[cost_rows:size]
        balance, contact = slice(0, self.undriven), slice(self.undriven, rest)
        self._contact_rows, self._contact_right = self.A[contact, : self.nv], self.b[contact]
        self._copies = not contacts.place(self._contact_rows, self._contact_right)
        self._basis = None
        if contacts.rank < contacts.rows:
            self._basis = RowBasis(contacts.rows, self.nv, contacts.rank)
            self._contact_softness = self._softness[cost_rows:][contact]
        names = robot.transmission.joints
        gears = [names[i] for i in self.gears]
        scale = self.force_scale
        self.rows = InequalityRows(
            *(gears, contacts, joint_limit, self.nv, scale, slack),
            () if collision is None else collision.labels,
        )
        self.gear_torques = GearTorqueRows(plant, contacts, self.rows, self.gears, scale)
        self._seen = _NOTHING_SEEN
        self.placing = Placing(
            *(plant, contacts, self.A[balance], self.b[balance]),
            (self._stacked, self._right, self._softness, self.diagonal, self.pull),
        )
        self._write_normal_bounds(None)
        self.off = 0
        self._views: dict[tuple[int, int], _Views] = {}
        self._count_equalities(rest)

    def assemble_constraints(
        self,
        position: FloatArray,
        velocity: FloatArray,
        step: float,
        ceilings: Mapping[str, float] | None,
    ) -> None:
        """Write the equalities, and the bounds of normal forces and joint accelerations.

        Args:
            position, velocity: q (nq,) and v (nv,).
            step: time until the next tick [s].
            ceilings: greatest normal force [N] by contact, None where only the contacts' own hold.
        """
        set_ = self.contacts
        if self.more_rows:  # a lock reads the balance before the tasks are written
            self.placing.place_balance(self.force_scale)
        if self._basis is not None:
            self._basis.place(
                *(set_.jacobian, set_.target),
                *(self._contact_rows, self._contact_right, self._contact_softness),
            )
        elif self._copies:
            np.copyto(self._contact_rows, set_.jacobian)
            np.copyto(self._contact_right, set_.target)
        self.assemble_bounds(position, velocity, step, ceilings)

    @property
    def is_fixed(self) -> bool:
        """Whether all rows but those of efforts stand where contacts and tasks write them.

        Then nothing is to be done between these and the solver but to place the balance.
        """
        bare = self._collision is None and not self.efforts and not self.hardens
        return bare and self._basis is None and not self._copies and not self.more_rows

    def assemble_bounds(
        self,
        position: FloatArray,
        velocity: FloatArray,
        step: float,
        ceilings: Mapping[str, float] | None,
    ) -> None:
        """Write the bounds of normal forces and joint accelerations, and rows of distances.

        Arguments as for `assemble_constraints`.
        """
        self._seen = _NOTHING_SEEN
        if ceilings != self._ceilings:
            self._write_normal_bounds(ceilings)
        if self.joint_limit is not None:
            strength = self.plant.braking(self.joint_limit)
            low, high = self.joint_limit.bounds(position, velocity, step, strength)
            self.rows.write_joints(low, high)
        if self._collision is not None:
            self.rows.write_distances(self._collision.rows, self._collision.least)

    def assemble_tasks(self, tasks: TaskStack) -> float:
        """Write the balance, the tasks' rows and the diagonal; call after the constraints.

        Returns:
            the sum of the sizes of all that tasks and equalities want, not finite if one is not.
        """
        self.leave_out(tasks.rows_off)
        scale, regularisation = self.force_scale, self.weights[0]
        return self.placing.place(tasks, self.b, scale, regularisation, fixed=not self.more_rows)

    def leave_out(self, rows: int) -> None:
        """Leave out the first rows, of tasks that have no weight."""
        if rows != self.off:
            self.off = rows
            self._take_views()

    def weights_of(self, tasks: TaskStack) -> FloatArray:
        """Return what the variables (n,) cost by themselves, never nothing."""
        weights = np.concatenate([tasks.diagonal, self.diagonal[self.nv :]])
        weights += self.weights[0]
        return weights

    def assemble_forces(self, references: Mapping[str, Reference]) -> None:
        """Take what the force tasks ask, where there are any."""
        if self.force_cost.tracks:
            self.force_cost.fill(references)
            self._take_forces()

    def _take_forces(self) -> None:
        self.diagonal[self.nv :] = self.force_cost.diagonal
        np.negative(self.force_cost.pull, out=self.pull[self.nv :])

    def assemble_torque_map(self) -> None:
        """Write the map from x to T; call after the constraints."""
        self.gear_torques.place_map()

    def assemble_efforts(self, slopes: FloatArray, speed: FloatArray, last: FloatArray) -> None:
        """Add the efforts for one slope per gear; call after the map and the costs.

        Args:
            slopes: e (m,) in the predicted directions.
            speed: expected dpsi (m,) [rad/s].
            last: T (m,) of the last tick [N m].
        """
        if self.efforts:
            self.effort_cost.fill(self.gear_torques.map, slopes, speed, last)

    def assemble_lock(self, matrix: FloatArray, solution: FloatArray) -> None:
        """Hold what rows (k, n) give x (n,) of the level above, which the bounds let pass."""
        self._count_equalities(self.unlocked + len(matrix))
        self.A[self.unlocked :], self.b[self.unlocked :] = matrix, matrix @ solution
        self.passing = solution
        self.rows.let_pass(solution, slice(self.rows.torque.stop, None))

    def _count_equalities(self, count: int) -> None:
        """Make the views of a program with as many equalities."""
        top, end = self.cost_rows, self.cost_rows + count
        self.A, self.b = self._stacked[top:end], self._right[top:end]
        self._take_views()

    def _take_views(self) -> None:
        """Take the views that leave out the rows of tasks without weight; they are kept."""
        which = self.off, len(self.b)
        views = self._views.get(which)
        if views is None:
            views = self._views[which] = self._made_views()
        self.blocks, self._directed_blocks, self.unbound = views

    def _made_views(self) -> _Views:
        rows, used = self.rows, slice(self.off, self.cost_rows + len(self.b))
        blocks = BlockProblem(
            *(self.diagonal, self.pull),
            rows=self._stacked[used],
            right=self._right[used],
            softness=self._softness[used],
            soft=self.cost_rows - self.off,
            C=rows.C,
            lower=rows.lower,
            upper=rows.upper,
            hardens=self.hardens,
        )
        free = slice(rows.torque.stop, None)
        C, lower, upper = self.gear_torques.directed
        directed = blocks._replace(C=C, lower=lower, upper=upper)
        unbound = blocks._replace(C=rows.C[free], lower=rows.lower[free], upper=rows.upper[free])
        return blocks, directed, unbound

    def assemble_torque_limits(
        self, slopes: FloatArray, lower: FloatArray, upper: FloatArray
    ) -> None:
        """Write the rows of the rotor torque limits for one slope per gear.

        Args:
            slopes: e (m,) in the predicted directions.
            lower, upper: least and greatest N tau_phi (m,) [N m].
        """
        self.gear_torques.limit(slopes, lower, upper)
        if self.passing is not None:
            self.rows.let_pass(self.passing, self.rows.torque)

    def directed(
        self,
        slopes: tuple[FloatArray, FloatArray],
        limits: tuple[FloatArray, FloatArray],
        choice: FloatArray,
    ) -> BlockProblem:
        """Return the program with the convex rows of all gears and one half-space of some.

        Overwritten by the next call, as are the torque rows of `blocks`.

        Args:
            slopes: e (m,) where T > 0, and where T < 0.
            limits: least and greatest N tau_phi (m,) [N m].
            choice: (m,) 1 where the half-space is that of T > 0, -1 where that of T < 0, 0 where
                there is none.
        """
        self.gear_torques.direct(slopes, limits, choice)
        if self.passing is not None:
            rows, (C, lower, upper) = self.rows, self.gear_torques.directed
            decided = np.concatenate([rows.decided, rows.decided[rows.torque]])
            place_passing(C, lower, upper, self.passing, rows.slack, decided, lower, upper)
        return self._directed_blocks

    def _write_normal_bounds(self, ceilings: Mapping[str, float] | None) -> None:
        set_ = self.contacts
        top = set_.normal_maximum
        if ceilings is not None:
            top = np.minimum(top, [ceilings[contact.name] for contact in set_.contacts])
        self.rows.write_normals(set_.normal_minimum, top)
        self._ceilings = None if ceilings is None else dict(ceilings)

    def forces_of(self, x: FloatArray) -> FloatArray:
        """Return the contact forces (k,) [N, N m] at a solution."""
        forces: FloatArray = x[self.nv :] * self._force_scales
        return forces

    def output_torque(self, x: FloatArray) -> FloatArray:
        """Return T (m,) [N m] at a solution."""
        return self.torques(x)[0]

    def torques(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return T and what the rotors take themselves (m,) [N m] at a solution of this tick."""
        if x is not self._seen[0]:
            self._seen = x, self.plant.torques(x, self.contacts.jacobian, self.force_scale)
        return self._seen[1]

    def judged(
        self,
        x: FloatArray,
        slopes: tuple[FloatArray, FloatArray],
        limits: tuple[FloatArray, FloatArray],
    ) -> Judged:
        """Return what a solution asks of the gears; arguments as for `GearTorqueRows.judged`."""
        judged = self.gear_torques.judged(x, slopes, limits)
        self._seen = x, (judged.output, judged.share)
        return judged

    def terms(self, x: FloatArray) -> TorqueTerms:
        """Return what the torques of a solution are made of, as `OutputTorques.terms`."""
        return self.plant.terms(x, self.contacts.jacobian, self.force_scale)

    def equality_label(self, row: int) -> tuple[str, str]:
        """Return what an equality row is called in messages, and its unit."""
        if row < self.undriven:
            coordinate = int(self.plant.robot.unactuated[row])
            return f"balance of undriven coordinate {coordinate}", "N or N m"
        if self._basis is not None and row < self.unlocked:
            return "the contacts at rest", "m/s^2"
        for contact, rows in zip(self.contacts.contacts, self.contacts.slices, strict=True):
            if row - self.undriven < rows.stop:
                return f"contact {contact.name} at rest", "m/s^2"
        if row < len(self.b):
            return "what the more important tasks have decided", "m/s^2"
        return "a task of infinite weight", "m/s^2"

    def inequality_label(self, row: int) -> tuple[str, float, str]:
        """Return what an inequality is called, the scale of a violation, and its unit."""
        return self.rows.labels[row], *self.rows.scale_and_unit(row)
