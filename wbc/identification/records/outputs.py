"""The rows that a model is judged by, and what stands for each in words and in the motion.

First the m gears: reported torque minus what mesh, rotor and drive need. Then the b coordinates
that nothing drives: minus the wrench that is missing. Last the s torque sensors behind gears:
measured torque minus what the links need. Where there is a sensor, the row of its gear starts from
what it measures, so that neither row knows of what is wrong on the other side.
"""

from __future__ import annotations

from wbc.robot import Robot
from wbc.robot.coordinates import output_units as gear_and_base_units


def output_count(robot: Robot) -> int:
    """Return m + b + s."""
    return robot.transmission.size + robot.floating_size + len(robot.torque_sensors)


def output_names(robot: Robot) -> tuple[str, ...]:
    """Return the names (m + b + s,) of the rows."""
    names = list(robot.transmission.joints)
    for row in robot.unactuated:
        single = [n for n in robot.single_joints if robot.velocity_index(n) == row]
        names.append(single[0] if single else f"base[{row}]")
    return (*names, *(f"{joint} (link side)" for joint in robot.torque_sensors))


def output_units(robot: Robot) -> tuple[str, ...]:
    """Return the units (m + b + s,) of the rows."""
    units = gear_and_base_units(robot)
    return (*units, *(units[k] for k in robot.sensed))


def output_gear(robot: Robot, output: int) -> int | None:
    """Return the number of the gear that an output belongs to, None for an undriven coordinate."""
    size = robot.transmission.size
    if output < size:
        return output
    sensor = output - size - robot.floating_size
    return int(robot.sensed[sensor]) if sensor >= 0 else None


def output_row(robot: Robot, output: int) -> int:
    """Return the row in v of the coordinate behind an output."""
    gear = output_gear(robot, output)
    if gear is not None:
        return int(robot.actuated[gear])
    return int(robot.unactuated[output - robot.transmission.size])
