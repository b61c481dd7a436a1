"""Time of a tick by what the robot does: standing, swinging a foot, in flight, many tasks.

    python -m benchmarks.controller_modes [rounds]

Median and 99th percentile of processor time over 600 ticks around the stance [us], each tick's
least time of the rounds; the modes of all robots alternate, so that only ratios count. Swing-foot
tasks are switched off by `activation` while their feet stand.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import sys
import time

import numpy as np
import pinocchio as pin
from rich.console import Console
from rich.table import Table

from benchmarks.controller import machine
from benchmarks.controller_scenes import controller, standing
from wbc.control import Controller, FrameOrientationTask, FramePoseTask, FramePositionTask
from wbc.effects import load_robot
from wbc.robot import Motion

TICKS = 600


def main():
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 3
    console = Console(width=110)
    console.print(machine())
    cases = [case for name in ("solo12", "anymal", "talos") for case in modes(name)]
    times = np.full((len(cases), TICKS), np.inf)
    for _ in range(rounds):
        for first in range(0, TICKS, 50):
            for row, (_, ours, states, more) in zip(times, cases, strict=True):
                ours.step(states[first], **more)
                for tick in range(first, first + 50):
                    start = time.thread_time_ns()
                    command = ours.step(states[tick], **more)
                    row[tick] = min(row[tick], 1e-3 * (time.thread_time_ns() - start))
                    if not command.status.usable:
                        raise RuntimeError(command.message)
    table = Table("robot, mode", "median us", "99 %", "99 %/median")
    for (label, *_), row in zip(cases, times, strict=True):
        high, middle = np.percentile(row, 99), np.median(row)
        table.add_row(label, f"{middle:.0f}", f"{high:.0f}", f"{high / middle:.2f}")
    console.print(table)


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
