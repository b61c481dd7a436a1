"""Who solves the programs of the controller: its own method, daqp, ProxQP, each from nothing.

    python -m benchmarks.solvers [programs]

Programs are those of Solo12, ANYmal and TALOS around their stance, each with 0.3, 1 and 3 rad/s of
noise on every joint, in equal parts; 10,000 when no number is given. Every method gets the same
program and no hint; the own one takes as many steps as in a tick, where solvers follow. Only
programs that at least one of them solves count. A solution counts as solved where no constraint is
broken by more than 1e-5 (accelerations and tenths of the weight). Times are of the thread's own
processor time, without writing the program out. Then who was asked in the ticks themselves, from
which the programs come.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import sys
import time
from collections import Counter

import numpy as np
import pinocchio as pin
from rich.console import Console
from rich.table import Table

import wbc.control.qp.level as level
from benchmarks.controller import machine
from benchmarks.controller_scenes import controller, standing
from wbc.control.qp.active_set import STEPS
from wbc.control.qp.solvers import Daqp, QPStatus, solve
from wbc.effects import load_robot
from wbc.robot import Motion

ROBOTS, NOISE, MOST = ("solo12", "anymal", "talos"), (0.3, 1.0, 3.0), 1000
KEPT, TOLERANCE = 1e-5, 1e-7


def main():
    total = int(sys.argv[1]) if len(sys.argv) > 1 else 10000
    each, console = -(-total // (len(ROBOTS) * len(NOISE))), Console(width=110)
    console.print(machine())
    table = Table("robot", "method", "solved", "worst residual", "worst cost", "median us", "worst")
    shares = Table("robot", "ticks", "solver not asked", "daqp asked", "ProxQP asked", "no motion")
    for name in ROBOTS:
        found, asked = of_robot(name, each)
        for method, (solved, residual, cost, times) in found.items():
            share, middle = f"{100.0 * np.mean(solved):.2f} %", f"{np.median(times):.0f}"
            worst = f"{max(residual):.1e}", f"{max(cost):.1e}"
            table.add_row(name, method, share, *worst, middle, f"{max(times):.0f}")
        ticks = asked.pop("ticks")
        parts = [asked[key] / ticks for key in ("own", "daqp", "proxqp", "no motion")]
        shares.add_row(name, str(ticks), *[f"{100.0 * part:.1f} %" for part in parts])
    console.print(table)
    console.print(shares)


def of_robot(name, each):
    """Return by method whether it solved, residuals, relative excess of cost and times [us]."""
    robot, generator = load_robot(name), np.random.default_rng(0)
    q, nv, ours = standing(robot), robot.model.nv, controller(robot)
    found = {method: ([], [], [], []) for method in ("own", "daqp", "proxqp")}
    asked, told = Counter(), Counter()
    level.solve = lambda *a, **k: (told.update(["proxqp"]), solve(*a, **k))[1]
    one = Daqp.solve
    level.Daqp.solve = lambda *a, **k: (told.update(["daqp"]), one(*a, **k))[1]
    for noise in NOISE:
        for _ in range(each):
            near = pin.integrate(robot.model, q, 2e-3 * generator.normal(size=nv))
            told.clear()
            command = ours.step(Motion(near, noise * generator.normal(size=nv)))
            asked.update(["ticks", *(told or ["own"])])
            asked["no motion"] += not command.status.usable
            judge(ours.problem, own_method(ours), found)
    return found, asked


def own_method(ours):
    """Return what solves the program that stands in a controller, from nothing."""
    asked = ours._answer.level
    asked.program.memory.solver.taken[:] = 0
    return lambda: asked._guessed(STEPS)


def judge(problem, own, found):
    """Add how all methods fare with a program, if one of them solves it."""
    answers = {}
    for method in found:
        start = time.thread_time()
        answer = (
            own() if method == "own" else solve(method, problem, tolerance=TOLERANCE, most=MOST)
        )
        took, broken = 1e6 * (time.thread_time() - start), np.inf
        if answer.status is QPStatus.SOLVED and len(answer.x) == len(problem.g):
            broken = answer.residuals(problem)[0]
        cost = np.inf
        if broken <= KEPT:
            cost = 0.5 * answer.x @ problem.H @ answer.x + problem.g @ answer.x
        answers[method] = broken, cost, took
    least = min(cost for _, cost, _ in answers.values())
    if not np.isfinite(least):
        return
    for method, (broken, cost, took) in answers.items():
        solved, residuals, costs, times = found[method]
        solved.append(broken <= KEPT)
        times.append(took)
        if broken <= KEPT:
            residuals.append(broken)
            costs.append((cost - least) / max(abs(least), 1e-12))


if __name__ == "__main__":
    main()
