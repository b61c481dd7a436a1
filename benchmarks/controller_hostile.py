"""Ticks on hostile states and inputs: what they cost beside good ones, and what they command.

    python -m benchmarks.controller_hostile [ticks] [robot ...]

Good ticks are slow states around the stance. Hostile ones have joint speeds from 0.3 to 1e8 rad/s,
poses far off, single wild encoders, contacts that come and go, and inputs that make no sense. Times
are of the thread's processor time. Hostile ticks are given as multiples of the median good one; the
worst once as measured and once as the least of four runs of the same ten worst ticks, which takes
out what other programs did to the caches. A line per robot is printed every 2500 ticks. 2000 ticks
per robot by default.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import sys
import time
from collections import Counter

import numpy as np
import pinocchio as pin

from benchmarks.controller import machine
from benchmarks.controller_scenes import controller, standing
from wbc.control import ControllerSettings, Reference
from wbc.effects import load_robot
from wbc.robot import Motion

ROBOTS = ("planar_leg_strong", "solo12", "anymal", "talos")
SPEEDS = (0.3, 1.0, 3.0, 10.0, 50.0, 1e3, 1e8)
GOOD, EVERY = 500, 2500
BROKEN = ("raised", "not finite", "above the torque limit", "above the budget")
# A program that starts just below the budget may write itself down and check its rows once more.
OVERSHOOT = 10 + 2 * 4 * 4


def main():
    ticks = int(sys.argv[1]) if len(sys.argv) > 1 else 2000
    print(machine(), flush=True)
    for name in sys.argv[2:] or ROBOTS:
        run(name, ticks, tell=lambda found, name=name: print(line(name, found), flush=True))


def line(name, found):
    """Return what is known of a robot so far, as one line."""
    base, hostile = np.median(found["good"]), found["hostile"]
    median, most, worst = np.percentile(hostile, (50, 99, 100)) / base
    told = ", ".join(f"{count} {status}" for status, count in found["statuses"].most_common())
    broken = ", ".join(f"{kind} {found['broken'][kind]}" for kind in BROKEN)
    return (
        f"{name}: {len(hostile)} hostile ticks, good median {base:.0f} us; hostile median "
        f"{median:.1f}, 99 % {most:.1f}, worst {worst:.1f}, repeated "
        f"{found['repeated'] / base:.1f} times that; rounds {found['rounds']}, iterations "
        f"{found['iterations']}; {told}; broken promises: {broken}"
    )


def run(name, ticks, seed=0, tell=None):
    """Return times [us], statuses and broken promises of good and hostile ticks of one robot.

    `tell` is called with what is known after every `EVERY` ticks and at the end.
    """
    robot = load_robot(name)
    ours, generator = controller(robot), np.random.default_rng(seed)
    good = [timed(ours, (quiet(robot, generator),))[0] for _ in range(GOOD)][GOOD // 10 :]
    cases = hostile_inputs(robot, ours, generator)
    times, worst = np.zeros(ticks), []
    found = {"good": np.array(good), "statuses": Counter(), "broken": Counter()}
    found |= {"rounds": 0, "iterations": 0}
    for tick in range(ticks):
        arguments = next(cases)
        try:
            times[tick], command = timed(ours, arguments)
        except Exception as cause:  # a promise is broken; go on and count
            found["broken"]["raised"] += 1
            print(f"{name}: tick {tick} raised {cause!r}", flush=True)
            continue
        found["statuses"][command.status.value] += 1
        found["broken"].update(violations(robot, command))
        for count in ("rounds", "iterations"):
            found[count] = max(found[count], getattr(command, count))
        worst = sorted([*worst, (times[tick], tick, arguments)], key=lambda case: -case[0])[:10]
        if (tick + 1) % EVERY == 0 or tick + 1 == ticks:
            found["hostile"] = times[: tick + 1]
            found["repeated"] = max(
                min(case[0], *(timed(ours, case[2])[0] for _ in range(3))) for case in worst
            )
            if tell is not None:
                tell(found)
    return found


def timed(ours, arguments):
    """Return the processor time [us] of a tick and its command."""
    start = time.thread_time_ns()
    command = ours.step(*arguments)
    return 1e-3 * (time.thread_time_ns() - start), command


def kept(robot, command):
    """Whether a command is finite and within the motors' limits and the budget."""
    return not violations(robot, command)


def violations(robot, command):
    """Return which of `BROKEN` a command is guilty of."""
    torque, limit = command.rotor_torque, robot.transmission.torque_limit
    settings, found = ControllerSettings(), []
    if not np.isfinite(torque).all():
        found.append("not finite")
    if (np.abs(torque) > limit * (1.0 + 1e-9)).any():
        found.append("above the torque limit")
    if command.iterations > settings.max_iterations + OVERSHOOT:
        found.append("above the budget")
    if command.rounds > settings.max_rounds:
        found.append("above the budget")
    return found


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
