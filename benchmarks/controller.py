"""Time of one tick of the controller, beside PlaCo on the same robot, tasks, contacts and states.

    python -m benchmarks.controller [ticks]

Blocks of ticks alternate between all contestants, so that a machine whose speed drifts slows all
of them alike; only ratios count. Times are of one thread, median and 99th percentile. A peer that
is not there is skipped with a message. "raw" is proxsuite alone on the same programs.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
from rich.console import Console
from rich.table import Table

from benchmarks.controller_scenes import (
    COM_WEIGHT,
    POSTURE_WEIGHT,
    STIFFNESS,
    TRUNK,
    TRUNK_WEIGHT,
    URDF,
    controller,
    scene,
)
from benchmarks.peers.process import Peer

HERE = Path(__file__).resolve().parent
BLOCK = 100


def main():
    ticks = int(sys.argv[1]) if len(sys.argv) > 1 else 2000
    table = Table("robot", "contestant", "median us", "p99 us", "ratio")
    messages = set()
    for name in ("planar_leg_strong", "solo12", "anymal", "talos"):
        rows = compare(name, ticks, messages)
        base = np.median(rows["dissipative"])
        for contestant, times in rows.items():
            table.add_row(
                name,
                contestant,
                f"{np.median(times):.0f}",
                f"{np.percentile(times, 99):.0f}",
                f"{np.median(times) / base:.2f}",
            )
    console = Console()
    console.print(table)
    for message in sorted(messages):
        console.print(message)


def compare(name, ticks, messages):
    """Return times [us] by contestant for one robot, measured in alternating blocks."""
    robot, states = scene(name, ticks)
    ours = {
        "dissipative": controller(robot),
        "conservative": controller(robot.lossless()),
        "dissipative, daqp": controller(robot, solver="daqp"),
    }
    times = {key: [] for key in ours} | {"raw proxsuite": []}
    peer = start_peer(name, robot, states, messages)
    if peer is not None:
        times[peer.name] = []
    for first in range(0, ticks, BLOCK):
        count = min(BLOCK, ticks - first)
        for key, contestant in ours.items():
            for tick in states[first : first + count]:
                start = time.perf_counter()
                command = contestant.step(tick.motion, tick.references)
                times[key].append(1e6 * (time.perf_counter() - start))
                if not command.status.usable:
                    raise RuntimeError(f"{name}: {key}: {command.message}")
                if key == "dissipative":
                    times["raw proxsuite"].append(1e6 * command.solve_time)
        if peer is not None:
            times[peer.name] += peer.run(first, count)
    if peer is not None:
        peer.close()
    return times


def start_peer(name, robot, states, messages):
    """Return PlaCo running the same scene, None where it is not there or cannot."""
    if name not in URDF:
        return None
    try:
        return Peer(
            "PlaCo",
            "WBC_PLACO_PYTHON",
            HERE / "peers" / "placo_controller.py",
            write_scene(name, robot, states),
        )
    except (LookupError, RuntimeError) as cause:
        messages.add(str(cause))
        return None


def write_scene(name, robot, states):
    """Write what a peer needs to know as JSON; return the file."""
    prefix = Path(pin.__file__).resolve().parents[4] / "share" / "example-robot-data"
    flat = name == "talos"
    frames = {contact.frame for contact in robot.contacts}
    folder = Path(tempfile.mkdtemp())
    description = {
        "urdf": str(without_meshes(prefix / "robots" / URDF[name], folder)),
        "joints": list(robot.joints[1:]),
        "positions": [tick.motion.position.tolist() for tick in states],
        "velocities": [tick.motion.velocity.tolist() for tick in states],
        "com": [tick.com.tolist() for tick in states],
        "stiffness": STIFFNESS,
        "com_weight": COM_WEIGHT,
        "trunk_weight": TRUNK_WEIGHT,
        "posture_weight": POSTURE_WEIGHT,
        "trunk": TRUNK[name],
        "feet": sorted(frames),
        "flat": flat,
        "sole": [0.21, 0.13],
        "friction": 0.7,
    }
    path = folder / f"{name}.json"
    path.write_text(json.dumps(description), encoding="utf-8")
    return path


def without_meshes(urdf, folder):
    """Return a copy of a URDF without visual and collision shapes, which peers insist on."""
    tree = ElementTree.parse(urdf)
    for link in tree.getroot().iter("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(shape)
    path = folder / urdf.name
    tree.write(path)
    return path


if __name__ == "__main__":
    main()
