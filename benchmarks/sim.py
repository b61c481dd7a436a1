"""Steps per second of the plant beside MuJoCo on the same model and step, in the same run.

MuJoCo knows no directional efficiency: it gets lossless gears (armature N^2 I_r) and its own soft
contact, the plant gets the lossy gears it is for. Both are stepped from Python under the same
Python PD. A second table holds every case against the least that its library calls cost in Python,
a third the closed loop at 1 kHz, a fourth says where the time goes, a fifth how it grows with gears
and contacts.
Run: python -m benchmarks.sim [--profile]
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import cProfile
import pstats

from rich.console import Console
from rich.table import Table

from benchmarks.sim_cases import DT, Case, cases
from benchmarks.sim_floor import bare_step
from benchmarks.sim_growth import growth
from benchmarks.sim_loop import loop_table
from benchmarks.sim_time import best_in_turns, mujoco_run, plant_run


def rates(timed: dict[str, Case]) -> tuple[Table, Table, dict[str, float]]:
    """Return the tables beside MuJoCo and beside the floor, and the plant's seconds per step."""
    beside = Table(title=f"steps per second at dt = {DT * 1e3:g} ms, one core")
    for name in ("case", "plant", "x real time", "MuJoCo", "MuJoCo / plant"):
        beside.add_column(name, justify="left" if name == "case" else "right")
    floor = Table(title="plant step over its bare library calls (pinocchio, LAPACK, numpy)")
    for name in ("case", "step [us]", "calls [us]", "step / calls"):
        floor.add_column(name, justify="left" if name == "case" else "right")
    seconds = {}
    for name, case in timed.items():
        bare = bare_step(case)
        calls = (lambda bare=bare: [bare() for _ in range(100)]), 100
        own, peer, least = best_in_turns(plant_run(case), mujoco_run(case), calls)
        seconds[name] = own
        ratio = own / peer
        beside.add_row(name, f"{1 / own:.0f}", f"{DT / own:.1f}", f"{1 / peer:.0f}", f"{ratio:.1f}")
        floor.add_row(name, f"{own * 1e6:.0f}", f"{least * 1e6:.0f}", f"{own / least:.1f}")
    return beside, floor, seconds


def shares(case: Case) -> dict[str, float]:
    """Return the share of the step's time per module; library calls count for their caller."""
    run, _ = plant_run(case)
    profiler = cProfile.Profile()
    profiler.runcall(run)
    found: dict[str, float] = {}
    for (file, _, _), (_, _, own, _, callers) in pstats.Stats(profiler).stats.items():
        if "/wbc/" in file:
            parts = [(file, own)]
        else:
            parts = [(who[0], part[2]) for who, part in callers.items()]
        for place, time in parts:
            inside = "/wbc/" in place
            module = place.split("/wbc/")[1].removesuffix(".py") if inside else "other"
            found[module] = found.get(module, 0.0) + time
    total = sum(found.values())
    return {name: time / total for name, time in sorted(found.items(), key=lambda i: -i[1])}


def where_it_goes(timed: dict[str, Case]) -> Table:
    """Return the table of the modules that take most of a step."""
    table = Table("module", title="share of a step's time, profiled [%]")
    found = {name: shares(timed[name]) for name in ("planar leg, stance", "solo12, stance")}
    for name in found:
        table.add_column(name, justify="right")
    first = next(iter(found.values()))
    for module in list(first)[:12]:
        table.add_row(module, *(f"{100.0 * part.get(module, 0.0):.0f}" for part in found.values()))
    return table


def main() -> dict[str, float]:
    """Print the tables; return the plant's seconds per step."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--profile", action="store_true", help="print every function's time too")
    console, timed = Console(), cases()
    beside, floor, seconds = rates(timed)
    for table in (beside, floor, loop_table()[0], where_it_goes(timed)):
        console.print(table)
    growth()
    if parser.parse_args().profile:
        for name, case in timed.items():
            profiler = cProfile.Profile()
            profiler.runcall(plant_run(case)[0])
            console.print(name)
            pstats.Stats(profiler).sort_stats("tottime").print_stats(20)
    return seconds


if __name__ == "__main__":
    main()
