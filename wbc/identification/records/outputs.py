"""The rows that a model is judged by: what stands for each in words and in the motion."""

from __future__ import annotations

from wbc.robot import Robot


def output_names(robot: Robot) -> tuple[str, ...]:
    """Return the names of the residual's columns: driven joints, then undriven coordinates."""
    names = list(robot.transmission.joints)
    for row in robot.unactuated:
        single = [n for n in robot.single_joints if robot.velocity_index(n) == row]
        names.append(single[0] if single else f"base[{row}]")
    return tuple(names)
