"""What a plant prepares once: memory and the parts of the equations that never change."""

from __future__ import annotations

from dataclasses import dataclass

from wbc.dynamics import Workspace
from wbc.robot import Robot
from wbc.sim.barriers import Barriers
from wbc.sim.drivetrain import Drivetrain, drivetrain
from wbc.sim.terrain import Terrain


@dataclass(frozen=True, eq=False, slots=True)
class Setup:
    """A robot on a terrain, prepared for stepping.

    Attributes:
        robot: what moves.
        space: memory for its kinematics.
        drive: its gears.
        barriers: its limits and contacts.
        restitution: normal speed after over before an impact.
        stored_size: entries of `SimState.impulse`: gears, coordinates, limits and contacts,
            tangents.
    """

    robot: Robot
    space: Workspace
    drive: Drivetrain
    barriers: Barriers
    restitution: float
    stored_size: int


def prepare(robot: Robot, terrain: Terrain, restitution: float) -> Setup:
    """Return the setup of `robot` on `terrain`."""
    space = Workspace(robot)
    barriers = Barriers(robot, terrain, space)
    drive = drivetrain(robot)
    d = 1 if barriers.planar else 2
    stored = drive.size + space.model.nv + barriers.size + d * barriers.contacts
    return Setup(robot, space, drive, barriers, restitution, int(stored))
