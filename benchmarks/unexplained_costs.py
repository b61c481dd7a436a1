"""What a diagnosis costs where something is left that no effect explains.

    python -m benchmarks.unexplained_costs [--only CASE ...] [--budget SECONDS] [--json FILE]

The machines carry viscous and Coulomb friction in every joint, and friction that remembers how far
it slid since it turned round (Dahl). `arm` has two logs of 20 s at 200 Hz of a six-axis arm,
`plain` the same without memory, `quadruped` one log of 24 s at 200 Hz of twelve joints on its feet,
`long` three logs of 50 s at 100 Hz of the arm, `seven` the same of a seven-axis arm, `eight` of
that arm on its lift.
Times are those of the process.
"""

from __future__ import annotations

import argparse
import multiprocessing
import resource
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from math import inf
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
from rich.console import Console
from rich.table import Table

from benchmarks.recorded import ROBOTS
from benchmarks.results import finish
from wbc import load_robot
from wbc.arrays import FloatArray
from wbc.dynamics.batch import link_torque, rotor_torque
from wbc.effects import CoulombFriction, ViscousFriction
from wbc.identification import diagnose
from wbc.measurement import Log
from wbc.robot import Effect, Motion, Robot
from wbc.robot.coordinates import slides

DRY, VISCOUS = 0.10, 0.05  # shares of the torque (rms) that a joint's motion needs
MEMORY = 0.15  # ... of friction that remembers
RATE = 12.0  # [1/rad] at which it forgets its old direction
NOISE = 0.003  # share of the torque (rms)
POSITION_NOISE, VELOCITY_NOISE = 1e-5, 1e-3  # [rad], [rad/s]


