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
    rub = (elements.friction + elements.damping * np.abs(speed)) * np.abs(speed)
    own = impulse + np.sign(speed) * elements.friction + elements.damping * speed
    count = len(gears.engaged)
    mesh, after = np.zeros(drive.size), gears.free_speed.copy()
    mesh[gears.engaged], after[gears.engaged] = own[:count], speed[:count]
    following = motor.after(drive, solution.velocity, after, step)
    gain = np.where(after * mesh > 0.0, 1.0 / drive.forward, drive.backward)
    mean = 0.5 * (velocity + solution.velocity)
    first = reduced.elements + reduced.limits
    pressed = solution.impulse * solution.speed
    energy = EnergyFlow(
        motor=float(0.5 * step * ((drive.ratio * forces.rotor) @ (motor.speed + after))),
        external=0.0 if external is None else float(step * (external @ mean)),
        effects=float(step * (forces.joint @ mean)),
        mesh=float(((gain - 1.0) * mesh) @ after),
        rotor_friction=float(
            step * (drive.coulomb + drive.viscous * np.abs(after)) @ np.abs(after)
        ),
        gear_damping=motor.damping_loss(drive, following, mesh),
        joint_friction=float(rub.sum()),
        contact=-float(pressed[first:].sum()),
        limits=-float(pressed[reduced.elements : first].sum()),
    )
    return energy, mesh, following
