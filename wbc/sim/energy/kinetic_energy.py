"""Kinetic energy of links and rotors, and all that a state stores."""

from __future__ import annotations

import pinocchio as pin

from wbc.arrays import FloatArray
from wbc.sim.laws.coupling import step_coupling
from wbc.sim.laws.motor_motion import MotorMotion
from wbc.sim.setup import Setup
from wbc.sim.state import SimState


def kinetic_energy(
    setup: Setup,
    position: FloatArray,
    velocity: FloatArray,
    motor_speed: FloatArray | None = None,
) -> float:
    """Return the kinetic energy at (q, v), inertial rotor coupling included [J].

    Args:
        setup: the plant's.
        position: q (nq,).
        velocity: v (nv,).
        motor_speed: (m,) of the motor outputs, those of the joints when left out.
    """
    drive, space = setup.drive, setup.space
    links = pin.computeKineticEnergy(space.model, space.data, position, velocity)
    speed = drive.rows @ velocity if motor_speed is None else motor_speed
    energy = float(links + 0.5 * drive.inertia @ speed**2)
    coupling = step_coupling(setup.robot, space, position, velocity)
    if coupling is not None:
        energy += float(speed @ (coupling.inertia @ velocity))
    return energy


def mechanical_energy(setup: Setup, state: SimState) -> float:
    """Return the kinetic energy of links and rotors, gravity's and the gear springs' [J]."""
    motor = MotorMotion.of(setup.drive, state)
    height = pin.computePotentialEnergy(setup.space.model, setup.space.data, state.position)
    kinetic = kinetic_energy(setup, state.position, state.velocity, motor.speed)
    return float(kinetic + height + setup.drive.spring_energy(motor.deflection))
