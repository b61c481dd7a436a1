"""Work and losses of a smooth part of a step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.robot import Robot
from wbc.sim.energy.energy_flow import EnergyFlow
from wbc.sim.laws.drivetrain import Drivetrain
from wbc.sim.laws.gear_rows import GearRows
from wbc.sim.laws.motor_motion import MotorMotion
from wbc.sim.solve.solution import StepSolution
from wbc.sim.step.forces import EffectForces


@dataclass(frozen=True, eq=False, slots=True)
class Transit:
    """How the gears passed a smooth part of a step.

    Attributes:
        robot: whose effects acted.
        drive: constant part of the rows.
        velocity: v (nv,) before.
        motor: motion of the motor outputs before.
        motor_after: after.
        mesh: T (m,) [N m s].
        solution: of the step program.
        gears: its dissipative rows.
        forces: of the effects.
        external: joint-space force given by the user (nv,), None for none.
        step: h [s].
        ground: speed (k + k d,) of the ground along the contacts in the middle, None for none.
    """

    robot: Robot
    drive: Drivetrain
    velocity: FloatArray
    motor: MotorMotion
    motor_after: MotorMotion
    mesh: FloatArray
    solution: StepSolution
    gears: GearRows
    forces: EffectForces
    external: FloatArray | None
    step: float
    ground: FloatArray | None = None


def flow_energy(part: Transit) -> EnergyFlow:
    """Return work and losses of a smooth part of a step."""
    drive, step, forces, solution = part.drive, part.step, part.forces, part.solution
    elements, reduced = part.gears.elements, solution.reduced
    mesh, after, rub = part.mesh, part.motor_after.speed, 0.0
    if part.gears.rubbing:
        size = np.abs(solution.element_speed)
        rub = float(((elements.friction + elements.damping * size) * size).sum())
    gain = np.where(after * mesh > 0.0, 1.0 / drive.forward, drive.backward)
    mean = 0.5 * (part.velocity + solution.velocity)
    tangent = reduced.tangent_rows
    turned = 0.5 * step * drive.ratio * (part.motor.speed + after)
    motor_work = forces.rotor * turned
    own_joint, own_rotor, stores = forces.joint, motor_work, EnergyFlow()
    if forces.kept_joint is not None and forces.kept_rotor is not None:
        own_joint = forces.joint - forces.kept_joint
        own_rotor, stores = (forces.rotor - forces.kept_rotor) * turned, _stores(part)
    rotor_loss = step * (drive.coulomb + drive.viscous * np.abs(after)) * np.abs(after)
    lost, damped = (gain - 1.0) * mesh * after, 0.0
    if drive.any_loose:
        rubbed = step * (drive.coulomb * np.sign(after) + drive.viscous * after)
        pushed = step * drive.ratio * forces.rotor - rubbed
        lost, damped = _loose_losses(part, pushed, lost)
    return EnergyFlow(
        motor=float(own_rotor.sum()),
        external=0.0 if part.external is None else float(step * (part.external @ mean)),
        effects=float(step * (own_joint @ mean)),
        ground=ground_work(solution, part.ground),
        reloaded=stores.reloaded,
        bent=stores.bent,
        mesh=float(lost.sum()),
        rotor_friction=float(rotor_loss.sum()),
        gear_damping=damped,
        joint_friction=rub,
        bristles=stores.bristles,
        contact=_contact_loss(part) - float(solution.impulse[tangent] @ solution.speed[tangent]),
    )


def ground_work(solution: StepSolution, speed: FloatArray | None) -> float:
    """Return the work [J] of ground that moves at speeds (k + k d,) along normals and tangents."""
    if speed is None:
        return 0.0
    reduced = solution.reduced
    return float(solution.impulse[reduced.elements + reduced.limits :] @ speed)


def _stores(part: Transit) -> EnergyFlow:
    """Return where the work went that effects with a store of their own took."""
    total = EnergyFlow()
    for effect, motion in part.forces.stores:
        found = effect.memory_energy(part.robot, motion)
        if found is not None:
            total = total + EnergyFlow(
                reloaded=found.reloaded, bent=found.stored, bristles=found.lost
            )
    return total


def _contact_loss(part: Transit) -> float:
    """Return what barriers that close without an impact take [J].

    A barrier that is closed already moves by drift alone, of either sign: that is no loss.
    """
    normal = part.solution.reduced.normal_rows
    if normal.start == normal.stop:
        return 0.0
    rows = part.solution.reduced.program.rows()[normal]
    mean = 0.5 * rows @ (part.velocity + part.solution.velocity)
    if part.ground is not None:
        reduced = part.solution.reduced
        mean[reduced.limits :] -= part.ground[: reduced.contacts]
    return float(np.maximum(-part.solution.impulse[normal] * mean, 0.0).sum())


def _loose_losses(part: Transit, pushed: FloatArray, lost: FloatArray) -> tuple[FloatArray, float]:
    """Return the mesh losses (m,) and the loss between meshes and joints [J] where gears are loose.

    A spring's loss is what it takes and does not store, its damper's is that of the final speed,
    like every law's of a step: what the change of speed within the step makes of it is
    discretisation, and part of the residual. A rotor that hits the rigid flank of its
    play jumps within the step, for which impulse times final speed would be wrong by more than
    O(h): there the loss of mesh and flank together is what the rotor gives and the joint does not
    get, and the mesh has no more than that of it. Without a hit that may be less than nothing, by
    the change of speed within the step: then the mesh's loss is that of the final speed. A gear
    that hangs in its play loses nothing.

    Args:
        part: of the step.
        pushed: (m,) [N m s] of the motors on their outputs, less the rotors' friction.
        lost: (m,) [J] in the meshes at the final speed.
    """
    drive, mesh, before, after = part.drive, part.mesh, part.motor, part.motor_after
    damped = 0.5 * mesh * (before.relative + after.relative)
    held = np.zeros(drive.size, dtype=bool)
    held[part.gears.engaged] = True
    flanks = held & drive.loose & ~np.isfinite(drive.stiffness)
    stored = 0.5 * drive.inertia * (after.speed**2 - before.speed**2)
    balance = 0.5 * (pushed - mesh) * (before.speed + after.speed) - stored
    together = balance + damped
    hits = flanks & (together > 0.0)
    own = np.where(hits, np.minimum(np.maximum(balance, 0.0), together), lost)
    damped += 0.5 * part.gears.damped * (after.relative - before.relative)
    springs = drive.spring_energy(after.deflection) - drive.spring_energy(before.deflection)
    damped = np.where(flanks, np.where(hits, together - own, 0.0), damped)
    return own, float(damped.sum()) - springs
