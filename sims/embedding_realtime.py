"""A loop at 1 kHz that watches its deadline.

Every tick has a budget. The controller says itself when it has used it up (`Status.LATE`, the
torque is still that of the program); the loop watches what it cannot see: whether the whole cycle
kept its period. A tick that comes too late is not made up for, and after some of them in a row the
loop hands over to the drives' own damping and says so.
"""

from __future__ import annotations

import gc
import time
from collections import Counter
from collections.abc import Callable

import numpy as np

from sims.legged import controller
from wbc import Robot, load_robot
from wbc.control import Command, Status
from wbc.robot import Motion

PERIOD = 1e-3  # [s]
BUDGET = 0.6 * PERIOD  # [s] for the controller; the rest is for buses and drives
PATIENCE = 10  # missed periods in a row before the drives are left to damp by themselves


class DeadlineMonitor:
    """Counts missed periods; the clock and the sleep are given, so that it can be tested."""

    def __init__(self, clock: Callable[[], float], sleep: Callable[[float], None]) -> None:
        """Start the first period now."""
        self._clock, self._sleep = clock, sleep
        self._next = clock() + PERIOD
        self.missed = self.in_a_row = 0

    def wait(self) -> None:
        """Sleep until the period ends; where it has ended already, start a new one from now."""
        left = self._next - self._clock()
        if left > 0.0:
            self.in_a_row = 0
            self._sleep(left)
            self._next += PERIOD
        else:
            self.missed += 1
            self.in_a_row += 1
            self._next = self._clock() + PERIOD


def main(
    duration: float = 1.0,
    budget: float = BUDGET,
    clock: Callable[[], float] = time.perf_counter,
    sleep: Callable[[float], None] = time.sleep,
) -> dict[str, float]:
    """Stand for `duration` seconds; return what became of the ticks."""
    robot = load_robot("solo12")
    control = controller(robot, robot, deadline=budget)
    state = Motion(np.array(robot.poses["standing"]), np.zeros(robot.model.nv))
    control.step(state)  # the first tick makes the program; do it before the clock runs
    gc.freeze()
    gc.disable()  # a full collection takes tens of milliseconds; a tick leaves nothing for it
    monitor, statuses, handed_over = DeadlineMonitor(clock, sleep), Counter[Status](), 0
    try:
        for _ in range(round(duration / PERIOD)):
            command = control.step(state)
            statuses[command.status] += 1
            if monitor.in_a_row >= PATIENCE:
                handed_over += 1
            else:
                send(robot, command)
            monitor.wait()
    finally:
        gc.enable()
        gc.unfreeze()
    return {
        "ticks": sum(statuses.values()),
        "late by the controller's own clock": statuses[Status.LATE],
        "periods missed": monitor.missed,
        "ticks left to the drives": handed_over,
        "unusable": sum(n for status, n in statuses.items() if not status.usable),
    }


def send(robot: Robot, command: Command) -> None:
    """Put your drives' interface here; late torques are good, torques of refused ticks safe."""
    if not np.all(np.abs(command.rotor_torque) <= robot.transmission.torque_limit * (1 + 1e-9)):
        raise RuntimeError("a command is beyond the limits of the motors.")


if __name__ == "__main__":
    for name, figure in main().items():
        print(f"{name}: {figure:g}")
