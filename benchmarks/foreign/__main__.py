"""The controller on robots that this project does not ship: one check for each promise.

    python -m benchmarks.foreign [robot ...] [check ...]

HyQ, Go2, G1, Panda and TIAGo of `example-robot-data`, with gears that are assumed. Prints one line
per robot and promise, and the number of those that do not hold, which is the exit code. All checks
take some minutes.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import sys

from benchmarks.controller import machine
from benchmarks.foreign import distances, loop, motion_tasks, safety, ticks
from benchmarks.foreign.robots import ROBOTS

PARTS = (safety, ticks, distances, motion_tasks, loop)
CHECKS = {check.__name__: check for part in PARTS for check in part.CHECKS}


def main(asked):
    """Run the named checks on the named robots, all of either where none is named."""
    unknown = [name for name in asked if name not in ROBOTS.keys() | CHECKS.keys()]
    if unknown:
        raise SystemExit(
            f"no robot or check: {', '.join(unknown)}; there are {', '.join([*ROBOTS, *CHECKS])}."
        )
    print(machine(), flush=True)
    broken = 0
    for name in [n for n in ROBOTS if n in asked] or ROBOTS:
        foreign = ROBOTS[name]()
        for title in [n for n in CHECKS if n in asked] or CHECKS:
            found = CHECKS[title](foreign)
            if found is None:
                continue
            broken += not found[1]
            word = "holds " if found[1] else "BROKEN"
            print(f"{name:6s} {title:17s} {word} {found[0]}", flush=True)
    print(f"{broken} broken", flush=True)
    return broken


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
