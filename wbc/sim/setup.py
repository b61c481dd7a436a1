"""What a plant prepares once: memory and the parts of the equations that never change."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin
from scipy.linalg import lapack

from wbc.arrays import BoolArray, FloatArray, frozen
from wbc.dynamics import Workspace
from wbc.errors import SimulationError
from wbc.robot import Motion, Robot
from wbc.sim.ground.barriers import Barriers
from wbc.sim.ground.terrain import Terrain
from wbc.sim.inner.inner import Inner, inner_of
from wbc.sim.laws.drivetrain import Drivetrain, drivetrain
from wbc.sim.solve.reduced import NOT_POSITIVE
from wbc.sim.state import EffectMemory
from wbc.sim.step.flight import FreeBase, free_bases
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
        bases: its free bases.
        restitution: normal speed after over before an impact.
        return_speed: at which an overlap is taken back at most [m/s, rad/s].
        layout: of `SimState.impulse`.
        memory: what the robot's effects start with.
        still: (nv,) zeros, the forces of no effects.
        none: (2 j + c,) no barrier.
        least: (m,) [N m] least rotor torque, by the robot's torque limits.
        gravity: its size [m/s^2].
        inner: compiled loops for the common case; None for robots and grounds that they do not
            know.
        temperature: (m,) of the motors [deg C], None where it was not given.
        varying: whether efficiencies of gears depend on the motion.
        meshed: whether an effect replaces what a gear loses and needs the torque that it carries.
    """

    robot: Robot
    space: Workspace
    drive: Drivetrain
    barriers: Barriers
    bases: tuple[FreeBase, ...]
    restitution: float
    return_speed: float
    layout: ImpulseLayout
    memory: EffectMemory
    still: FloatArray
    none: BoolArray
    least: FloatArray
    gravity: float
    inner: Inner | None
    temperature: FloatArray | None = None
    varying: bool = False
    meshed: bool = False

    def moving(self, position: FloatArray, velocity: FloatArray) -> Setup:
        """Return the setup with the efficiencies that its gears have at q (nq,) and v (nv,)."""
        if not self.varying:
            return self
        motion, drive = Motion(position, velocity), self.drive
        now = self.robot.gear_efficiencies(motion, drive.forward, drive.backward)
        return replace(self, drive=replace(drive, forward=now[0], backward=now[1]))


def prepare(robot: Robot, terrain: Terrain, restitution: float, return_speed: float) -> Setup:
    """Return the setup of `robot` on `terrain`.

    Raises:
        SimulationError: a robot with a body without mass that moves freely.
    """
    space = Workspace(robot)
    inertia = pin.crba(space.model, space.data, robot.neutral())
    if lapack.dpotrf(inertia)[1] != 0:
        raise SimulationError(f"'{robot.name}': {NOT_POSITIVE}")
    barriers = Barriers(robot, terrain, space)
    drive = drivetrain(robot)
    bases = free_bases(robot)
    layout = ImpulseLayout.of(drive.size, space.model.nv, barriers)
    return Setup(
        robot,
        space,
        drive,
        barriers,
        bases,
        restitution,
        return_speed,
        layout,
        first_memory(robot),
        frozen(np.zeros(space.model.nv)),
        frozen(np.zeros(barriers.size), bool),
        -robot.transmission.torque_limit,
        float(np.linalg.norm(space.model.gravity.linear)),
        inner_of(robot, terrain, bases, drive, barriers, layout, return_speed),
        varying=bool(robot.varying_gears.any()),
        meshed=any("meshed" in effect.acts_by for effect in robot.effects),
    )
