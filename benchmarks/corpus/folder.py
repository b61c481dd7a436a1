"""Write a machine as a robot folder (URDF and robot.toml)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks.corpus.machine import Link, Machine


def write_folder(machine: Machine, folder: Path) -> Path:
    """Write the files into `folder` and return the path that `load_robot` takes."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "robot.urdf").write_text(_urdf(machine))
    (folder / "robot.toml").write_text(_toml(machine))
    return folder / "robot.toml"


def _numbers(values: np.ndarray) -> str:
    return " ".join(f"{float(value):.17g}" for value in values)


def _urdf(machine: Machine) -> str:
    parts = ['<?xml version="1.0"?>', '<robot name="generated">']
    if not machine.floating:
        parts.append('<link name="world"/>')
    for link in machine.links:
        parts.append(_link(link))
        if link.kind == "free":
            continue
        parent = "world" if link.parent < 0 else machine.links[link.parent].name
        kind = {"hinge": "revolute", "slide": "prismatic"}[link.kind]
        parts.append(
            f'<joint name="{link.joint}" type="{kind}"><parent link="{parent}"/>'
            f'<child link="{link.name}"/><origin xyz="{_numbers(link.origin)}"/>'
            f'<axis xyz="{_numbers(link.axis)}"/>'
            '<limit lower="-100" upper="100" effort="1000" velocity="100"/></joint>'
        )
    for name, number, point in machine.contacts:
        parts.append(
            f'<link name="{name}"/><joint name="{name}_weld" type="fixed">'
            f'<parent link="{machine.links[number].name}"/><child link="{name}"/>'
            f'<origin xyz="{_numbers(point)}"/></joint>'
        )
    return "\n".join([*parts, "</robot>"])


def _link(link: Link) -> str:
    if link.mass < 1e-6:
        return f'<link name="{link.name}"/>'
    i = link.inertia
    return (
        f'<link name="{link.name}"><inertial><origin xyz="{_numbers(link.com)}"/>'
        f'<mass value="{link.mass:.17g}"/>'
        f'<inertia ixx="{i[0, 0]:.17g}" ixy="{i[0, 1]:.17g}" ixz="{i[0, 2]:.17g}" '
        f'iyy="{i[1, 1]:.17g}" iyz="{i[1, 2]:.17g}" izz="{i[2, 2]:.17g}"/></inertial></link>'
    )


def _toml(machine: Machine) -> str:
    def entry(value: object, unit: str) -> str:
        return f'{{ value = {value}, unit = "{unit}", source = "generated" }}'

    lines = [
        'name = "generated"',
        'model = "robot.urdf"',
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
