"""Does any step make energy? `python -m benchmarks.passivity` tries random robots and grounds.

First table, by ground: the most that contacts, stops and gears made in one part of a step at frozen
H(q), as a share of the energy in play (negative: they took energy everywhere), and how many steps
called themselves an event of energy. Second table: what the discretisation leaves of the energy
balance over 30 ms, as a share of the energy in play, at a step and at halves of it.

18 000 steps take 1.5 minutes of one processor: --count 720. Steps that have several solutions
(self-locking gears) are errors, and their scenes end there. --soft lets the gears yield, with and
without play and dampers. A barrier that is overrun is printed, too.
"""

from __future__ import annotations

import argparse
import platform
import time

import numpy as np
import pinocchio as pin

from tests.sim.ground.random_grounds import GROUNDS, drawn_scene, made_by_rows, random_scene
from tests.sim.random_robots import BASES
from wbc.errors import SimulationError
from wbc.sim import Plant, SimState

STEPS, HALVES = 5, (1e-3, 5e-4, 2.5e-4)
HALVED = 0.6
"""Share of the imbalance that half the step may leave, for a scene to count as halved."""
SMALL = 1e-6
"""Imbalance below which the tolerance of touching (1 um) shows instead of the step."""


def search(count: int, first: int = 0, *, soft: bool = False) -> None:
    """Print the worst of `count` random scenes per ground."""
    print(f"{'ground':8s}{'steps':>8s}{'impacts':>9s}{'events':>8s}{'refused':>9s}{'made':>12s}")
    total = np.zeros(4, dtype=int)
    for ground in GROUNDS:
        found, worst, where = np.zeros(4, dtype=int), -np.inf, -1
        for seed in range(first, first + count):
            numbers, made = _scene(seed, ground, soft)
            found += numbers
            if made > worst:
                worst, where = made, seed
        total += found
        print(f"{ground:8s}{_numbers(found)}{worst:12.1e}   (seed {where})")
    print(f"{'all':8s}{_numbers(total)}")


def _numbers(found: np.ndarray) -> str:
    return "{:8d}{:9d}{:8d}{:9d}".format(*found)


def _scene(seed: int, ground: str, soft: bool) -> tuple[np.ndarray, float]:
    """Return steps, impacts, events and refusals (4,) of a scene, and the most that was made."""
    plant, state, torque, dt = drawn_scene(seed, ground, soft=soft)
    found, worst = np.zeros(4, dtype=int), -np.inf
    for _ in range(STEPS):
        try:
            result = plant.step(state, torque, dt)
        except SimulationError as error:
            print(f"  seed {seed}, {ground}: {str(error)[:80]}")
            found[3] += 1
            return found, worst
        state, events = result.state, [e for e in result.events if e.kind == "energy"]
        for event in events:
            print(f"  seed {seed}, {ground}: {event.text}")
        for event in result.events:
            if event.kind == "overlap":
                print(f"  seed {seed}, {ground}, steps of {1e3 * dt:.3g} ms: {event.text}")
        found += [1, len(result.impacts), len(events), 0]
        worst = max(worst, made_by_rows(result))
    return found, worst


def halving(count: int) -> None:
    """Print the mean imbalance of `count` scenes at three steps, and how many scenes halve it."""
    heads = "".join(f"{dt * 1e3:>12g} ms" for dt in HALVES)
    print("\n" + f"{'ground':8s}{heads}{'halved':>10s}{'below 1e-6':>12s}{'else':>6s}")
    for ground in GROUNDS:
        left = np.zeros((count, len(HALVES)))
        for seed in range(count):
            rng = np.random.default_rng(seed)
            plant, start = random_scene(rng, str(rng.choice(BASES)), ground, 0.0, least=0.0)
            left[seed] = [_imbalance(plant, start, dt) for dt in HALVES]
        small = left[:, -1] < SMALL
        halved = ~small & (left[:, -1] <= HALVED ** (len(HALVES) - 1) * left[:, 0])
        numbers = f"{halved.sum():10d}{small.sum():12d}{(~small & ~halved).sum():6d}"
        print(f"{ground:8s}" + "".join(f"{x:15.2e}" for x in left.mean(axis=0)) + numbers)


def _imbalance(plant: Plant, state: SimState, dt: float) -> float:
    residual, traffic = 0.0, 1.0
    for _ in range(round(0.03 / dt)):
        result = plant.step(state, np.zeros(plant.robot.transmission.size), dt)
        state = result.state
        residual += result.balance.residual
        traffic += result.energy.lost + abs(result.energy.work)
    return abs(residual) / traffic


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=720, help="scenes per ground")
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--halvings", type=int, default=40, help="scenes of the second table")
    parser.add_argument("--soft", action="store_true", help="gears that yield; first table only")
    given = parser.parse_args()
    print(f"pinocchio {pin.__version__}, numpy {np.__version__}, {platform.machine()}")
    begin = time.process_time()
    search(given.count, given.first, soft=given.soft)
    if not given.soft:
        halving(given.halvings)
    print(f"{time.process_time() - begin:.0f} s of one processor")


if __name__ == "__main__":
    main()
