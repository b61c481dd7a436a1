"""Work and losses of a smooth part of a step, and where the motor outputs end up."""

from __future__ import annotations

import numpy as np

from wbc.arrays import FloatArray
from wbc.sim.drivetrain import Drivetrain
from wbc.sim.energy import EnergyFlow
from wbc.sim.forces import EffectForces
from wbc.sim.gear_rows import GearRows
from wbc.sim.motor_motion import MotorMotion
from wbc.sim.solution import StepSolution


def flow_energy(
    drive: Drivetrain,
    velocity: FloatArray,
    motor: MotorMotion,
    solution: StepSolution,
    gears: GearRows,
    forces: EffectForces,
    external: FloatArray | None,
    step: float,
) -> tuple[EnergyFlow, FloatArray, MotorMotion]:
    """Return work and losses, the mesh impulses T (m,) and the motor outputs' motion after.

    Args:
        drive: constant part of the rows.
        velocity: v (nv,) before.
        motor: motion of the motor outputs before.
        solution: of the step program.
        gears: its dissipative rows.
        forces: of the effects.
        external: joint-space force given by the user (nv,), None for none.
        step: h [s].
    """
    elements, reduced = solution.reduced.program.elements, solution.reduced
    speed, impulse = solution.element_speed, solution.element_impulse
    own, rub = impulse, 0.0
    if gears.rubbing:
        size = np.abs(speed)
        rub = float(((elements.friction + elements.damping * size) * size).sum())
        own = impulse + np.sign(speed) * elements.friction + elements.damping * speed
    count = len(gears.engaged)
    mesh, after = np.zeros(drive.size), gears.free_speed.copy()
    mesh[gears.engaged], after[gears.engaged] = own[:count], speed[:count]
    following = motor.after(drive, solution.velocity, after, step)
    gain = np.where(after * mesh > 0.0, 1.0 / drive.forward, drive.backward)
    mean = 0.5 * (velocity + solution.velocity)
    tangent = reduced.tangent_rows
    motor_work = 0.5 * step * drive.ratio * forces.rotor * (motor.speed + after)
    rotor_loss = step * (drive.coulomb + drive.viscous * np.abs(after)) * np.abs(after)
    lost = (gain - 1.0) * mesh * after
    damped = 0.0
    if drive.any_loose:
        lost, damped = _loose_losses(drive, (motor, following), mesh, motor_work - rotor_loss, lost)
    energy = EnergyFlow(
        motor=float(motor_work.sum()),
        external=0.0 if external is None else float(step * (external @ mean)),
        effects=float(step * (forces.joint @ mean)),
        mesh=float(lost.sum()),
        rotor_friction=float(rotor_loss.sum()),
        gear_damping=damped,
        joint_friction=rub,
        contact=-float(solution.impulse[tangent] @ solution.speed[tangent]),
    )
    return energy, mesh, following


def _loose_losses(
    drive: Drivetrain,
    motors: tuple[MotorMotion, MotorMotion],
    mesh: FloatArray,
    work: FloatArray,
    lost: FloatArray,
) -> tuple[FloatArray, float]:
    """Return the mesh losses (m,) and the loss between meshes and joints [J] where gears are loose.

    A spring's loss is what it takes and does not store. A rotor that hits the rigid flank of its
    play jumps within the step, for which impulse times final speed would be wrong by more than
    O(h): there the loss of mesh and flank together is what the rotor gives and the joint does not
    get, and the mesh has no more than that of it.
    """
    before, after = motors
    damped = 0.5 * mesh * (before.relative + after.relative)
    flanks = drive.loose & ~np.isfinite(drive.stiffness)
    stored = 0.5 * drive.inertia * (after.speed**2 - before.speed**2)
    balance = work - stored - 0.5 * mesh * (before.speed + after.speed)
    together = balance + damped
    own = np.minimum(np.maximum(balance, 0.0), np.maximum(together, 0.0))
    springs = drive.spring_energy(after.deflection) - drive.spring_energy(before.deflection)
    damped = np.where(flanks, together - own, damped)
    return np.where(flanks, own, lost), float(damped.sum()) - springs
