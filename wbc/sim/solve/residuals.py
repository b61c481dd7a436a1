"""The figures by which a solution says how exact it is."""

from __future__ import annotations

from dataclasses import dataclass, fields


@dataclass(frozen=True, slots=True)
class Residuals:
    """How far a solution is from satisfying the step program, each at its worst row.

    Attributes:
        dynamics: |H (v - v_free) - G' impulse| [N m s].
        law: distance of (w, T) of an element from its law, as a speed [rad/s].
        complementarity: of limits and contact normals, as a speed [m/s].
        cone: |p_t| - mu p_n where positive [N s].
        friction: distance from Coulomb's law of a closed contact, as a speed [m/s].
    """

    dynamics: float = 0.0
    law: float = 0.0
    complementarity: float = 0.0
    cone: float = 0.0
    friction: float = 0.0

    @property
    def worst_speed(self) -> float:
        """Largest of the residuals that are speeds."""
        return max(self.law, self.complementarity, self.friction)


def worst(*several: Residuals) -> Residuals:
    """Return the largest of each residual."""
    return Residuals(*(max(getattr(r, f.name) for r in several) for f in fields(Residuals)))