def main() -> None:
    """Measure each case in a process of its own, print, write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", choices=CASES, default=list(CASES))
    parser.add_argument("--budget", type=float, default=inf, help="of each diagnosis [s]")
    parser.add_argument("--trace", action="store_true", help="print what the search tries")
    parser.add_argument("--json", metavar="FILE")
    options = parser.parse_args()
    results = {}
    fresh = multiprocessing.get_context("spawn")
    for name in options.only:
        with fresh.Pool(1) as pool:
            results[name] = pool.apply(measure, (name, options.budget, options.trace))
    table = Table("case", "CPU s", "peak MB", "verdict", "floors", "certain", "named", box=None)
    for name, row in results.items():
        table.add_row(name, *(str(value) for value in row.values()))
    console = Console()
    console.print(table)
    finish(console, results, options.json)


def measure(name: str, budget: float, trace: bool = False) -> dict[str, Any]:
    """Return what the diagnosis of a case costs and says."""
    robot, logs = CASES[name]()
    start = time.process_time()

    def progress(line: str) -> None:
        if trace:
            print(f"{time.process_time() - start:6.1f}  {line}", flush=True)

    found = diagnose(robot, logs, progress=progress, budget=budget)
    seconds = time.process_time() - start
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    sure = [f for f in found.findings if f.probability >= 0.95]
    return {
        "CPU s": round(seconds, 1),
        "peak MB": round(peak),
        "verdict": found.verdict,
        "floors": f"{found.error.before:.1f} -> {found.error.after:.1f}",
        "certain": _counted(f.effect for f in sure),
        "named": _counted(f.effect for f in found.findings),
    }


def _counted(effects: Any) -> str:
    names = Counter(effect.name for effect in effects)
    return ", ".join(f"{count} {name}" for name, count in names.items())


def arm(
    robot: Robot, duration: float, rate: float, runs: int, memory: float
) -> tuple[Robot, list[Log]]:
    """Return an arm without friction, and logs of it with friction."""
    robot = robot.without_effects().lossless()
    size = np.where([slides(robot, joint) for joint in robot.transmission.joints], 0.15, 1.2)
    motions = [_swept(robot, seed, duration, rate, size) for seed in range(runs)]
    zeros = [np.zeros_like(motion.velocity) for motion in motions]
    return robot, _logs(robot, motions, [{}] * runs, zeros, rate, memory)


def _fixed(folder: Path, joint: str) -> Robot:
    """Return a robot of the repository with one joint that cannot move."""
    model = next(folder.glob("*.urdf"))
    tree = ElementTree.parse(model)
    for found in tree.iter("joint"):
        if found.get("name") == joint:
            found.set("type", "fixed")
    sections = (folder / "robot.toml").read_text().split("\n[")
    kept = [section for section in sections if not section.startswith(f"gears.{joint}]")]
    with tempfile.TemporaryDirectory() as place:
        tree.write(Path(place) / model.name)
        (Path(place) / "robot.toml").write_text("\n[".join(kept))
        return load_robot(Path(place) / "robot.toml")


def quadruped(duration: float, rate: float, memory: float) -> tuple[Robot, list[Log]]:
    """Return the quadruped without friction, and a log of it swaying above its four feet."""
    robot = load_robot("solo12").without_effects().lossless()
    motion = _swaying(robot, _swept(robot, 0, duration, rate, 0.4), rate)
    forces, push = _feet(robot, motion)
    return robot, _logs(robot, [motion], [forces], [push], rate, memory)


CASES: dict[str, Callable[[], tuple[Robot, list[Log]]]] = {
    "plain": lambda: arm(load_robot("staubli_tx40"), 20.0, 200.0, 2, 0.0),
    "arm": lambda: arm(load_robot("staubli_tx40"), 20.0, 200.0, 2, MEMORY),
    "quadruped": lambda: quadruped(24.0, 200.0, MEMORY),
    "long": lambda: arm(load_robot("staubli_tx40"), 50.0, 100.0, 3, MEMORY),
    "seven": lambda: arm(_fixed(ROBOTS / "tiago", "torso_lift_joint"), 50.0, 100.0, 3, MEMORY),
    "eight": lambda: arm(load_robot("tiago"), 50.0, 100.0, 3, MEMORY),
}


def _swept(
    robot: Robot, seed: int, duration: float, rate: float, size: float | FloatArray
) -> Motion:
    """Return a motion in which every actuated joint follows a multi-sine of this size [rad, m]."""
    random = np.random.default_rng(seed)
    count = robot.transmission.size
    omega = 2.0 * np.pi * random.uniform(0.15, 1.5, (count, 4))
    amplitude = random.uniform(0.5, 1.0, (count, 4)) / np.sqrt(omega)
    amplitude *= np.reshape(size, (-1, 1)) / amplitude.sum(axis=1, keepdims=True)
    steps = np.arange(int(duration * rate)) / rate
    angle = steps[:, None, None] * omega + random.uniform(0.0, 2.0 * np.pi, (count, 4))
    center = robot.pose() if robot.poses else pin.neutral(robot.model) + 0.3
    q = np.tile(center, (len(steps), 1))
    v, a = np.zeros((2, len(steps), robot.model.nv))
    q[:, robot.actuated_position] += (amplitude * np.sin(angle)).sum(axis=2)
    v[:, robot.actuated] = (amplitude * omega * np.cos(angle)).sum(axis=2)
    a[:, robot.actuated] = -(amplitude * omega**2 * np.sin(angle)).sum(axis=2)
    return Motion(position=q, velocity=v, acceleration=a)


def _swaying(robot: Robot, motion: Motion, rate: float) -> Motion:
    """Return the motion with a base that sways and leans by a multi-sine."""
    random = np.random.default_rng(1)
    steps = np.arange(len(motion.position)) / rate
    v, a = np.array(motion.velocity), np.array(motion.acceleration)
    for row in range(6):
        omega = 2.0 * np.pi * random.uniform(0.2, 1.2, 3)
        phase = random.uniform(0.0, 2.0 * np.pi, 3)
        angle = np.outer(steps, omega) + phase
        v[:, row] = 0.05 * np.cos(angle).sum(axis=1)
        a[:, row] = -0.05 * (omega * np.sin(angle)).sum(axis=1)
    q = np.array(motion.position)
    for k in range(1, len(q)):
        half = 0.5 * (v[k - 1, :6] + v[k, :6]) / rate
        q[k, :7] = pin.integrate(robot.model, q[k - 1], np.r_[half, np.zeros(robot.model.nv - 6)])[
            :7
        ]
    return Motion(position=q, velocity=v, acceleration=a)


def _feet(robot: Robot, motion: Motion) -> tuple[dict[str, FloatArray], FloatArray]:
    """Return the least forces of the feet that carry the base, and J' f (N, nv)."""
    needed = link_torque(robot, motion)
    model, data = robot.model, robot.model.createData()
    frames = [model.getFrameId(contact.frame) for contact in robot.contacts]
    world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    forces, pushes = np.zeros((len(needed), len(frames), 3)), np.zeros_like(needed)
    for k, q in enumerate(motion.position):
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        jacobian = np.concatenate(
            [pin.getFrameJacobian(model, data, frame, world)[:3] for frame in frames]
        )
        force = np.linalg.lstsq(jacobian[:, :6].T, needed[k, :6], rcond=None)[0]
        forces[k], pushes[k] = force.reshape(-1, 3), jacobian.T @ force
    names = [contact.name for contact in robot.contacts]
    return {name: forces[:, k] for k, name in enumerate(names)}, pushes


