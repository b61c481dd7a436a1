"""The gears' rows of one step: what each rotor brings along, and how it holds on to its joint."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray, IntArray
from wbc.sim.laws.drivetrain import Drivetrain
from wbc.sim.laws.elements import Elements, meeting_speed, modes_at
from wbc.sim.laws.grip import Grip
from wbc.sim.laws.motor_motion import MotorMotion
from wbc.sim.solve.solution import StepSolution


@dataclass(frozen=True, eq=False, slots=True)
class GearRows:
    """Dissipative rows of a step.

    Attributes:
        elements: engaged gears first, then coordinates with friction of their own.
        engaged: (e,) indices of the gears that hold on to their joints.
        damped: (m,) what soft gears pass beside their springs [N m s].
        rubbing: whether any row has friction at its output.
        alone: coordinates with a friction row of their own.
        free_speed: (m,) of the motor outputs of gears that hang in their play.
    """

    elements: Elements
    engaged: IntArray
    damped: FloatArray
    rubbing: bool
    alone: IntArray
    free_speed: FloatArray

    def passed(self, solution: StepSolution) -> tuple[FloatArray, FloatArray]:
        """Return the mesh impulses T (m,) [N m s] and the motor outputs' speeds after (m,)."""
        speed, mesh = solution.element_speed, solution.element_impulse
        if self.rubbing:
            own = self.elements
            mesh = mesh + np.sign(speed) * own.friction + own.damping * speed
        count = len(self.engaged)
        if count == len(self.free_speed):
            return mesh[:count], speed[:count]
        every, after = np.zeros(len(self.free_speed)), self.free_speed.copy()
        every[self.engaged], after[self.engaged] = mesh[:count], speed[:count]
        return every, after


def gear_rows(
    drive: Drivetrain,
    impulse: FloatArray,
    friction: FloatArray | None,
    step: float,
    motor: MotorMotion,
    grip: Grip,
) -> GearRows:
    """Return the dissipative rows of a step.

    Args:
        drive: constant part.
        impulse: (m,) motor impulse at the motor output, N h tau_phi.
        friction: level of dry friction (nv,) on the coordinates, None for none.
        step: h [s].
        motor: motion of the motor outputs before.
        grip: of gears with springs or play.
    """
    up = down = impulse + drive.inertia * motor.speed
    inertia = drive.inertia
    if drive.rubs:
        dry = step * drive.coulomb
        up, down, inertia = up - dry, down + dry, inertia + step * drive.viscous
    zero = drive.zero
    shared, alone = zero, drive.every[:0]
    if friction is not None:
        level = step * friction
        if drive.direct:
            shared = np.where(drive.shares, level[drive.actuated], 0.0)
            level[drive.actuated] -= shared
        alone = np.flatnonzero(level > 0.0)
    elements = Elements(
        drive.rows,
        up,
        down,
        inertia,
        drive.forward,
        drive.backward,
        shared,
        zero,
        drive.firm,
        zero,
    )
    engaged, damped, free_speed = drive.every, zero, zero
    if drive.any_loose:
        damped = grip.damped
        elements, engaged, free_speed = _hold(drive, elements, motor, grip)
    if alone.size:
        elements = _with_friction(elements, alone, step * friction[alone])  # type: ignore[index]
    return GearRows(elements, engaged, damped, friction is not None, alone, free_speed)


def _hold(
    drive: Drivetrain, elements: Elements, motor: MotorMotion, grip: Grip
) -> tuple[Elements, IntArray, FloatArray]:
    """Put springs and play into the rows; leave out gears that hang in their play."""
    zero = drive.zero
    soft = np.isfinite(drive.stiffness)
    stiffness = np.where(soft, grip.slope, np.inf)
    preload = np.where(soft, grip.impulse - grip.slope * grip.end, 0.0)
    alone = meeting_speed(elements, modes_at(elements, zero, zero), zero, zero)
    engaged = np.flatnonzero(grip.held)
    names = Elements.__slots__
    fields = {name: getattr(elements, name)[engaged] for name in names}
    fields |= {"stiffness": stiffness[engaged], "preload": preload[engaged]}
    return Elements(**fields), engaged, np.where(grip.held, 0.0, alone)


def _with_friction(elements: Elements, coordinates: IntArray, level: FloatArray) -> Elements:
    """Return the elements with one more row per coordinate that only rubs."""
    count = len(coordinates)
    rows = np.zeros((count, elements.rows.shape[1]))
    rows[np.arange(count), coordinates] = 1.0
    zero, one = np.zeros(count), np.ones(count)
    added = (rows, zero, zero, zero, one, one, level, zero, np.inf * one, zero)
    pairs = zip(Elements.__slots__, added, strict=True)
    return Elements(*(np.concatenate((getattr(elements, name), more)) for name, more in pairs))
