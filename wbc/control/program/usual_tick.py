"""The tick of most loops in one call: a state in, torques out."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from time import perf_counter
from typing import NamedTuple

import numpy as np
from numba import types

from wbc.arrays import FloatArray, IntArray
from wbc.compiled import (
    Count,
    Dense,
    Matrix,
    Number,
    OutRow,
    Places,
    Row,
    Vector,
    compiled,
    view,
)
from wbc.control.kinematics import Kinematics
from wbc.control.kinematics.frame_rows import fill_state_rows
from wbc.control.kinematics.tree import move_joints
from wbc.control.program.contact_force_program import ContactForceProgram
from wbc.control.program.placing import place_program
from wbc.control.program.stacking import rest, want
from wbc.control.program.task_stack import TaskStack
from wbc.control.reference import Reference
from wbc.control.solvers import BlockProblem, DualActiveSet, QPSolution, QPStatus
from wbc.control.solvers.dual_solve import solve_fixed
from wbc.control.solvers.dual_steps import SOLVED
from wbc.control.torque.blending import place_advanced, place_judged, place_realised
from wbc.control.torque.gears import GearLaw, GearState
from wbc.control.torque.motors import TorqueBounds
from wbc.control.torque.speed import SpeedBlend
from wbc.fixed_arrays import FixedArrays, FixedTable, array_at
from wbc.robot import Motion

TOO_LARGE, UNSOLVED, LIMITED, DONE = 0, 1, 2, 3
"""How a pass ends: numbers too large, no solution from a guess, a torque limit, or well."""
_TORQUES, _SOLVED = 9, QPStatus.SOLVED


UsualArguments = tuple[
    Mapping[str, Reference],
    Mapping[str, float] | None,
    Mapping[str, float] | None,
    Mapping[str, float] | None,
]
"""References, contacts, weights and activation of `Controller.step`."""


def greatest_asked(tolerance: float) -> float:
    """Return how much tasks and equalities may want before rounding is more than a tolerance."""
    return float(tolerance / np.finfo(np.float64).eps)


class Passed(NamedTuple):
    """How a pass ended.

    Attributes:
        ended: TOO_LARGE, UNSOLVED, LIMITED or DONE.
        block: all results, one after the other; what `ended` does not reach is not written.
        gears: what is known of the gears.
        steps: of the solver.
        time: [s] it took.
    """

    ended: int
    block: FloatArray
    gears: GearState
    steps: int
    time: float


class BlockPlaces(NamedTuple):
    """Where the results of a pass stand in their block.

    Attributes:
        position, velocity: q (nq,) and v (nv,).
        expected: v (nv,) that the directions were judged by.
        advanced: v (nv,) expected of the next tick.
        x, y, z: of the solution.
        acceleration: qdd (nv,), the first part of x.
        turning, sigma: expected dpsi (m,) and certainty.
        output, mesh, torque, drive: T, t and N tau_phi (m,), and what the drives are told.
    """

    position: slice
    velocity: slice
    expected: slice
    advanced: slice
    x: slice
    y: slice
    z: slice
    acceleration: slice
    turning: slice
    sigma: slice
    output: slice
    mesh: slice
    torque: slice
    drive: slice


class UsualTick:
    """Does in one call what the parts of a tick do one after the other.

    Handing arrays over from one part to the next takes longer than the work on them. All memory
    is that of the parts: where the call ends early, at a torque limit or at numbers too large,
    they go on from there. It knows no effects, and only rows that follow from the state alone.

    Attributes:
        program: of the level.
        at: where results stand in the block of a pass.
    """

    def __init__(
        self,
        kinematics: Kinematics,
        tasks: TaskStack,
        program: ContactForceProgram,
        guess: DualActiveSet,
        law: GearLaw,
        blend: SpeedBlend,
        bounds: TorqueBounds,
    ) -> None:
        """Take the parts.

        Args:
            kinematics: of the controller.
            tasks, program: of a level.
            guess: what solves the program from the rows that bound the last solution.
            law: of the meshes.
            blend: how speeds are judged.
            bounds: least and greatest N tau_phi (m,) [N m], the same in every tick.
        """
        self._kinematics, self._tasks, self.program = kinematics, tasks, program
        self._guess, self._law, self._blend, self._bounds = guess, law, blend, bounds
        nq, nv, m = kinematics.model.nq, kinematics.model.nv, len(bounds[0])
        sizes = [nq, nv, nv, nv, program.n, program.unlocked, program.rows.size, *[m] * _TORQUES]
        ends = np.cumsum([0, *sizes]).tolist()
        self._size = ends[-1]
        parts = [slice(start, end) for start, end in pairwise(ends)]
        position, velocity, expected, advanced, x, y, z = parts[:7]
        turning, _, sigma, output, _, mesh, torque, _, drive = parts[7:]
        acceleration = slice(ends[4], ends[4] + nv)
        self.at = BlockPlaces(
            *(position, velocity, expected, advanced, x, y, z, acceleration),
            *(turning, sigma, output, mesh, torque, drive),
        )
        self._known: dict[int, tuple[BlockProblem, FixedArrays]] = {}

    def prepare(
        self,
        motion: Motion,
        references: Mapping[str, Reference],
        contacts: Mapping[str, float] | None,
        weights: Mapping[str, float] | None,
        activation: Mapping[str, float] | None,
        dt: float,
    ) -> bool:
        """Take the arguments of `Controller.step`; return whether the tick is a usual one.

        Raises:
            ControlError: a reference that does not fit its task.
        """
        tasks, program = self._tasks, self.program
        tasks.weigh(weights, activation)
        if not tasks.is_known():
            return False
        tasks.take(self._kinematics, references)
        program.assemble_bounds(motion.position, motion.velocity, dt, contacts)
        program.assemble_forces(references)
        return True

    def run(
        self,
        motion: Motion,
        expected: FloatArray,
        last_output: FloatArray,
        dt: float,
        *,
        tries: bool,
    ) -> Passed:
        """Pass through a tick; call after `prepare`.

        Args:
            motion: the state.
            expected: v (nv,) [rad/s] expected of it.
            last_output: T (m,) of the last tick [N m].
            dt: time until the next tick [s].
            tries: whether a guess is worth a try; it ends UNSOLVED without.
        """
        start = perf_counter()
        position, velocity = motion.position, motion.velocity
        program, block, at = self.program, np.empty(self._size), self.at
        self._kinematics.take(position, velocity)
        program.leave_out(self._tasks.rows_off)
        known = self._known.get(program.off)
        memory = self._described() if known is None else known[1].table
        ended, before, after, work = pass_usual(
            memory, position, velocity, expected, dt, int(tries), block
        )
        steps = self._guess.took(before, after, work)
        gears = GearState(block[at.sigma], self._bounds, block[at.turning], last_output)
        return Passed(ended, block, gears, steps, perf_counter() - start)

    def solution(self, passed: Passed) -> QPSolution:
        """Return the solution of a pass that found one."""
        at, block = self.at, passed.block
        return QPSolution(block[at.x], block[at.y], block[at.z], _SOLVED, passed.steps)

    def _described(self) -> IntArray:
        """Return the memory of USUAL for the rows that are not left out."""
        program, kinematics, blend = self.program, self._kinematics, self._blend
        plant, problem = program.plant, program.unbound
        plant.stand_on(kinematics)
        gears, (tolerance, allowed, most) = plant.robot.transmission, self._guess.precision
        numbers = [
            kinematics.mass,
            program.force_scale,
            program.weights[0],
            greatest_asked(tolerance),
        ]
        numbers += [tolerance, allowed, blend.trusted_error, blend.full_speed, blend.correction]
        counts = np.array([most, problem.soft, program.rows.torque.stop])
        terms = plant.terms(plant.bias, program.contacts.jacobian, program.force_scale)
        mass, bias, jacobian, _, _, driven, *more = terms
        made = FixedArrays(
            USUAL,
            (
                kinematics.memory,
                *self._tasks.memory(kinematics),
                *program.contacts.memory(kinematics),
                *(program.placing.memory(self._tasks, program.b), *self._guess.memory(problem)),
                *(np.array(numbers), counts, driven, plant.from_joints),
                *(mass, bias, jacobian, *more, *self._law.blended, *self._bounds),
                *(1.0 / gears.gear_ratio, *plant.rotor_friction),
            ),
        )
        self._known[program.off] = problem, made
        return made.table


USUAL = (
    *[FixedTable] * 8,
    *(Row, Places, Places, Matrix),
    *(Dense, Row, Matrix, Dense, Dense, OutRow, OutRow),
    *[Vector] * 8,
)
"""Kinds of what `pass_usual` reads and writes.

