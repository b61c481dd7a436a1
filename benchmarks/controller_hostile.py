"""Ticks on hostile states and inputs: what they cost beside good ones, and what they command.

    python -m benchmarks.controller_hostile [ticks] [robot ...] [--quick]

Good ticks are slow states around the stance. Hostile ones have joint speeds from 0.3 to 1e8 rad/s,
poses far off, single wild encoders, contacts that come and go, and inputs that make no sense. Times
are of the thread's processor time. Every part is run three times from a reset controller, and up to
twelve times while its worst tick reads above twenty good ones. Each tick counts with the least of
its times: what other programs did to the caches differs from run to run, what the tick itself costs
does not. Hostile ticks are given as multiples of the median good one; "worst once" is the greatest
single time. Ticks of all runs must have the same commands. With `--quick` every part is run twice,
to count broken promises; its times say little. Python's garbage collector is off, as a loop should
have it (a tick leaves nothing for it). The ticks come in parts of 2500, each with a seed of its
own, and a line is printed after each. 2000 ticks per robot by default.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import gc
import sys
import time
from collections import Counter
from itertools import islice

import numpy as np
import pinocchio as pin

from benchmarks.controller import machine
from benchmarks.controller_scenes import controller, standing
from wbc.control import Reference
from wbc.effects import load_robot
from wbc.robot import Motion

ROBOTS = ("planar_leg_strong", "solo12", "anymal", "talos")
SPEEDS = (0.3, 1.0, 3.0, 10.0, 50.0, 1e3, 1e8)
GOOD, EVERY, RUNS = 500, 2500, 3
ASKED, MOST_RUNS, QUICK = 20.0, 12, (2, 2)
BROKEN = ("raised", "not finite", "above the torque limit", "above the budget", "not repeated")


def main():
    ticks = int(sys.argv[1]) if len(sys.argv) > 1 else 2000
    rest, runs = sys.argv[2:], (RUNS, MOST_RUNS)
    if "--quick" in rest:
        rest.remove("--quick")
        runs = QUICK
    print(machine(), flush=True)
    gc.freeze()
    gc.disable()
    for name in rest or ROBOTS:
        parts = []
        for seed, start in enumerate(range(0, ticks, EVERY)):
            parts.append(run(name, min(EVERY, ticks - start), seed, runs))
            print(line(name, parts), flush=True)


def line(name, parts):
    """Return what is known of a robot so far, as one line."""
    statuses = sum((Counter(part["statuses"]) for part in parts), Counter())
    told = ", ".join(f"{count} {status}" for status, count in statuses.most_common())
    broken = ", ".join(f"{kind} {sum(part['broken'][kind] for part in parts)}" for kind in BROKEN)
    good = np.median([part["good"] for part in parts])
    median = np.median([part["median"] for part in parts])
    most, once, worst = (max(part[key] for part in parts) for key in ("most", "worst", "repeated"))
    return (
        f"{name}: {sum(part['ticks'] for part in parts)} hostile ticks, good median {good:.0f} us; "
        f"hostile median {median:.1f}, 99 % {most:.1f}, worst {worst:.1f}, worst once {once:.1f} "
        f"times that; rounds {max(part['rounds'] for part in parts)}, iterations "
        f"{max(part['iterations'] for part in parts)}; {told}; broken promises: {broken}"
    )


def run(name, ticks, seed=0, runs=(RUNS, MOST_RUNS)):
    """Return times, statuses and broken promises of good and hostile ticks of one robot.

    Times of hostile ticks are multiples of the median good one [us] of the same part.
    """
    robot = load_robot(name)
    ours, generator = controller(robot), np.random.default_rng(seed)
    slow = [(quiet(robot, generator),) for _ in range(GOOD)]
    cases = list(islice(hostile_inputs(robot, ours, generator), ticks))
    most_units = budget(ours)
    broken, kept, statuses, most = Counter(dict.fromkeys(BROKEN, 0)), [], Counter(), Counter()
    good, times, number = [], [], 0
    while number < runs[0] or (number < runs[1] and ratios(good, times).max() > ASKED):
        ours.reset()
        good.append([timed(ours, arguments)[0] for arguments in slow])
        ours.reset()
        ours.step(*slow[0])  # the first one takes what tasks without a reference hold
        times.append([0.0] * ticks)
        for tick, arguments in enumerate(cases):
            try:
                times[number][tick], command = timed(ours, arguments)
            except Exception as cause:  # a promise is broken; go on and count
                broken["raised"] += 1
                print(f"{name}: seed {seed}, tick {tick} raised {cause!r}", flush=True)
                continue
            if number == 0:
                statuses[command.status.value] += 1
                broken.update(violations(robot, command, most_units))
                for count in ("rounds", "iterations"):
                    most[count] = max(most[count], int(getattr(command, count)))
                kept.append(command.rotor_torque)
            elif not np.array_equal(kept[tick], command.rotor_torque):
                broken["not repeated"] += 1
        number += 1
    base = middle(good)
    median, high, worst = np.percentile(ratios(good, times), (50, 99, 100)).tolist()
    return {
        "ticks": ticks,
        "good": base,
        "median": median,
        "most": high,
        "runs": number,
        "worst": float(np.max(times) / base),
        "repeated": worst,
        "statuses": dict(statuses),
        "broken": dict(broken),
        "rounds": most["rounds"],
        "iterations": most["iterations"],
    }


def middle(good):
    """Return the median [us] of good ticks, each with the least of its times in some runs."""
    return float(np.median(np.min(good, axis=0)[GOOD // 10 :]))


def ratios(good, times):
    """Return the least time of every hostile tick as a multiple of the median good one."""
    return np.min(times, axis=0) / middle(good)


def timed(ours, arguments):
    """Return the processor time [us] of a tick and its command."""
    start = time.thread_time_ns()
    command = ours.step(*arguments)
    return 1e-3 * (time.thread_time_ns() - start), command


def budget(ours):
    """Return the greatest number of iterations that a tick of a controller may report."""
    return ours.settings.max_iterations + 1  # one more when it is spent


def violations(robot, command, most_units):
    """Return which of `BROKEN` a command is guilty of; `most_units` is the tick's `budget`."""
    torque, limit = command.rotor_torque, robot.transmission.torque_limit
    found = []
    if not np.isfinite(torque).all():
        found.append("not finite")
    if (np.abs(torque) > limit * (1.0 + 1e-9)).any():
        found.append("above the torque limit")
    if command.iterations > most_units:
        found.append("above the budget")
    return found


def quiet(robot, generator):
    """Return a slow state near the stance."""
    nv = robot.model.nv
    q = pin.integrate(robot.model, standing(robot), 1e-3 * generator.normal(size=nv))
    return Motion(q, 1e-3 * generator.normal(size=nv))


def hostile_inputs(robot, ours, generator):
    """Yield arguments of `step`, most of them states that a robot should never be in."""
    names = list(ours._parts.contacts)
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
