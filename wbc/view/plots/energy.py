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
from wbc.view.channels import configuration, contact_forces, velocity
from wbc.view.gear_flow import gear_flow
from wbc.view.palette import LIGHT, Theme
from wbc.view.plots.style import DASHES, drawing, new_figure


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


def energy_audit(robot: Robot, log: Log) -> LogEnergy:
    """Return where the energy of a log went according to the model.

    What the model lacks (friction, a payload, an impact too short for the sampling) ends up in
    `unexplained`.
    """
    position, speed = configuration(robot, log), velocity(robot, log)
    flow = gear_flow(robot, log)
    model, data = robot.model, robot.model.createData()
    links = np.array(
        [pin.computeKineticEnergy(model, data, q, v) for q, v in zip(position, speed, strict=True)]
    )
    height = np.array([pin.computePotentialEnergy(model, data, q) for q in position])
    gears = robot.transmission
    spin = (speed[:, robot.actuated] @ gears.motor_from_joint.T) * gears.gear_ratio
    rotors = 0.5 * np.sum(gears.rotor_inertia * spin**2, axis=1)
    force = contact_torque(robot, position, contact_forces(robot, log))
    motor = _integral(log.time, np.nansum(flow.rotor_power, axis=1))
    ground = _integral(log.time, np.sum(force * speed, axis=1))
    kinetic = links + rotors - links[0] - rotors[0]
    potential = height - height[0]
    heat = _integral(log.time, np.nansum(flow.loss, axis=1))
    rest = motor + ground - kinetic - potential - heat
    return LogEnergy(motor, ground, kinetic, potential, heat, rest)


def energy_figure(robot: Robot, log: Log, theme: Theme = LIGHT) -> Figure:
    """Return the audit as lines: what came in, what is stored, what is lost."""
    audit = energy_audit(robot, log)
    lines = [
        ("work of the motors", audit.motor_work),
        ("work of the ground", audit.contact_work),
        ("kinetic energy", audit.kinetic),
        ("potential energy", audit.potential),
        ("heat in gears", audit.heat),
    ]
    with drawing(theme):
        figure, grid = new_figure(2, 1, 7.0, 4.6, share_x=True)
        upper, lower = grid[0][0], grid[1][0]
        for i, (label, values) in enumerate(lines):
            upper.plot(log.time, values, color=theme.series[i], linestyle=DASHES[i], label=label)
        upper.set_title("energy since the start")
        upper.set_ylabel("energy [J]")
        upper.legend(loc="upper left", ncols=3)
        upper.margins(y=0.25)
        lower.fill_between(log.time, audit.unexplained, color=theme.series[1], alpha=0.35)
        lower.plot(log.time, audit.unexplained, color=theme.series[1])
        lower.set_title("unexplained: motors + ground - stored - heat")
        lower.set_ylabel("energy [J]")
        lower.set_xlabel("time [s]")
        lower.set_xlim(log.time[0], log.time[-1])
        figure.align_ylabels([upper, lower])
    return figure


def _integral(time: FloatArray, power: FloatArray) -> FloatArray:
    steps = 0.5 * (power[1:] + power[:-1]) * np.diff(time)
    return np.concatenate([[0.0], np.cumsum(steps)])
