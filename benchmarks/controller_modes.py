"""Time of a tick by what the robot does: standing, swinging a foot, in flight, many tasks.

    python -m benchmarks.controller_modes [rounds] [--peers]

Median and 99th percentile of processor time over 600 ticks around the stance [us], each tick's
least time of the rounds; the modes of all robots alternate, so that only ratios count. Swing-foot
tasks are switched off by `activation` while their feet stand. With `--peers` TSID does the same,
in a Python of its own that WBC_TSID_PYTHON names; it leaves out the tasks of feet that stand.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import sys
import tempfile
import time

import numpy as np
import pinocchio as pin
from rich.console import Console
from rich.table import Table

from benchmarks.controller import HERE, machine
from benchmarks.controller_scenes import Tick, controller, standing
from benchmarks.peer_scene import write_scene
from benchmarks.peers.process import Peer
from wbc.control import Controller, FrameOrientationTask, FramePoseTask, FramePositionTask
from wbc.effects import load_robot
from wbc.robot import Motion

TICKS = 600


def main():
    given = [word for word in sys.argv[1:] if word != "--peers"]
    rounds, beside = int(given[0]) if given else 3, "--peers" in sys.argv
    console = Console(width=110)
    console.print(machine())
    cases = [case for name in ("solo12", "anymal", "talos") for case in modes(name)]
    times, theirs = np.full((2, len(cases), TICKS), np.inf)
    peers = [start_peer(*case) if beside else None for case in cases]
    for _ in range(rounds):
        for first in range(0, TICKS, 50):
            for case, peer, row, other in zip(cases, peers, times, theirs, strict=True):
                _, ours, states, more = case
                if peer is not None:
                    taken = np.array(peer.run(first, 50))[:, 0]
                    part = slice(first, first + 50)
                    other[part] = np.minimum(other[part], taken)
                ours.step(states[first], **more)
                for tick in range(first, first + 50):
                    start = time.thread_time_ns()
                    command = ours.step(states[tick], **more)
                    row[tick] = min(row[tick], 1e-3 * (time.thread_time_ns() - start))
                    if not command.status.usable:
                        raise RuntimeError(command.message)
    table = Table("robot, mode", "median us", "99 %", "99 %/median", "TSID", "99 %", "ours / TSID")
    for (label, *_), peer, row, other in zip(cases, peers, times, theirs, strict=True):
        high, middle = np.percentile(row, 99), np.median(row)
        cells = [label, f"{middle:.0f}", f"{high:.0f}", f"{high / middle:.2f}"]
        if peer is not None:
            peer.close()
            cells += [f"{np.median(other):.0f}", f"{np.percentile(other, 99):.0f}"]
            cells.append(f"{middle / np.median(other):.2f}")
        table.add_row(*cells)
    console.print(table)


def start_peer(label, ours, states, more):
    """Return TSID on one of the `modes`, None where it has no such tasks."""
    if "seven tasks" in label:
        return None
    robot = ours.robot
    com = np.array([pin.centerOfMass(robot.model, robot.model.createData(), standing(robot))])
    com = np.vstack([com, np.zeros((2, 3))])
    ticks = [Tick(state, {}, com, more.get("contacts")) for state in states]
    off = more.get("activation", {})
    swings = [
        task.frame
        for task in ours.tasks
        if task.name.startswith("swing") and off.get(task.name, 1.0) > 0.0
    ]
    folder = tempfile.mkdtemp()
    return Peer(
        "TSID",
        "WBC_TSID_PYTHON",
        HERE / "peers" / "tsid_controller.py",
        write_scene(robot, ticks, folder, swings),
        "fast",
    )


def modes(name):
    """Return label, controller, states and keywords of `step` for every mode of a robot."""
    robot, generator = load_robot(name), np.random.default_rng(0)
    nv, q = robot.model.nv, standing(robot)
    states = [
        Motion(
            pin.integrate(robot.model, q, 2e-3 * generator.normal(size=nv)),
            5e-3 * generator.normal(size=nv),
        )
        for _ in range(TICKS)
    ]
    plain = controller(robot)
    contacts = [bound.contact for bound in plain._contacts.values()]
    if name == "talos":
        ends = {"left": "leg_left_6_link", "right": "leg_right_6_link"}
        swings = [FramePoseTask(name=f"swing {k}", frame=f, weight=5.0) for k, f in ends.items()]
    else:
        ends = {contact.name: contact.frame for contact in robot.contacts}
        swings = [
            FramePositionTask(name=f"swing {k}", frame=f, weight=5.0) for k, f in ends.items()
        ]
    off = {task.name: 0.0 for task in swings}
    stepping = Controller(robot, [*plain.tasks, *swings], contacts)
    first, *rest = ends
    found = [
        (f"{name}, standing", plain, states, {}),
        (f"{name}, standing, swing tasks off", stepping, states, {"activation": off}),
        (
            f"{name}, one foot swings, weight on the edge",
            Controller(robot, [*plain.tasks, *swings], contacts),
            states,
            {
                "activation": off | {f"swing {first}": 1.0},
                "contacts": dict.fromkeys(rest, np.inf),
            },
        ),
        (
            f"{name}, in flight, all feet swing",
            Controller(robot, [*plain.tasks, *swings], contacts),
            states,
            {"contacts": {}},
        ),
    ]
    if name == "talos":
        hands = [
            FramePoseTask(name=side, frame=f"arm_{side}_7_link", weight=1.0)
            for side in ("left", "right")
        ]
        head = FrameOrientationTask(name="head", frame="head_2_link", weight=1.0)
        pelvis = FrameOrientationTask(name="pelvis", frame="base_link", weight=1.0)
        many = Controller(robot, [*plain.tasks, *hands, head, pelvis], contacts)
        found.append(("talos, seven tasks on two soles", many, states, {}))
    return found


if __name__ == "__main__":
    main()
