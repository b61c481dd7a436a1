"""What peers share: the scene that they are given, and the blocks of ticks that they are asked for.

Imported by scripts that run in a Python of their own, beside this file.
"""

from __future__ import annotations

import json
import sys
import time


def given():
    """Return the scene (JSON) that the command line names."""
    with open(sys.argv[1], encoding="utf-8") as file:
        return json.load(file)


def serve(version, run):
    """Say the version; answer each line "first count" with the times of these ticks [us].

    Args:
        version: of the peer and its libraries.
        run: called with the number of a tick.
    """
    print(json.dumps([version]), flush=True)
    for line in sys.stdin:
        first, count = map(int, line.split())
        times = []
        for tick in (first, *range(first, first + count)):  # the first once to warm up
            start = time.process_time_ns(), time.perf_counter_ns()
            run(tick)
            stop = time.process_time_ns(), time.perf_counter_ns()
            times.append([1e-3 * (b - a) for a, b in zip(start, stop, strict=True)])
        print(json.dumps(times[1:]), flush=True)
