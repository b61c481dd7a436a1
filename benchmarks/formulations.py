"""The programs of Talos' ticks in four sets of variables, each solved by two solvers.

    python -m benchmarks.formulations

All four are the same program: accelerations and contact forces, as the controller has it; what the
contacts leave of the accelerations, and forces; accelerations, forces and rotor torques; rotor
torques and forces. Every tick goes to all contestants in turn, so that only ratios count; times are
processor time of one thread. "solve" is the solver alone, starting from its last solution where it
can; "rewrite" is what numpy takes to bring the controller's program into the variables.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import time

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.controller import machine
from benchmarks.controller_scenes import controller, scene
from wbc.control import WarmStart
from wbc.control.solvers import QPProblem, make_solver

TICKS, TOLERANCE, ITERATIONS = 1500, 1e-7, 200
SOFTENING = 1e-9  # of torques that no cost sees: daqp needs a positive definite Hessian
SOLVERS = ("proxqp", "daqp")


def full(problem, nv, torques):
    """Return the program as it is, and the map x = shift + back @ z to its variables."""
    n = len(problem.g)
    return problem, np.eye(n), np.zeros(n)


def substituted(problem, back, shift, keep):
    """Return a program in z for x = shift + back @ z, with only `keep` of its equalities."""
    H, g, A, b, C, lower, upper = problem
    moved = C @ shift
    return QPProblem(
        back.T @ H @ back,
        back.T @ (g + H @ shift),
        A[keep] @ back,
        b[keep] - A[keep] @ shift,
        C @ back,
        lower - moved,
        upper - moved,
    )


def contact_nullspace(problem, nv, torques):
    """Return the program in what the resting contacts leave of the accelerations, and forces."""
    n, contact = len(problem.g), np.arange(6, len(problem.b))
    rows, q = problem.A[contact][:, :nv], len(contact)
    basis, corner = np.linalg.qr(rows.T, mode="complete")
    shift, back = np.zeros(n), np.zeros((n, n - q))
    shift[:nv] = basis[:, :q] @ np.linalg.solve(corner[:q].T, problem.b[contact])
    back[:nv, : nv - q], back[nv:, nv - q :] = basis[:, q:], np.eye(n - nv)
    return substituted(problem, back, shift, np.arange(6)), back, shift


def torque_block(problem, nv, torques):
    """Return the program with the rotor torques as variables, which one equality each defines."""
    H, g, A, b, C, lower, upper = problem
    n, m = len(g), len(torques)
    wide = np.zeros((n + m, n + m))
    wide[:n, :n] = H
    wide[range(n, n + m), range(n, n + m)] = SOFTENING
    rows = np.zeros((len(b) + m, n + m))
    rows[: len(b), :n], rows[len(b) :, :n], rows[len(b) :, n:] = A, C[torques], -np.eye(m)
    limits = np.zeros((len(lower), n + m))
    limits[m:, :n], limits[:m, n:] = C[m:], np.eye(m)
    right = np.concatenate([b, np.zeros(m)])
    made = QPProblem(wide, np.concatenate([g, np.zeros(m)]), rows, right, limits, lower, upper)
    return made, np.eye(n, n + m), np.zeros(n)


def torques_and_forces(problem, nv, torques):
    """Return the program in rotor torques and forces: the equation of motion gives the rest."""
    n, m = len(problem.g), len(torques)
    motion = np.vstack([problem.A[:6], problem.C[torques]])
    right = np.zeros((nv, 1 + n - nv + m))
    right[:6, 0], right[6:, 1 : 1 + m] = problem.b[:6], np.eye(m)
    right[:, 1 + m :] = -motion[:, nv:]
    solved = np.linalg.solve(motion[:, :nv], right)
    back, shift = np.zeros((n, m + n - nv)), np.zeros(n)
    back[:nv], shift[:nv] = solved[:, 1:], solved[:, 0]
    back[nv:, m:] = np.eye(n - nv)
    return substituted(problem, back, shift, np.arange(6, len(problem.b))), back, shift


FORMULATIONS = {
    "accelerations, forces": full,
    "contacts' null space, forces": contact_nullspace,
    "accelerations, forces, torques": torque_block,
    "torques, forces": torques_and_forces,
}


def measure(ticks=TICKS):
    """Return solve and rewrite times [us], sizes, and the worst difference of qdd by contestant.

    The difference is from the controller's own variables solved by daqp, over 1 + its largest
    acceleration.
    """
    robot, states = scene("talos", ticks)
    contestant = controller(robot, solver="daqp", warm_start=WarmStart.SOLVER)
    nv, torques = robot.model.nv, np.arange(robot.transmission.size)
    found = {(name, solver): [] for name in FORMULATIONS for solver in SOLVERS}
    solvers = {}
    for tick in states:
        command = contestant.step(tick.motion, tick.references, tick.contacts)
        problem, truth = contestant.problem, command.acceleration
        scale = 1.0 + np.abs(truth).max()
        for name, rewrite in FORMULATIONS.items():
            start = time.process_time_ns()
            program, back, shift = rewrite(problem, nv, torques)
            rewriting = 1e-3 * (time.process_time_ns() - start)
            size = len(program.g), len(program.b), len(program.lower)
            for solver in SOLVERS:
                limits = {"tolerance": TOLERANCE, "max_iterations": ITERATIONS}
                made = solvers.setdefault((name, solver, size), None) or make_solver(
                    solver, *size, **limits
                )
                solvers[name, solver, size] = made
                start = time.process_time_ns()
                z = made.solve(program).x
                solving = 1e-3 * (time.process_time_ns() - start)
                off = np.abs((shift + back @ z)[:nv] - truth).max() / scale
                found[name, solver].append((solving, rewriting, off, *size))
    return {key: np.array(rows) for key, rows in found.items()}


def main():
    console = Console(width=120)
    console.print(machine())
    table = Table("variables", "solver", "n, n_eq, n_in", "solve us", "p99", "rewrite us", "off")
    for (name, solver), rows in measure().items():
        n, n_eq, n_in = rows[:, 3:].max(axis=0)
        table.add_row(
            name,
            solver,
            f"{n:.0f}, {n_eq:.0f}, {n_in:.0f}",
            f"{np.median(rows[:, 0]):.0f}",
            f"{np.percentile(rows[:, 0], 99):.0f}",
            f"{np.median(rows[:, 1]):.0f}",
            f"{np.nanmax(rows[:, 2]):.0e}" + (" FAILS" if np.isnan(rows[:, 2]).any() else ""),
        )
    console.print(table)


if __name__ == "__main__":
    main()
