"""What a plant prepares once: memory and the parts of the equations that never change."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin
from scipy.linalg import lapack

from wbc.arrays import BoolArray, FloatArray, frozen
from wbc.dynamics import RotorCoupling, Terms, Workspace, rotor_coupling
from wbc.effects.tables import fill_efficiencies
from wbc.errors import SimulationError
from wbc.mechanics.tree import tree_of
from wbc.robot import Hull, Motion, Robot
from wbc.sim.barriers import Barriers
from wbc.sim.ground import Terrain
from wbc.sim.step.core import Core
from wbc.sim.step.forces import PlantEffects
from wbc.sim.step.gears import Drivetrain
from wbc.sim.step.motion import free_bases
from wbc.sim.step.program import NOT_POSITIVE
from wbc.sim.step.tables import BACKWARD, INVERSE


@dataclass(frozen=True, eq=False, slots=True)
class Setup:
    """A robot on a terrain, prepared for stepping.

    Attributes:
        robot: what moves.
        space: memory for its kinematics.
        drive: its gears.
        barriers: its limits and contacts.
        restitution: normal speed after over before an impact.
        return_speed: at which an overlap is taken back at most [m/s, rad/s].
        effects: of the robot.
        still: (nv,) zeros, the forces of no effects.
        none: (2 j + c,) no barrier.
        least: (m,) [N m] least rotor torque, by the robot's torque limits.
        gravity: its size [m/s^2].
        core: the compiled loops.
        temperature: (m,) of the motors [deg C], None where it was not given.
        varying: whether efficiencies of gears depend on the motion.
        meshed: whether an effect replaces what a gear loses and needs the torque that it carries.
        flies: whether it has a free base that carries its momentum.
        waits: whether a part needs Python in its middle: for effects that no table holds, for
            efficiencies that vary, or for rotor coupling. Loops evaluate effects where it does not.
        yielding: (2 j + c,) barriers that are compliant.
    """

    robot: Robot
    space: Workspace
    drive: Drivetrain
    barriers: Barriers
    restitution: float
    return_speed: float
    effects: PlantEffects
    still: FloatArray
    none: BoolArray
    least: FloatArray
    gravity: float
    core: Core
    temperature: FloatArray | None = None
    varying: bool = False
    meshed: bool = False
    flies: bool = False
    waits: bool = False
    yielding: BoolArray = field(default_factory=lambda: np.zeros(0, bool))

    def tell_losses(self, position: FloatArray, velocity: FloatArray) -> None:
        """Give the loops the efficiencies that gears have at q (nq,) and v (nv,), if they vary."""
        if not self.varying:
            return
        drive, table = self.drive, self.effects.table
        if not table.act_on_gears:
            motion = Motion(position, velocity)
            self._write(*self.robot.gear_efficiencies(motion, drive.forward, drive.backward))
            return
        forward, backward, turning = np.empty((3, drive.size))
        turning[:] = drive.rows @ velocity
        fill_efficiencies(table.gears, turning, drive.forward, drive.backward, forward, backward)
        self._write(forward, backward)

    def forget_losses(self) -> None:
        """Give the loops the efficiencies that gears have without effects."""
        if self.varying:
            self._write(self.drive.forward, self.drive.backward)

    def _write(self, forward: FloatArray, backward: FloatArray) -> None:
        numbers = self.core.plant.gears.numbers
        numbers[:, INVERSE], numbers[:, BACKWARD] = 1.0 / forward, backward

    def coupling(self, position: FloatArray, velocity: FloatArray) -> RotorCoupling | None:
        """Return the inertial coupling at (q, v); None where rotors only feel their own spin."""
        if not self.robot.rotors_turn_with_links:
            return None
        model, data = self.space.model, self.space.data
        pin.forwardKinematics(model, data, position, velocity, np.zeros(model.nv))
        pin.computeJointJacobians(model, data, position)
        none = np.zeros(0)
        terms = Terms(position, velocity, none, none, none, none, none, data)
        return rotor_coupling(self.robot, terms)

    def tell_coupling(self, position: FloatArray, velocity: FloatArray) -> None:
        """Give the loops the inertial coupling at (q, v), at the motor outputs."""
        found = self.coupling(position, velocity)
        if found is not None:
            told, ratio, nv = self.core.plant.gears, self.drive.ratio, len(velocity)
            told.coupling[:] = ratio[:, None] * found.inertia
            told.gyration[0, :nv] = found.link_bias
            told.gyration[0, nv:] = ratio * found.rotor_bias


def prepare(
    robot: Robot,
    terrain: Terrain,
    restitution: float,
    return_speed: float,
    hulls: tuple[Hull, ...] = (),
    compliance: tuple[float, float] = (0.0, 0.0),
) -> Setup:
    """Return the setup of `robot` on `terrain`.

    Args:
        robot, terrain, restitution, return_speed: see `Plant`.
        hulls: of its links that meet edges, and each other.
        compliance: K and a of compliant contacts, zero for rigid ones.

    Raises:
        SimulationError: a robot with a body without mass that moves freely, or with a joint of a
            kind that the plant does not know.
    """
    space = Workspace(robot)
    inertia = pin.crba(space.model, space.data, robot.neutral())
    if lapack.dpotrf(inertia)[1] != 0:
        raise SimulationError(f"'{robot.name}': {NOT_POSITIVE}")
    tree = tree_of(robot.model)
    if tree is None:
        kinds = sorted({joint.shortname() for joint in list(robot.model.joints)[1:]})
        raise SimulationError(
            f"'{robot.name}' has a joint of a kind that the plant does not know, among "
            f"{', '.join(kinds)}; it knows joints about and along an axis, and free ones."
        )
    barriers, drive = Barriers(robot, terrain, space, tree, hulls), Drivetrain.of(robot)
    effects, varying = PlantEffects.of(robot), bool(robot.varying_gears.any())
    waits = bool(effects.hooks) or varying or robot.rotors_turn_with_links
    laws = None if waits else effects.table
    setup = Setup(
        robot,
        space,
        drive,
        barriers,
        restitution,
        return_speed,
        effects,
        frozen(np.zeros(space.model.nv)),
        frozen(np.zeros(barriers.size), bool),
        -robot.transmission.torque_limit,
        float(np.linalg.norm(space.model.gravity.linear)),
        Core(robot, terrain, tree, drive, barriers, return_speed, compliance, laws),
        yielding=frozen(np.arange(barriers.size) >= barriers.limits, bool) & (compliance[0] > 0.0),
        varying=varying,
        meshed=any("meshed" in effect.acts_by for effect in robot.effects),
        flies=bool(len(free_bases(robot))),
        waits=waits,
    )
    _check_rotors(setup)
    return setup


def _check_rotors(setup: Setup) -> None:
    """Refuse rotors that spin more inertia than the links that carry them have.

    The links' inertia holds that of their rotors at standstill. Without it, H - C' I_r^-1 C with
    the rows C of the coupling, nothing negative may be left: the kinetic energy would be.

    Raises:
        SimulationError: the kinetic energy can be negative; it names the heaviest rotor.
    """
    robot, at_rest = setup.robot, np.zeros(setup.space.model.nv)
    found = setup.coupling(robot.neutral(), at_rest)
    if found is None:
        return
    spin = robot.transmission.rotor_inertia
    turning = found.inertia[spin > 0.0] / np.sqrt(spin[spin > 0.0])[:, None]
    inertia = pin.crba(setup.space.model, setup.space.data, robot.neutral())
    shares = turning @ np.linalg.solve(np.triu(inertia) + np.triu(inertia, 1).T, turning.T)
    if np.linalg.eigvalsh(shares).max(initial=0.0) >= 1.0:
        names = [j for j, own in zip(robot.transmission.joints, spin, strict=True) if own > 0.0]
        worst = int(np.argmax(np.diag(shares)))
        raise SimulationError(
            f"'{robot.name}': the rotor of '{names[worst]}' has {shares[worst, worst]:.3g} times "
            "the inertia that its housing has about the rotor's axis, all rotors together more "
            "than their housings: the kinetic energy can be negative. Links contain the inertia "
            "of their rotors at standstill: give the links more, or the rotors less."
        )
