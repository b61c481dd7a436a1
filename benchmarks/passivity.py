"""Does any step make energy? `python -m benchmarks.passivity` tries random robots and grounds.

First table: the most that contacts, stops and gears made at frozen H(q), as a share of the energy
in play, by ground. Second table: what the discretisation leaves of the energy balance over 30 ms,
as a share of the energy in play, at a step and at halves of it.
"""

from __future__ import annotations

import argparse
import platform
import time

import numpy as np
import pinocchio as pin

from tests.sim.ground.random_grounds import GROUNDS, made_by_rows, random_scene
from tests.sim.random_robots import BASES
from wbc.errors import SimulationError
from wbc.sim import Plant, SimState


def search(count: int, first: int = 0) -> None:
    """Print the worst of `count` random scenes per ground."""
    print(f"{'ground':8s}{'steps':>8s}{'impacts':>9s}{'events':>8s}{'refused':>9s}{'made':>12s}")
    for ground in GROUNDS:
        steps = impacts = events = refused = 0
        worst, where = -np.inf, -1
        for seed in range(first, first + count):
            rng = np.random.default_rng(seed)
            base, back = str(rng.choice(BASES)), float(rng.choice([0.0, 0.5, 1.0]))
            plant, state = random_scene(rng, base, ground, back)
            dt = 10.0 ** rng.uniform(-5.0, -1.5)
            torque = float(rng.choice([0.0, 10.0])) * _torque(rng, plant)
            for _ in range(5):
                try:
                    result = plant.step(state, torque, dt)
                except SimulationError as error:
                    refused += 1
                    print(f"  seed {seed}: {str(error)[:90]}")
                    break
                state, steps, impacts = result.state, steps + 1, impacts + len(result.impacts)
                events += sum(event.kind == "energy" for event in result.events)
                made = made_by_rows(result)
                if made > worst:
                    worst, where = made, seed
        row = f"{ground:8s}{steps:8d}{impacts:9d}{events:8d}{refused:9d}{worst:12.1e}"
        print(f"{row}   (seed {where})")


def _torque(rng: np.random.Generator, plant: Plant) -> np.ndarray:
    ratio = plant.robot.transmission.gear_ratio
    return rng.uniform(-1.0, 1.0, len(ratio)) / np.abs(ratio)


def halving(count: int) -> None:
    """Print the mean imbalance of `count` scenes at three steps."""
    print("\n" + f"{'ground':8s}" + "".join(f"{dt * 1e3:>12g} ms" for dt in (1.0e-3, 5e-4, 2.5e-4)))
    for ground in GROUNDS:
        left = np.zeros((count, 3))
        for seed in range(count):
            rng = np.random.default_rng(seed)
            plant, start = random_scene(rng, str(rng.choice(BASES)), ground, 0.0, least=0.0)
            for i, dt in enumerate((1e-3, 5e-4, 2.5e-4)):
                left[seed, i] = _imbalance(plant, start, dt)
        print(f"{ground:8s}" + "".join(f"{value:15.2e}" for value in left.mean(axis=0)))


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
    parser.add_argument("--count", type=int, default=200, help="scenes per ground")
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--halvings", type=int, default=20, help="scenes of the second table")
    given = parser.parse_args()
    print(f"pinocchio {pin.__version__}, numpy {np.__version__}, {platform.machine()}")
    begin = time.process_time()
    search(given.count, given.first)
    halving(given.halvings)
    print(f"{time.process_time() - begin:.0f} s of one processor")


if __name__ == "__main__":
    main()
