"""A hundred thousand designs of the two-joint leg at once, beside the loop over designs.

    python -m benchmarks.design_metrics

Everything varies: reduction, both efficiencies, rotor inertia, rotor friction, link lengths and
masses, pose. The loop evaluates a sample of the same designs one by one with the metrics of one
robot; its time per design and the arrays' are measured in turn, in one thread of one core, and only
their ratio counts. The largest difference between the two is printed beside it.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import time

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.controller import machine
from wbc.effects import load_robot
from wbc.metrics import Designs, design_metrics, holding, pose_sweep

DESIGNS, SAMPLE, ROUNDS = 100_000, 200, 3
COMPARED = ("inertia", "backward_inertia", "conventional", "lift", "hold", "impact_mitigation")


def designs(count: int, gears_only: bool, seed: int = 0) -> Designs:
    """Return random designs of the leg of the case study."""
    robot, rng = load_robot("planar_leg"), np.random.default_rng(seed)
    gears = {
        "gear_ratio": rng.uniform(6.0, 160.0, count),
        "forward_efficiency": rng.uniform(0.5, 0.98, (count, 2)),
        "backward_efficiency": rng.uniform(-0.1, 0.98, (count, 2)),
        "rotor_inertia": rng.uniform(1e-6, 1e-4, (count, 2)),
        "rotor_coulomb_friction": rng.uniform(0.0, 0.1, (count, 2)),
    }
    pose = robot.pose("paper")
    if gears_only:
        return Designs.of(robot, pose, gears)
    q = np.tile(pose, (count, 1))
    q[:, robot.actuated_position] += 0.2 * rng.normal(size=(count, 2))
    lengths = {link: rng.uniform(0.2, 0.6, count) for link in ("thigh", "shin")}
    masses = {"base": rng.uniform(5.0, 20.0, count), "thigh": rng.uniform(1.0, 3.0, count)}
    return Designs.of(robot, q, gears, lengths, masses)


def at_once(chosen: Designs) -> tuple[float, dict[str, np.ndarray]]:
    """Return the processor time [s] and the table of all designs."""
    start = time.process_time()
    found = design_metrics(chosen, "foot", [0, 1], "xz").columns()
    return time.process_time() - start, found


def one_by_one(chosen: Designs, table: dict[str, np.ndarray]) -> tuple[float, float]:
    """Return the processor time [s] per design and the largest relative difference."""
    worst = 0.0
    start = time.process_time()
    for i in range(SAMPLE):
        robot, q = chosen.robot_at(i)
        single = pose_sweep(robot, q[None], "foot", [0, 1], axes="xz")
        holding(robot, q, "foot", [0, 1], 100.0, "xz")
        for name in COMPARED:
            one, other = float(getattr(single, name)[0]), float(table[name][i])
            if np.isfinite(one) or np.isfinite(other):
                # A factor is one minus a ratio: where it is near zero its rounding is of that one.
                size = 1.0 if name == "impact_mitigation" else abs(one)
                worst = max(worst, abs(one - other) / size)
    return (time.process_time() - start) / SAMPLE, worst


def main() -> None:
    table = Table(
        "what varies", "all at once [s]", "loop [ms each]", "ratio", "difference", box=None
    )
    for label, gears_only in (("gears", True), ("gears, links, pose", False)):
        chosen = designs(DESIGNS, gears_only)
        design_metrics(chosen.part(0, 5000), "foot", [0, 1], "xz")
        rounds = []
        for _ in range(ROUNDS):
            whole, found = at_once(chosen)
            each, worst = one_by_one(chosen, found)
            rounds.append((whole, each, worst))
        whole, each = (float(np.median([r[i] for r in rounds])) for i in (0, 1))
        table.add_row(
            label,
            f"{whole:.2f}",
            f"{1e3 * each:.2f}",
            f"{each * DESIGNS / whole:.0f}",
            f"{max(r[2] for r in rounds):.1e}",
        )
    console = Console(highlight=False)
    console.print(machine(), markup=False)
    console.print(f"{DESIGNS} designs of planar_leg, metrics along z; median of {ROUNDS} rounds")
    console.print(table)


if __name__ == "__main__":
    main()
