"""How the cost of a plant step grows with gears and contacts, MuJoCo on the same robot beside it.

The robot is a body on legs of three lossy gears; every foot has a number of points. Three series:
legs in the air (gears alone), a body without legs on its points (contacts alone), and legs that
stand on two points each (both; their feet rock, so that some of the steps hold several impacts: the
median is a step without, the mean is over all). Run: python -m benchmarks.sim_growth
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

from dataclasses import replace
from time import process_time

import numpy as np
import pinocchio as pin
from rich.console import Console
from rich.table import Table

from benchmarks.controller import machine
from benchmarks.sim_cases import DT, Case, case
from benchmarks.sim_time import best_time, mujoco_run, plant_run
from wbc import Robot
from wbc.robot import ContactPoint
from wbc.sim import Plant
from wbc.transmission import Transmission

LINK, BENT = 0.2, 0.6  # [m], [rad]
AXES = (pin.JointModelRX, pin.JointModelRY, pin.JointModelRY)
STEPS, ROUNDS = 20, 3
TIMES = ("median [us]", "mean [us]", "MuJoCo [us]")


def legged(legs: int, points: int, high: float = 0.0, feet: float = 0.02) -> Case:
    """Return a body on `legs` legs with `points` points per foot (or below a body without legs).

    Args:
        legs: how many, in two rows; each has three gears.
        points: contact points per foot.
        high: height of the feet over the ground [m].
        feet: distance of the points from the middle of a foot [m].
    """
    model, joints, contacts, size = pin.Model(), [], [], max(1, legs)
    base = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
    # As heavy as its legs, so that small and large robots press on every foot alike.
    body = pin.Inertia.FromBox(2.0 * size, 0.2 * size, 0.3, 0.1)
    model.appendBodyToJoint(base, body, pin.SE3.Identity())
    ends = [base] if legs == 0 else []
    for leg in range(legs):
        side = np.array([0.2 * (leg // 2 - (legs - 2) / 4.0), 0.15 * (-1.0) ** leg, 0.0])
        parent, place = base, pin.SE3(np.eye(3), side)
        for number, axis in enumerate(AXES):
            joints.append(f"leg_{leg}_{number}")
            parent = model.addJoint(parent, axis(), place, joints[-1])
            lever = np.array([0.0, 0.0, -0.5 * LINK if number else 0.0])
            link = pin.Inertia.FromBox(0.3, 0.05, 0.05, LINK if number else 0.05)
            link.lever = lever
            model.appendBodyToJoint(parent, link, pin.SE3.Identity())
            down = np.array([0.0, 0.0, -LINK]) if number else np.zeros(3)
            place = pin.SE3(np.eye(3), down)
        ends.append(parent)
    for foot, joint in enumerate(ends):
        model.addBodyFrame(f"foot_{foot}", joint, pin.SE3.Identity(), 0)
        for k in range(points):
            turn = 2.0 * np.pi * k / max(points, 1)
            at = feet * np.array([np.cos(turn), np.sin(turn), 0.0]) - [0.0, 0.0, LINK]
            contacts.append(ContactPoint(f"point_{foot}_{k}", f"foot_{foot}", at))
    return standing(model, joints, contacts, legs, high)


def standing(
    model: pin.Model, joints: list[str], contacts: list[ContactPoint], legs: int, high: float
) -> Case:
    """Return the case of the robot with its legs bent and its feet level, at `high` [m]."""
    one = np.ones(len(joints))
    gears = Transmission(
        tuple(joints),
        9.0 * one,
        2e-5 * one,
        forward_efficiency=0.85 * one,
        torque_limit=3.0 * one,
    )
    robot = Robot("legged", model, gears, tuple(contacts))
    q = robot.neutral()
    q[robot.actuated_position] = np.tile([0.0, BENT, -BENT], legs)
    q[2] = high + (LINK * (1.0 + np.cos(BENT)) if legs else LINK)
    found = case(robot, q, 60.0, STEPS)
    return replace(found, steps=STEPS)


SERIES = {
    "gears, in the air": [(n, 0) for n in (2, 4, 6, 10, 14, 20)],
    "contacts, no gears": [(0, k) for k in (4, 8, 12, 20, 28, 40)],
    "gears and contacts": [(n, 2) for n in (2, 4, 6, 10, 14, 20)],
}


def exponent(sizes: list[int], seconds: list[float]) -> float:
    """Return the slope of the time over the size on logarithmic axes, largest half."""
    half = len(sizes) // 2
    return float(np.polyfit(np.log(sizes[half:]), np.log(seconds[half:]), 1)[0])


def median_step(place: Case) -> float:
    """Return the median CPU time [s] of one step of the plant, each step's least of `ROUNDS`."""
    plant, command = Plant(place.robot), place.command()
    seconds = np.full((ROUNDS, place.steps), np.inf)
    for tries in seconds:
        state = place.start
        for k in range(place.steps):
            began = process_time()
            state = plant.step(state, command(state.position, state.velocity), DT).state
            tries[k] = process_time() - began
    return float(np.median(seconds.min(axis=0)))


def series(name: str, sizes: list[tuple[int, int]]) -> tuple[list[list[str]], list[float]]:
    """Time one series; return its rows and the exponents of plant (median, mean) and MuJoCo."""
    rows, counts, steps, ours, theirs = [], [], [], [], []
    for legs, points in sizes:
        place = legged(
            legs, points, high=50.0 if not points else 0.0, feet=0.2 if not legs else 0.02
        )
        gears, contacts = place.robot.transmission.size, len(place.robot.contacts)
        counts.append(max(gears, contacts) if name != "gears and contacts" else gears)
        steps.append(median_step(place))
        ours.append(best_time(*plant_run(place), rounds=ROUNDS))
        theirs.append(best_time(*mujoco_run(place), rounds=ROUNDS))
        cells = [1e6 * seconds[-1] for seconds in (steps, ours, theirs)]
        cells += [steps[-1] / theirs[-1], DT / steps[-1]]
        rows.append([name, str(gears), str(contacts), *(f"{cell:.3g}" for cell in cells)])
    return rows, [exponent(counts, seconds) for seconds in (steps, ours, theirs)]


def growth() -> dict[str, float]:
    """Print the table; return the plant's exponent of every series, for the median step."""
    table = Table(title=f"cost of a step of {1e3 * DT:g} ms over the size of the robot")
    for head in ("", "gears", "contacts", *TIMES, "ratio", "x real"):
        table.add_column(head, justify="left" if not head else "right")
    found, console = {}, Console(width=120, markup=False)
    for name, sizes in SERIES.items():
        rows, exponents = series(name, sizes)
        found[name] = exponents[0]
        for row in rows:
            table.add_row(*row)
        table.add_row("", "", "exponent", *(f"{e:.2f}" for e in exponents), end_section=True)
    console.print(table)
    print(machine("mujoco"))
    return found


if __name__ == "__main__":
    growth()
