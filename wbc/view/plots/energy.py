"""Energy audit: where the motors' work went."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from matplotlib.figure import Figure

from wbc.arrays import FloatArray
from wbc.dynamics import contact_torque
from wbc.measurement import Log
from wbc.robot import Robot
from wbc.view.palette import LIGHT, Theme
from wbc.view.plots.style import DASHES, drawing, legend_above, new_figure
from wbc.view.quantities.channels import configuration, contact_forces, rotor_torque, velocity
from wbc.view.quantities.gear_flow import gear_flow, tooth_loss


@dataclass(frozen=True, eq=False)
class LogEnergy:
    """Energy along a log, all (N,) [J] and counted from its first sample.

    Attributes:
        motor_work: integral of tau_phi dphi.
        contact_work: integral of the ground forces' power on the robot (0 where nothing slides
            and nothing hits; negative for an impact that swallows energy).
        kinetic: change of the kinetic energy of links and rotors.
        potential: change of the potential energy.
        heat: integral of the losses in teeth and rotor friction.
        unexplained: motor and contact work minus all the rest.
    """

    motor_work: FloatArray
    contact_work: FloatArray
    kinetic: FloatArray
    potential: FloatArray
    heat: FloatArray
    unexplained: FloatArray


def energy_audit(robot: Robot, log: Log, *, held: bool = False) -> LogEnergy:
    """Return where the energy of a log went according to the model.

    What the model lacks (friction, a payload, an impact too short for the sampling) ends up in
    `unexplained`.

    Args:
        robot: whose masses and gears.
        log: positions or velocities, torques, contact forces.
        held: whether torques and forces are held from each row to the next, as in a recording of
            the simulator. Otherwise they are samples, and powers are averaged over 20 ms.
    """
    position, speed = configuration(robot, log), velocity(robot, log)
    model, data = robot.model, robot.model.createData()
    links = np.array(
        [pin.computeKineticEnergy(model, data, q, v) for q, v in zip(position, speed, strict=True)]
    )
    height = np.array([pin.computePotentialEnergy(model, data, q) for q in position])
    gears = robot.transmission
    spin = (speed[:, robot.actuated] @ gears.motor_from_joint.T) * gears.gear_ratio
    rotors = 0.5 * np.sum(gears.rotor_inertia * spin**2, axis=1)
    force = contact_torque(robot, position, contact_forces(robot, log))
    if held:
        middle = 0.5 * (speed[1:] + speed[:-1])
        drive, loss = _gear_powers(robot, log, speed)
        push = np.sum(force[:-1] * middle, axis=1)
    else:
        flow = gear_flow(robot, log)
        drive, loss, push = (
            _between(power) for power in (flow.rotor_power, flow.loss, force * speed)
        )
    motor, heat, ground = (_sum(log.time, power) for power in (drive, loss, push))
    kinetic = links + rotors - links[0] - rotors[0]
    potential = height - height[0]
    rest = motor + ground - kinetic - potential - heat
    return LogEnergy(motor, ground, kinetic, potential, heat, rest)


def energy_figure(robot: Robot, log: Log, theme: Theme = LIGHT, *, held: bool = False) -> Figure:
    """Return the audit as lines: what came in, what is stored, what is lost.

    Args:
        robot, log, held: see `energy_audit`.
        theme: page colours.
    """
    audit = energy_audit(robot, log, held=held)
    lines = [
        ("work of the motors", audit.motor_work),
        ("work of the ground", audit.contact_work),
        ("kinetic energy", audit.kinetic),
        ("potential energy", audit.potential),
        ("heat in gears", audit.heat),
    ]
    largest = max(float(np.abs(values).max()) for _, values in lines)
    left = float(np.abs(audit.unexplained).max())
    with drawing(theme):
        figure, grid = new_figure(2, 1, 7.0, 4.6, share_x=True, heights=(3, 1))
        upper, lower = grid[0][0], grid[1][0]
        for i, (label, values) in enumerate(lines):
            upper.plot(log.time, values, color=theme.series[i], linestyle=DASHES[i], label=label)
        upper.set_title("energy since the start")
        upper.set_ylabel("energy [J]")
        legend_above(figure, upper, 3)
        lower.plot(log.time, audit.unexplained, color=theme.ink)
        # On the scale of a twentieth of the energies: a line that looks flat is explained.
        lower.set_ylim(-(limit := max(0.05 * largest, 1.2 * left)), limit)
        share = 100.0 * left / largest if largest else 0.0
        lower.set_title(f"not explained: at most {left:.2g} J, {share:.1g} % of the largest energy")
        lower.set_ylabel("energy [J]")
        lower.set_xlabel("time [s]")
        lower.set_xlim(log.time[0], log.time[-1])
        figure.align_ylabels([upper, lower])
    return figure


def _gear_powers(robot: Robot, log: Log, speed: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return what all motors give and what all gears lose, (N - 1,) [W], in each step of a log.

    The torque of a row is held to the next, while the speed changes between the two. Powers that
    are sampled at the rows miss how a controller answers to noise: over two squats of the leg they
    leave 0.12 J of 18 J unexplained, these 0.008 J, as the simulator's own balance does.
    """
    gears = robot.transmission
    torque = rotor_torque(robot, log)[:-1]
    output = speed[:, robot.actuated] @ gears.motor_from_joint.T
    spin = gears.gear_ratio * 0.5 * (output[1:] + output[:-1])
    growth = np.diff(output, axis=0) / np.diff(log.time)[:, None]
    friction = gears.rotor_coulomb_friction * np.sign(spin) + gears.rotor_viscous_friction * spin
    mesh = (torque - friction) * spin - gears.reflected_inertia * growth * spin / gears.gear_ratio
    loss = tooth_loss(gears, mesh) + friction * spin
    return np.nansum(torque * spin, axis=1), np.nansum(loss, axis=1)


def _between(power: FloatArray) -> FloatArray:
    """Return the sum (N - 1,) over columns of a sampled power (N, ...), between its rows."""
    total = np.nansum(power, axis=1)
    return np.asarray(0.5 * (total[1:] + total[:-1]))


def _sum(time: FloatArray, power: FloatArray) -> FloatArray:
    return np.concatenate([[0.0], np.cumsum(power * np.diff(time))])