Tables of `move_joints`, `fill_state_rows` and `want` for tasks, `fill_state_rows` and `rest` for
contacts, `place_program`, `solve_fixed`; numbers, counts, driven coordinates, D^-1; mass, bias,
contacts' jacobian, topology, rotor, rotor_bias and memory of `place_realised`; slopes of the
meshes, bounds, inverse gear ratios, dry and viscous friction of the rotors (m,).
"""


@compiled(types.UniTuple(Count, 4), FixedTable, *[Vector] * 3, Number, Count, OutRow)
def pass_usual(
    memory: IntArray,
    position: FloatArray,
    velocity: FloatArray,
    expected: FloatArray,
    dt: float,
    tries: int,
    block: FloatArray,
) -> tuple[int, int, int, int]:
    """Pass through a tick in the memory of USUAL.

    Args:
        memory: where all lies.
        position, velocity, expected, dt, tries: as for `UsualTick.run`.
        block: results, as `BlockPlaces` says.

    Returns:
        how it ended; systems solved before and after a climb; multiplications of that.
    """
    numbers, counts = array_at(memory, 8, Row), array_at(memory, 9, Places)
    driven, from_joints = array_at(memory, 10, Places), array_at(memory, 11, Matrix)
    mass, scale = numbers[0], numbers[1]
    nq, nv, m = len(position), len(velocity), len(driven)
    for i in range(nq):
        block[i] = position[i]
    for i in range(nv):
        block[nq + i] = velocity[i]
    move_joints(array_at(memory, 0, FixedTable), velocity)
    fill_state_rows(array_at(memory, 1, FixedTable), mass)
    want(array_at(memory, 2, FixedTable), position, velocity)
    fill_state_rows(array_at(memory, 3, FixedTable), mass)
    rest(array_at(memory, 4, FixedTable), velocity)
    first = nq + nv
    drawn, advanced = block[first : first + nv], block[first + nv : first + 2 * nv]
    end = len(block) - 9 * m
    gears = view(block, end, 9, m)
    turning, measured, sigma = gears[0], gears[1], gears[2]
    kept = 1.0 - min(numbers[8] * dt, 1.0)
    place_judged(
        expected,
        velocity,
        numbers[6],
        kept,
        numbers[7],
        driven,
        from_joints,
        drawn,
        turning,
        measured,
        sigma,
    )
    rotor_bias = array_at(memory, 17, OutRow)
    dry, viscous = array_at(memory, 25, Vector), array_at(memory, 26, Vector)
    for i in range(m):
        rotor_bias[i] = dry[i] * sigma[i] + viscous[i] * measured[i]
    asked = place_program(array_at(memory, 5, FixedTable), scale, numbers[2])
    if not asked < numbers[3]:
        return TOO_LARGE, 0, 0, 0
    if tries == 0:
        return UNSOLVED, 0, 0, 0
    system = array_at(memory, 6, FixedTable)
    hard = len(array_at(system, 1, Row)) - counts[1]
    n = len(array_at(system, 3, Row))
    start = first + 2 * nv
    x = block[start : start + n]
    y, z = block[start + n : start + n + hard], block[start + n + hard : end]
    status, before, after, work, _ = solve_fixed(
        system,
        array_at(memory, 7, FixedTable),
        numbers[4],
        numbers[5],
        counts[0],
        0,
        counts[1],
        counts[2],
        x,
        y,
        z,
    )
    if status != SOLVED:
        return UNSOLVED, before, after, work
    exact = place_realised(
        array_at(memory, 12, Dense),
        array_at(memory, 13, Row),
        array_at(memory, 14, Matrix),
        scale,
        x,
        driven,
        array_at(memory, 15, Dense),
        array_at(memory, 16, Dense),
        rotor_bias,
        array_at(memory, 18, OutRow),
        sigma,
        array_at(memory, 19, Vector),
        array_at(memory, 20, Vector),
        array_at(memory, 21, Vector),
        array_at(memory, 22, Vector),
        array_at(memory, 23, Vector),
        view(block, end + 3 * m, 5, m),
    )
    if not exact:
        return LIMITED, before, after, work
    inverse_ratio = array_at(memory, 24, Vector)
    for i in range(m):
        gears[8, i] = gears[6, i] * inverse_ratio[i]
    place_advanced(drawn, x, dt, advanced)
    return DONE, before, after, work
