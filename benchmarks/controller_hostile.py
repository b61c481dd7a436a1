"""Ticks on hostile states and inputs: what they cost beside good ones, and what they command.

    python -m benchmarks.controller_hostile [ticks] [robot ...]

Good ticks are slow states around the stance. Hostile ones have joint speeds from 0.3 to 1e8 rad/s,
poses far off, single wild encoders, contacts that come and go, and inputs that make no sense. Times
are of the thread's processor time. The worst hostile tick is given as a multiple of the median good
one, once as measured and once as the least of three runs of the same ten worst ticks, which takes
out what other programs did to the caches. 2000 ticks per robot by default.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import sys
import time
from collections import Counter

import numpy as np
import pinocchio as pin
from rich.console import Console
from rich.table import Table

from benchmarks.controller import machine
from benchmarks.controller_scenes import controller, standing
from wbc.control import Reference
from wbc.effects import load_robot
from wbc.robot import Motion

ROBOTS = ("planar_leg_strong", "solo12", "anymal", "talos")
SPEEDS = (0.3, 1.0, 3.0, 10.0, 50.0, 1e3, 1e8)
GOOD = 500


def main():
    ticks = int(sys.argv[1]) if len(sys.argv) > 1 else 2000
    console = Console(width=110)
    console.print(machine())
    columns = "robot", "good median us", "hostile median", "99 %", "worst", "ratio", "repeated"
    table = Table(*columns)
    statuses = Table("robot", "statuses", "most programs", "broken promises")
    for name in sys.argv[2:] or ROBOTS:
        found = run(name, ticks)
        base = np.median(found["good"])
        hostile = found["hostile"]
        table.add_row(
            name,
            f"{base:.0f}",
            *(f"{np.percentile(hostile, share):.0f}" for share in (50, 99, 100)),
            f"{hostile.max() / base:.1f}",
            f"{found['repeated'] / base:.1f}",
        )
        told = ", ".join(f"{count} {status}" for status, count in found["statuses"].most_common())
        statuses.add_row(name, told, str(found["rounds"]), str(found["broken"]))
    console.print(table)
    console.print(statuses)


def run(name, ticks, seed=0):
    """Return times [us] and statuses of good and hostile ticks of one robot."""
    robot = load_robot(name)
    ours, generator = controller(robot), np.random.default_rng(seed)
    good = [timed(ours, (quiet(robot, generator),))[0] for _ in range(GOOD)][GOOD // 10 :]
    cases = hostile_inputs(robot, ours, generator)
    times, statuses, rounds, broken, worst = np.zeros(ticks), Counter(), 0, 0, []
    for tick in range(ticks):
        arguments = next(cases)
        times[tick], command = timed(ours, arguments)
        statuses[command.status.value] += 1
        rounds = max(rounds, command.rounds)
        broken += not kept(robot, command)
        worst = sorted([*worst, (times[tick], tick, arguments)], key=lambda case: -case[0])[:10]
    repeated = max(min(timed(ours, case[2])[0] for _ in range(3)) for case in worst)
    return {
        "good": np.array(good),
        "hostile": times,
        "repeated": repeated,
        "statuses": statuses,
        "rounds": rounds,
        "broken": broken,
    }


def timed(ours, arguments):
    """Return the processor time [us] of a tick and its command."""
    start = time.thread_time_ns()
    command = ours.step(*arguments)
    return 1e-3 * (time.thread_time_ns() - start), command


def kept(robot, command):
    """Whether a command is finite and within the motors' limits."""
    torque, limit = command.rotor_torque, robot.transmission.torque_limit
    return bool(np.isfinite(torque).all() and (np.abs(torque) <= limit * (1.0 + 1e-9)).all())


def quiet(robot, generator):
    """Return a slow state near the stance."""
    nv = robot.model.nv
    q = pin.integrate(robot.model, standing(robot), 1e-3 * generator.normal(size=nv))
    return Motion(q, 1e-3 * generator.normal(size=nv))


def hostile_inputs(robot, ours, generator):
    """Yield arguments of `step`, most of them states that a robot should never be in."""
    names = [contact.name for contact in ours._contacts.values()]
    nv = robot.model.nv
    while True:
        spread = generator.choice([0.01, 0.1, 0.3, 1.0, 3.0])
        q = pin.integrate(robot.model, standing(robot), spread * generator.normal(size=nv))
        v = 0.1 * generator.normal(size=nv)
        speed = generator.choice(SPEEDS)
        if generator.random() < 0.5:
            v[generator.integers(nv)] = speed * generator.normal()
        else:
            v = speed * generator.normal(size=nv)
        contacts = None
        if generator.random() < 0.5:
            contacts = {name: float(generator.choice([0.0, 1.0, 50.0, np.inf])) for name in names}
        references = {}
        if generator.random() < 0.3:
            wild = 10.0 ** generator.uniform(-2, 6) * generator.normal(size=3)
            rows = 3 if robot.has_free_flyer else 1
            references = {"center_of_mass": Reference(wild[:rows])}
        if generator.random() < 0.1:
            yield nonsense(q, v, generator)
        else:
            yield Motion(q, v), references, contacts


def nonsense(q, v, generator):
    """Return arguments of `step` that are none."""
    q, v = q.copy(), v.copy()
    choice = generator.integers(8)
    if choice == 0:
        q[generator.integers(len(q))] = generator.choice([np.nan, np.inf, 1e300])
    elif choice == 1:
        v[generator.integers(len(v))] = generator.choice([np.nan, -np.inf, 1e200])
    cases = {
        2: (Motion(q[1:], v),),
        3: (None,),
        4: (Motion(q, v), {"center_of_mass": Reference(np.full(7, 1.0))}),
        5: (Motion(q, v), {"center_of_mass": Reference(np.array([np.nan, 0.0, 0.0]))}),
        6: (Motion(q, v), [1, 2], "feet"),
        7: (Motion(q, v), None, {"posture": None}),
    }
    return cases.get(int(choice), (Motion(q, v),))


if __name__ == "__main__":
    main()
