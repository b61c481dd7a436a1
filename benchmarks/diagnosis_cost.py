"""What a diagnosis costs: seconds of one core over samples and candidates.

    python -m benchmarks.diagnosis_cost [--seed N] [--json FILE]

The logs hold friction at the knee and a payload, so that causes are found and exchanged. Times are
those of the process, whatever else the machine does; ratios count.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence

from rich.console import Console
from rich.table import Table

from benchmarks.results import finish
from wbc import load_robot
from wbc.effects import EFFECTS, CoulombFriction, PayloadMass
from wbc.identification import diagnose
from wbc.identification.model.yielding import deflects
from wbc.measurement import Log
from wbc.robot import Effect
from wbc.sim.excitation import record_with

HIDDEN = (CoulombFriction("knee", 0.4), PayloadMass("foot", 0.2))
DURATIONS = (5.0, 10.0, 20.0)


def main() -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", metavar="FILE")
    options = parser.parse_args()
    console = Console()
    rows = [measure(duration, options.seed, console) for duration in DURATIONS]
    table = Table(
        "log [s]", "samples", "all effects", "acting at once", "a third of them", box=None
    )
    for row in rows:
        table.add_row(*(f"{value:.4g}" for value in row.values()))
    table.caption = "CPU seconds for 4 logs of the two-joint leg at 500 Hz"
    console.print(table)
    finish(console, rows, options.json)


def measure(duration: float, seed: int, console: Console) -> dict[str, float]:
    """Return the costs with logs of one length."""
    leg = load_robot("planar_leg_fixed").lossless()
    logs = record_with(leg, list(HIDDEN), duration=duration, seed=seed)
    logs = (*logs, *record_with(leg, list(HIDDEN), duration=duration, seed=seed + 100))[:4]
    direct = [kind for kind in EFFECTS.values() if not deflects(kind)]
    few = [kind for kind in direct[::3] if kind not in (CoulombFriction, PayloadMass)]
    few += [CoulombFriction, PayloadMass]
    with console.status(f"logs of {duration:g} s"):
        return {
            "duration": duration,
            "samples": float(sum(len(log) for log in logs)),
            "all": seconds(logs, list(EFFECTS.values())),
            "direct": seconds(logs, direct),
            "third": seconds(logs, few),
        }


def seconds(logs: Sequence[Log], candidates: list[type[Effect]]) -> float:
    """Return the CPU seconds of one diagnosis."""
    leg = load_robot("planar_leg_fixed").lossless()
    start = time.process_time()
    diagnose(leg, logs, candidates=candidates)
    return time.process_time() - start


if __name__ == "__main__":
    main()