def _logs(
    robot: Robot,
    motions: Sequence[Motion],
    forces: Sequence[dict[str, FloatArray]],
    pushes: Sequence[FloatArray],
    rate: float,
    memory: float,
) -> list[Log]:
    """Return what sensors report of motions with friction in every driven joint."""
    loads = [link_torque(robot, m) - push for m, push in zip(motions, pushes, strict=True)]
    size = np.sqrt(np.mean(np.concatenate(loads)[:, robot.actuated] ** 2, axis=0))
    speed = np.sqrt(
        np.mean(np.concatenate([m.velocity for m in motions])[:, robot.actuated] ** 2, axis=0)
    )
    hidden: list[Effect] = []
    for joint, torque, fast in zip(robot.transmission.joints, size, speed, strict=True):
        hidden.append(ViscousFriction(joint, VISCOUS * torque / fast))
        hidden.append(CoulombFriction(joint, DRY * torque))
    true = robot.with_effects(*hidden)
    result = []
    for number, (motion, load, force) in enumerate(zip(motions, loads, forces, strict=True)):
        remembered = np.zeros_like(load)
        remembered[:, robot.actuated] = memory * size * _dahl(motion, robot, rate)
        reported, _ = rotor_torque(true, motion, load + remembered)
        result.append(_recorded(robot, motion, reported, force, rate, number))
    return result


def _dahl(motion: Motion, robot: Robot, rate: float) -> FloatArray:
    """Return (N, m) the state of Dahl friction, -1 to 1, exact over steps of constant speed."""
    speed = motion.velocity[:, robot.actuated]
    state = np.zeros_like(speed)
    for k in range(1, len(speed)):
        mean = 0.5 * (speed[k - 1] + speed[k])
        target = np.sign(mean)
        kept = np.exp(-RATE * np.abs(mean) / rate)
        state[k] = target + (state[k - 1] - target) * kept
    return state


def _recorded(
    robot: Robot,
    motion: Motion,
    torque: FloatArray,
    forces: dict[str, FloatArray],
    rate: float,
    seed: int,
) -> Log:
    random = np.random.default_rng(100 + seed)
    columns: dict[str, FloatArray] = {}
    steps = np.arange(len(torque)) / rate
    size = np.sqrt(np.mean(torque**2, axis=0))
    for k, joint in enumerate(robot.transmission.joints):
        place, row = robot.actuated_position[k], robot.actuated[k]
        noise = random.normal(size=(3, len(steps)))
        columns[f"{joint}.position"] = motion.position[:, place] + POSITION_NOISE * noise[0]
        columns[f"{joint}.velocity"] = motion.velocity[:, row] + VELOCITY_NOISE * noise[1]
        columns[f"{joint}.rotor_torque"] = torque[:, k] + NOISE * size[k] * noise[2]
    for name, force in forces.items():
        for axis, values in zip("xyz", force.T, strict=True):
            columns[f"{name}.force.{axis}"] = values + 0.02 * random.normal(size=len(steps))
    if forces:
        names = [f"position.{x}" for x in "xyz"] + [f"orientation.{x}" for x in "xyzw"]
        for name, values in zip(names, motion.position[:, :7].T, strict=True):
            columns[f"base.{name}"] = values
        names = [f"{kind}_velocity.{x}" for kind in ("linear", "angular") for x in "xyz"]
        for name, values in zip(names, motion.velocity[:, :6].T, strict=True):
            columns[f"base.{name}"] = values + 1e-3 * random.normal(size=len(steps))
    return Log(time=steps, columns=columns)


if __name__ == "__main__":
    main()
