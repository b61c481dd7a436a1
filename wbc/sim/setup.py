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
    """

    robot: Robot
    space: Workspace
    drive: Drivetrain
    barriers: Barriers
    restitution: float

    @property
    def stored_size(self) -> int:
        """Entries of `SimState.impulse`: gears, coordinates, limits and contacts, tangents."""
        barriers = self.barriers
        d = 1 if barriers.planar else 2
        return int(self.drive.size + self.space.model.nv + barriers.size + d * barriers.contacts)


def prepare(robot: Robot, terrain: Terrain, restitution: float) -> Setup:
    """Return the setup of `robot` on `terrain`."""
    space = Workspace(robot)
    barriers = Barriers(robot, terrain, space)
    return Setup(robot, space, drivetrain(robot), barriers, restitution)
