"""Time of one tick of the controller, beside its peers on the same robot, tasks and states.

    python -m benchmarks.controller [rounds] [robot ...] [--peers] [--flight]

Every round runs a motion of 4000 ticks with contact changes; blocks of ticks alternate between all
contestants, so that a machine whose speed drifts slows all of them alike: only ratios count. Times
are of one thread. Median and 99th percentile are of processor time; "wall p99" is what an observer
with a clock saw. Of several rounds the least time of each tick counts: other programs that share
caches and cores stretch processor time as well. A peer that is not there is named as absent.
`--peers` leaves out all but the dissipative controller and its peers: seconds instead of minutes.
With `--flight` the robot falls without contacts. "foot up" is the median of the ticks without all.

"Change" is the slowest tick of those from which on other contacts are active.

Every contestant keeps torque limits, and stops and speeds of joints, and knows a Coulomb friction
of 0.1 N m at every joint; peers, which have none, add it to their torques.

A peer runs in a Python of its own, which WBC_TSID_PYTHON and WBC_PLACO_PYTHON name, each in a fresh
environment: `pip install placo==0.10.2`; and, of Python 3.11, `pip install pin==4.0.0 eiquadprog`,
`pip install --no-deps tsid==1.10.0`, and its library from another wheel: `pip download --no-deps
--python-version 3.14 --only-binary=:all: libtsid==1.10.0`, `python -m zipfile -e libtsid*.whl
SITE-PACKAGES`.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import platform
import sys
import tempfile
import time
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.controller_scenes import URDF, controller, scene
from benchmarks.peer_scene import write_scene
from benchmarks.peers.process import Peer
from wbc.control import WarmStart

HERE = Path(__file__).resolve().parent
TICKS, BLOCK = 4000, 100
ROBOTS = ("planar_leg_strong", "solo12", "anymal", "talos")
PEERS = (
    ("TSID, eiquadprog", "WBC_TSID_PYTHON", "tsid_controller.py"),
    ("PlaCo, eiquadprog", "WBC_PLACO_PYTHON", "placo_controller.py"),
)


def main():
    given = [word for word in sys.argv[1:] if word not in ("--peers", "--flight")]
    rounds, only_peers = int(given[0]) if given else 1, "--peers" in sys.argv
    flies = "--flight" in sys.argv
    names = given[1:] or ROBOTS
    console, messages = Console(width=110), set()
    console.print(machine())
    titles = "robot", "contestant", "median us", "p99", "wall p99", "ratio", "foot up", "ratio"
    times = Table(*titles, "change")
    for name in names:
        robot, states = scene(name, TICKS, flies=flies)
        feet = max(len(tick.contacts or ()) for tick in states)
        up = [tick.contacts is not None and len(tick.contacts) < feet for tick in states]
        up = np.array(up) if any(up) else np.ones(TICKS, dtype=bool)
        pairs = enumerate(pairwise(states), 1)
        changes = [k for k, (one, other) in pairs if active(one) != active(other)]
        found = compare(robot, states, rounds, messages, only_peers)
        base, least = (np.median(found["dissipative"][rows, 0]) for rows in (slice(None), up))
        for contestant, taken in found.items():
            middle, high = np.median(taken[:, 0]), np.percentile(taken[:, 0], 99)
            times.add_row(
                name,
                contestant,
                f"{middle:.0f}",
                f"{high:.0f}",
                f"{np.percentile(taken[:, 1], 99):.0f}",
                f"{middle / base:.2f}",
                f"{np.median(taken[up, 0]):.0f}",
                f"{np.median(taken[up, 0]) / least:.2f}",
                f"{taken[changes, 0].max():.0f}" if changes else "",
            )
        times.add_section()
    console.print(times)
    for message in sorted(messages):
        console.print(message)


def active(tick):
    """Return the names of the contacts that may carry any force; None for all."""
    return None if tick.contacts is None else {n for n, most in tick.contacts.items() if most > 0.0}


def machine(*more):
    """Return one line on the machine and the libraries, `more` of them besides the usual ones."""
    libraries = ("pin", "proxsuite", "daqp", "numpy", "scipy", *more)
    versions = ", ".join(f"{name} {version(name)}" for name in libraries)
    return f"{processor()}, {os.cpu_count()} cores, Python {platform.python_version()}, {versions}"


def processor():
    """Return the name of the processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    return next((line.split(":")[1].strip() for line in lines if "model name" in line), "?")


def compare(robot, states, rounds, messages, only_peers=False):
    """Return processor and wall time [us] (k, 2) by contestant, measured in alternating blocks."""
    always = {"warm_start": WarmStart.SOLVER}
    ours = {"dissipative": controller(robot)}
    if not only_peers:
        ours |= {
            "conservative": controller(robot.lossless()),
            "dissipative, proxsuite every tick": controller(robot, solver="proxqp", **always),
            "dissipative, daqp every tick": controller(robot, **always),
        }
    times = {key: [] for key in ours}
    with tempfile.TemporaryDirectory() as folder:
        peers = start_peers(robot, states, folder, messages)
        times |= {peer.name: [] for peer in peers}
        for first in list(range(0, TICKS, BLOCK)) * rounds:
            block = states[first : first + BLOCK]
            for key, contestant in ours.items():
                if first == 0:
                    contestant.reset()
                run(contestant, block, times[key])
            for peer in peers:
                times[peer.name] += peer.run(first, len(block))
        for peer in peers:
            messages.add(f"{peer.name}: {peer.version}")
            peer.close()
    return {
        key: np.array(taken).reshape(rounds, TICKS, 2).min(axis=0) for key, taken in times.items()
    }


def run(contestant, block, times):
    """Add processor and wall time [us] of each tick of a block.

    The first tick runs once before the clock does: the others have had the caches meanwhile.
    """
    contestant.step(block[0].motion, block[0].references, block[0].contacts)
    for tick in block:
        start = time.process_time_ns(), time.perf_counter_ns()
        command = contestant.step(tick.motion, tick.references, tick.contacts)
        stop = time.process_time_ns(), time.perf_counter_ns()
        times.append([1e-3 * (b - a) for a, b in zip(start, stop, strict=True)])
        if not command.status.usable:
            raise RuntimeError(command.message)


def start_peers(robot, states, folder, messages):
    """Return the peers that are there, running the same scene."""
    found = []
    if robot.name not in URDF:
        return found
    file = write_scene(robot, states, folder)
    for name, variable, script in PEERS:
        try:
            found.append(Peer(name, variable, HERE / "peers" / script, file))
        except (LookupError, RuntimeError) as cause:
            messages.add(str(cause))
    return found


if __name__ == "__main__":
    main()
