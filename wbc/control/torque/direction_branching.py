"""Branching on directions where a limit binds on the side on which either could be right."""

from __future__ import annotations

from heapq import heappop, heappush
from itertools import count

import numpy as np

from wbc.arrays import BoolArray, FloatArray
from wbc.control.program.contact_force_program import ContactForceProgram
from wbc.control.program.rows.torque_rows import place_target
from wbc.control.solvers import BlockProblem, QPSolution, QPStatus
from wbc.control.solvers.cascade import Cascade
from wbc.control.torque.gears import Slopes
from wbc.control.torque.solution_torques import Limits, beyond_limits


class DirectionBranching:
    """Branch and bound over the half-spaces that the allowed torques of contested gears are.

    Every node keeps the convex rows of all gears and one half-space of the gears decided so far,
    which bounds the cost of all that lies below it. Until there is a first solution the search
    dives, each time in the direction that the node's own torque has; then it takes the node of
    least bound first, so that few rounds leave little to be gained.

    Attributes:
        solver: of the nodes.
    """

    def __init__(self, program: ContactForceProgram, solver: Cascade) -> None:
        """Take the program and a solver with a second row for every gear."""
        self._program, self.solver = program, solver

    def solve(
        self,
        slopes: Slopes,
        limits: Limits,
        incumbent: QPSolution | None,
        contested: list[int],
        positive: BoolArray,
        rounds: int,
    ) -> tuple[QPSolution | None, bool]:
        """Return the best solution found, None if none, and whether it is proven the best.

        Args:
            slopes: of the mesh law for either sign of T.
            limits: least and greatest N tau_phi (m,) [N m].
            incumbent: a solution that agrees with its directions, or None.
            contested: gears that `incumbent` decides where the other direction might be better.
            positive: (m,) where T > 0 in the incumbent.
            rounds: programs solved at most.
        """
        lowest = np.inf if incumbent is None else self._program.blocks.cost(incumbent.x)
        order = count()
        nodes: list[tuple[float, int, dict[int, bool]]] = []
        decided: dict[int, bool] = {}
        for gear in contested:
            heappush(nodes, (-np.inf, next(order), decided | {gear: not positive[gear]}))
            decided[gear] = bool(positive[gear])
        known = True  # that what was dropped holds nothing better
        dive: list[dict[int, bool]] = [] if incumbent is not None else [{}]
        for _ in range(rounds):
            if self.solver.exhausted:
                break
            if dive:
                node = dive.pop()
            elif nodes and nodes[0][0] < lowest:
                node = heappop(nodes)[2]
            else:
                return self._plain(incumbent, slopes, limits), known
            # of 291 nodes five were solved by the rows that bound another one
            solution = self.solver.solve(self._node(node, slopes, limits), starts_over=True)
            if solution.status is not QPStatus.SOLVED:
                known = known and solution.status is QPStatus.INFEASIBLE
                dive = self._resumed(nodes, incumbent, dive)
                continue
            cost = self._program.blocks.cost(solution.x)
            if cost >= lowest:
                continue
            beyond = np.flatnonzero(beyond_limits(self._program, solution, slopes, limits))
            open_gears = [gear for gear in beyond.tolist() if gear not in node]
            if not open_gears:
                incumbent, lowest = solution, cost
                continue
            gear = open_gears[0]
            own = bool(self._program.output_torque(solution.x)[gear] > 0.0)
            heappush(nodes, (cost, next(order), node | {gear: not own}))
            if incumbent is None:
                dive.append(node | {gear: own})
            else:
                heappush(nodes, (cost, next(order), node | {gear: own}))
        proven = known and not dive and not (nodes and nodes[0][0] < lowest)
        return self._plain(incumbent, slopes, limits), proven

    @staticmethod
    def _resumed(
        nodes: list[tuple[float, int, dict[int, bool]]],
        incumbent: QPSolution | None,
        dive: list[dict[int, bool]],
    ) -> list[dict[int, bool]]:
        """Return where to dive on after a dead end: the deepest node, while nothing is found."""
        if dive or incumbent is not None or not nodes:
            return dive
        deepest = max(nodes, key=lambda entry: (len(entry[2]), entry[1]))
        nodes.remove(deepest)
        nodes.sort(key=lambda entry: entry[:2])
        return [deepest[2]]

    def _plain(
        self, solution: QPSolution | None, slopes: Slopes, limits: Limits
    ) -> QPSolution | None:
        """Assemble the plain program in the directions of `solution`; return it with its rows' z.

        Of the two rows that a node has per gear, the one in the solution's own direction stays.
        """
        if solution is None:
            return None
        program = self._program
        positive = program.output_torque(solution.x) > 0.0
        program.assemble_torque_limits(slopes.at(positive), *limits)
        rows = len(program.rows.labels)
        if len(solution.z) == rows:
            return solution
        z = solution.z[:rows].copy()
        own = positive[program.gears]
        z[program.rows.torque] = np.where(own, z[program.rows.torque], solution.z[rows:])
        return solution._replace(z=z)

    def feasible(self, near: FloatArray, slopes: Slopes, limits: Limits) -> QPSolution | None:
        """Return an allowed motion near x (n,), None where none is found.

        Where x asks for more than a motor can give, x is scaled down to that: from farther away
        the search takes more steps (on Talos 38 instead of 33 % of motions within 40 of them).
        Each gear keeps the convex rows and the half-space of its direction at x: whatever keeps
        those keeps the limits, in its own directions too.
        """
        program, target = self._program, np.empty(len(near))
        place_target(*program.torques(near), near, *slopes, *limits, program.gears, target)
        choice = np.where(program.output_torque(target) > 0.0, 1.0, -1.0)
        found = self.solver.nearest(self.problem(choice, slopes, limits), target)
        return self._plain(found, slopes, limits)

    def _node(self, decided: dict[int, bool], slopes: Slopes, limits: Limits) -> BlockProblem:
        """Return the program of a node; `decided` maps a gear to whether T > 0 there."""
        choice = np.zeros(len(limits[0]))
        for gear, positive in decided.items():
            choice[gear] = 1.0 if positive else -1.0
        return self.problem(choice, slopes, limits)

    def problem(self, choice: FloatArray, slopes: Slopes, limits: Limits) -> BlockProblem:
        """Return the program with the convex rows of all gears and one half-space of some.

        Args:
            choice: (m,) 1 where the half-space is that of T > 0, -1 where that of T < 0, 0 where
                there is none.
            slopes: of the mesh law for either sign of T.
            limits: least and greatest N tau_phi (m,) [N m].
        """
        return self._program.directed((slopes.positive, slopes.negative), limits, choice)
