"""An impact: the jump of the velocities when points hit the ground."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wbc.arrays import FloatArray
from wbc.sim.laws.drivetrain import Drivetrain
from wbc.sim.laws.elements import Elements
from wbc.sim.solve.solution import StepSolution

_STOPPED = 1e-9


@dataclass(frozen=True, eq=False)
class Impact:
    """One impact.

    Attributes:
        time: [s].
        before: v (nv,) just before.
        after: v (nv,) just after.
        contact_impulse: (k, 3) [N s] on the robot, world axes.
        mesh_loss: energy lost in the gears [J].
        contact_loss: energy lost in the contacts [J].
        restitution: normal speed after over before; the plant's, or as much less as friction
            would otherwise have made energy.
        details: returns the solution of the impact's program; called when asked for.
        ground_work: energy that a moving ground gave [J].
    """

    time: float
    before: FloatArray
    after: FloatArray
    contact_impulse: FloatArray
    mesh_loss: float
    contact_loss: float
    restitution: float
    details: Callable[[], StepSolution]
    ground_work: float = 0.0

    @cached_property
    def solution(self) -> StepSolution:
        """Of the impact's program."""
        return self.details()


def impact_elements(drive: Drivetrain, before: FloatArray, coupled: FloatArray) -> Elements:
    """Return the laws of the rigid gears along the velocity path of an impact.

    Without motor impulse each gear presents eta_f N^2 I_r while its speed falls towards zero and
    N^2 I_r / eta_b while it grows, from `before` on. What the rotor brings along when it ends up
    turning the other way is therefore eta_f eta_b M w_before, where a step, which only knows its
    end, takes all of M w_before. Coulomb levels and springs are forces and give no impulse.

    Args:
        drive: the gears; loose ones pass no impulse and have no row.
        before: (m,) speeds of the motor outputs before the impact.
        coupled: (m,) impulse that inertial coupling gives the rotors, at the motor outputs.
    """
    rigid = ~drive.loose
    inertia, backward = drive.inertia[rigid], drive.backward[rigid]
    brought = inertia * before[rigid]
    kept = drive.forward[rigid] * np.maximum(backward, 0.0) * brought
    zero = np.zeros(int(rigid.sum()))
    return Elements(
        rows=drive.rows[rigid],
        up=np.where(brought > 0.0, brought, kept) + coupled[rigid],
        down=np.where(brought < 0.0, brought, kept) + coupled[rigid],
        inertia=inertia,
        forward=drive.forward[rigid],
        backward=backward,
        friction=zero,
        damping=zero,
        stiffness=np.full(len(zero), np.inf),
        preload=zero,
    )


def impact_mesh_loss(
    drive: Drivetrain, before: FloatArray, after: FloatArray, net: FloatArray
) -> float:
    """Return the energy lost in the meshes of the rigid gears along the straight path [J].

    It is what the rotors and their coupling to the housings give and the links do not get: with
    the mesh impulse T and the coupling's C on the rotor, (M (w - w') + C - T) (w + w')/2 per gear.
    A gear that reverses has a bent path: its rotor gives all it has, of which (1 - eta_f) is lost,
    then takes new energy E from the mesh, which costs (1/eta_b - 1) E. A self-locking gear that
    stops carries any more impulse at rest, where it does no work: driving it has lost
    (1 - eta_f) of the rotor's energy, driven it all of that and 1/|eta_b| times as much again.

    Args:
        drive: the gears.
        before: w (r,) of the rigid gears' motor outputs.
        after: w' (r,).
        net: C - T (r,) [N m s].
    """
    rigid = ~drive.loose
    inertia = drive.inertia[rigid]
    given, taken = 0.5 * inertia * before**2, 0.5 * inertia * after**2
    straight = given - taken + 0.5 * net * (before + after)
    eta_b = np.where(drive.backward[rigid] > 0.0, drive.backward[rigid], 1.0)
    bent = (1.0 - drive.forward[rigid]) * given + (1.0 / eta_b - 1.0) * taken
    lost = np.where(before * after < 0.0, bent, straight)
    locked = drive.backward[rigid] < 0.0
    if locked.any():
        driving = net * before < 0.0
        again = 1.0 - 1.0 / np.where(locked, drive.backward[rigid], -1.0)
        stopped = given * np.where(driving, 1.0 - drive.forward[rigid], again)
        lost = np.where(locked & (np.abs(after) <= _STOPPED * np.abs(before)), stopped, lost)
    return float(lost.sum())
