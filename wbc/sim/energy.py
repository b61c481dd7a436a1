"""Work and losses of steps, and their balance."""

from __future__ import annotations

from dataclasses import dataclass
from operator import add
from typing import NamedTuple

import numpy as np


class EnergyFlow(NamedTuple):
    """Work in and losses out over some time, each in joule.

    Motor and external work are exact for the impulses and displacements of the step; each loss is
    impulse times the speed at the end of the step, which makes it non-negative, and differs from
    the exact one by O(h^2) per step. That, and the weight that is lifted where an overlap is
    taken back, is the audit's residual.

    Attributes:
        motor: work of the rotor torques.
        external: work of external forces given to the step.
        effects: work of the robot's effects that are no friction (springs, drag, ripple).
        reloaded: what bent bristles gained because the load on them changed.
        bent: change of what bristles hold (presliding).
        mesh: lost in the meshes.
        rotor_friction: lost in rotor bearings and motors.
        gear_damping: lost between mesh and joint, where gears are compliant or have play.
        joint_friction: lost in joint friction.
        bristles: lost in friction that builds up (presliding).
        contact: lost in sliding contacts, and where one closes without an impact.
        impact_mesh: lost in the meshes during impacts.
        impact: lost in contacts and joint limits during impacts.
    """

    motor: float = 0.0
    external: float = 0.0
    effects: float = 0.0
    reloaded: float = 0.0
    bent: float = 0.0
    mesh: float = 0.0
    rotor_friction: float = 0.0
    gear_damping: float = 0.0
    joint_friction: float = 0.0
    bristles: float = 0.0
    contact: float = 0.0
    impact_mesh: float = 0.0
    impact: float = 0.0

    def __add__(self, other: EnergyFlow) -> EnergyFlow:  # type: ignore[override]
        """Return the sum of two flows."""
        return EnergyFlow._make(map(add, self, other))

    @property
    def work(self) -> float:
        """All work done on the robot, and on what is bent in it."""
        return self.motor + self.external + self.effects + self.reloaded

    @property
    def losses(self) -> dict[str, float]:
        """Every loss by its cause."""
        return dict(zip(self._fields[_LOSSES:], self[_LOSSES:], strict=True))

    @property
    def lost(self) -> float:
        """Sum of all losses."""
        return sum(self[_LOSSES:])


_LOSSES = EnergyFlow._fields.index("mesh")


@dataclass(frozen=True, slots=True)
class EnergyAudit:
    """Work in = change of mechanical energy + losses + residual.

    Attributes:
        flow: work and losses of the run.
        stored: change of kinetic plus potential energy of links, rotors and gear springs [J].
        joule_heat: of the windings, R (tau / k_t)^2 over time [J]; NaN where a motor's constants
            are unknown. It comes from the supply beside the motors' work and is no part of the
            balance above.
    """

    flow: EnergyFlow
    stored: float
    joule_heat: float = np.nan

    @property
    def residual(self) -> float:
        """What the books do not close by [J]; O(dt) by the order of the time step."""
        return self.flow.work - self.stored - self.flow.bent - self.flow.lost

    @property
    def electric(self) -> float:
        """What the supply gives, less what it gets back: motor work plus Joule heat [J]."""
        return self.flow.motor + self.joule_heat

    def __str__(self) -> str:
        """Return the books as a table."""
        flow = self.flow
        bristles = ("stored in bristles", flow.bent), ("bristles loaded anew", flow.reloaded)
        rows = [
            ("motor work", self.flow.motor),
            ("external work", self.flow.external),
            ("work of effects", self.flow.effects),
            ("stored", self.stored),
            *(bristles if any(size for _, size in bristles) else ()),
            *((f"lost: {name.replace('_', ' ')}", v) for name, v in self.flow.losses.items()),
            ("residual", self.residual),
        ]
        if np.isfinite(self.joule_heat):
            rows.append(("beside: Joule heat", self.joule_heat))
        return "\n".join(f"{name:24s}{value:14.6f} J" for name, value in rows)
