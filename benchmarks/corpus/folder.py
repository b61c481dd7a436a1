"""Write a machine as a robot folder (MJCF and robot.toml)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks.corpus.machine import Machine
from benchmarks.corpus.rigid import mjcf


def write_folder(machine: Machine, folder: Path) -> Path:
    """Write the files into `folder` and return the path that `load_robot` takes."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "robot.xml").write_text(mjcf(machine))
    (folder / "robot.toml").write_text(_toml(machine))
    return folder / "robot.toml"


def _toml(machine: Machine) -> str:
    def entry(value: object, unit: str) -> str:
        return f'{{ value = {value}, unit = "{unit}", source = "generated" }}'

    lines = [
        'name = "generated"',
        'model = "robot.xml"',
        f'base = "{"free_flyer" if machine.floating else "fixed"}"',
    ]
    for k, joint in enumerate(machine.driven):
        ratio, inertia = float(machine.ratio[k]), float(machine.reflected[k])
        lines += [
            f"[gears.{joint}]",
            f"gear_ratio = {entry(ratio, '1')}",
            f"rotor_inertia = {entry(inertia / ratio**2, 'kg m^2')}",
            f"forward_efficiency = {entry(1.0, '1')}",
            f"backward_efficiency = {entry(1.0, '1')}",
            f"torque_limit = {entry(1e4, 'N m')}",
        ]
    if np.any(machine.topology != np.eye(len(machine.driven))):
        lines += ["[transmission]", f"topology = {entry(machine.topology.tolist(), '1')}"]
    for name, _, _ in machine.contacts:
        lines += [
            "[[contacts]]",
            f'name = "{name}"',
            f'frame = "{name}"',
            f"friction = {entry(0.8, '1')}",
        ]
    return "\n".join(lines) + "\n"
