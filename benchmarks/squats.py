"""Robots of example-robot-data squat in MuJoCo: what knowing the losses of the gears is worth.

    python -m benchmarks.squats [robot ...]

Each robot stands on its feet and squats once a second by a tenth of the height of its centre of
mass, for two seconds, once with a controller that knows the losses of the gears and once with one
that takes them for ideal. Models come from the package `example-robot-data`. They say nothing of
gears: all have the same assumed ones. The error is that of the centre of mass (rms).
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import sys
import tempfile
from itertools import product
from pathlib import Path

import numpy as np

from benchmarks.controller import machine
from sims.closed_loop import ERROR, run
from sims.legged import CenterOfMass, squat
from sims.mujoco_plant import MujocoPlant
from wbc.dynamics import evaluate
from wbc.effects import load_robot
from wbc.robot import Motion

CORNERS = ("FL", "FR", "RL", "RR")
SOLE = [[0.12, 0.03, -0.03], [0.12, -0.03, -0.03], [-0.05, 0.025, -0.03], [-0.05, -0.025, -0.03]]
UNITREE = {"thigh": 0.8, "calf": -1.6}
HYQ = {"f_hfe": 0.75, "f_kfe": -1.5, "h_hfe": -0.75, "h_kfe": 1.5}
G1 = {"hip_pitch": -0.3, "knee": 0.6, "ankle_pitch": -0.3}
# model, links of the feet, points on each in its axes [m], angles [rad] by part of a joint's name
ROBOTS = {
    "a1": ("a1_description/urdf/a1", [f"{c}_foot" for c in CORNERS], [[0, 0, 0]], UNITREE),
    "b1": ("b1_description/urdf/b1", [f"{c}_foot" for c in CORNERS], [[0, 0, 0]], UNITREE),
    "hyq": (
        "hyq_description/robots/hyq_no_sensors",
        [f"{c}_foot" for c in ("lf", "rf", "lh", "rh")],
        [[0, 0, 0]],
        HYQ,
    ),
    "go2": ("go2_description/urdf/go2", [f"{c}_foot" for c in CORNERS], [[0, 0, 0]], UNITREE),
    "g1": (
        "g1_description/urdf/g1_29dof_rev_1_0",
        [f"{side}_ankle_roll_link" for side in ("left", "right")],
        SOLE,
        G1,
    ),
}
GEARS = """
[gears."*"]
gear_ratio = { value = 10.0, unit = "1", source = "assumed" }
rotor_inertia = { value = 1e-4, unit = "kg m^2", source = "assumed" }
forward_efficiency = { value = 0.8, unit = "1", source = "assumed" }
backward_efficiency = { value = 0.75, unit = "1", source = "assumed: 2 - 1/eta_f" }
torque_limit = { value = 30.0, unit = "N m", source = "assumed" }
"""
CONTACT = """
[[contacts]]
name = "{link} {number}"
frame = "{link}"
offset = {{ value = {point}, unit = "m", source = "its collision geometry" }}
friction = {{ value = 0.7, unit = "1", source = "assumed" }}
"""


def main():
    print(machine("mujoco"))
    for name in sys.argv[1:] or ROBOTS:
        robot, q = standing(name)
        depth = 0.1 * float(CenterOfMass(robot)(Motion(q, np.zeros(robot.model.nv)))[2])
        found = [
            run(MujocoPlant(robot, q), robot, model, squat(depth, 1.0), 2.0)
            for model in (robot, robot.lossless())
        ]
        knows, ignores = (figures[ERROR] for figures in found)
        refused = sum(figures["refused ticks"] for figures in found)
        print(
            f"{name}: {1e3 * depth:.0f} mm deep; knowing the losses {knows:.2f} mm off, not "
            f"knowing them {ignores:.1f} mm; {refused} ticks without a solution",
            flush=True,
        )


def standing(name):
    """Return a robot with the assumed gears, and its q (nq,) with the feet on the ground."""
    model, links, points, angles = ROBOTS[name]
    text = f'name = "{name}"\nmodel = "example_robot_data:robots/{model}.urdf"\n'
    text += f'base = "free_flyer"\n{GEARS}'
    for link, (number, point) in product(links, enumerate(points)):
        text += CONTACT.format(link=link, number=number, point=[float(x) for x in point])
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "robot.toml"
        file.write_text(text, encoding="utf-8")
        robot = load_robot(file)
    bent = {
        joint: angle
        for joint in robot.transmission.joints
        for part, angle in angles.items()
        if part in joint
    }
    q = robot.configuration(**bent)
    q[2] -= evaluate(robot, q, np.zeros(robot.model.nv)).contact_position[:, 2].min()
    return robot, q


if __name__ == "__main__":
    main()
