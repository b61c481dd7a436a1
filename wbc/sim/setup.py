"""What a plant prepares once: memory and the parts of the equations that never change."""

from __future__ import annotations

from dataclasses import dataclass

from wbc.dynamics import Workspace
from wbc.robot import Robot
from wbc.sim.ground.barriers import Barriers
from wbc.sim.ground.terrain import Terrain
from wbc.sim.laws.drivetrain import Drivetrain, drivetrain
from wbc.sim.state import EffectMemory
from wbc.sim.step.forces import first_memory
from wbc.sim.step.warm_start import ImpulseLayout


@dataclass(frozen=True, eq=False, slots=True)
class Setup:
    """A robot on a terrain, prepared for stepping.

    Attributes:
        robot: what moves.
        space: memory for its kinematics.
        drive: its gears.
        barriers: its limits and contacts.
        restitution: normal speed after over before an impact.
        layout: of `SimState.impulse`.
        memory: what the robot's effects start with.
    """

    robot: Robot
    space: Workspace
    drive: Drivetrain
    barriers: Barriers
    restitution: float
    layout: ImpulseLayout
    memory: EffectMemory


def prepare(robot: Robot, terrain: Terrain, restitution: float) -> Setup:
    """Return the setup of `robot` on `terrain`."""
    space = Workspace(robot)
    barriers = Barriers(robot, terrain, space)
    drive = drivetrain(robot)
    layout = ImpulseLayout.of(drive.size, space.model.nv, barriers)
    return Setup(robot, space, drive, barriers, restitution, layout, first_memory(robot))
