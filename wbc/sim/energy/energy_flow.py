"""Where the energy of a step went."""

from __future__ import annotations

from dataclasses import dataclass, fields


@dataclass(frozen=True, slots=True)
class EnergyFlow:
    """Work in and losses out over some time, each in joule.

    Motor and external work are exact for the impulses and displacements of the step; each loss is
    impulse times the speed at the end of the step, which makes it non-negative, and differs from
    the exact one by O(h^2) per step. That, and the weight that is lifted where an overlap is
    taken back, is the audit's residual.

    Attributes:
        motor: work of the rotor torques.
        external: work of external forces given to the step.
        effects: work of the robot's effects that are no friction (springs, drag, ripple).
        ground: work of ground that moves, impacts included.
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
    ground: float = 0.0
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

    def __add__(self, other: EnergyFlow) -> EnergyFlow:
        """Return the sum of two flows."""
        names = (f.name for f in fields(self))
        return EnergyFlow(*(getattr(self, name) + getattr(other, name) for name in names))

    @property
    def work(self) -> float:
        """All work done on the robot, and on what is bent in it."""
        return self.motor + self.external + self.effects + self.ground + self.reloaded

    @property
    def losses(self) -> dict[str, float]:
        """Every loss by its cause."""
        names = [f.name for f in fields(self)]
        names = names[names.index("mesh") :]
        return {name: float(getattr(self, name)) for name in names}

    @property
    def lost(self) -> float:
        """Sum of all losses."""
        return sum(self.losses.values())
