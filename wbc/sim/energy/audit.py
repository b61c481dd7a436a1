"""The energy audit of a run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.sim.energy.energy_flow import EnergyFlow


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
        rows = [
            ("motor work", self.flow.motor),
            ("external work", self.flow.external),
            ("work of effects", self.flow.effects),
            *([("work of the ground", self.flow.ground)] if self.flow.ground else []),
            ("stored", self.stored),
            *_bristles(self.flow),
            *((f"lost: {name.replace('_', ' ')}", v) for name, v in self.flow.losses.items()),
            ("residual", self.residual),
        ]
        if np.isfinite(self.joule_heat):
            rows.append(("beside: Joule heat", self.joule_heat))
        return "\n".join(f"{name:24s}{value:14.6f} J" for name, value in rows)


def _bristles(flow: EnergyFlow) -> list[tuple[str, float]]:
    """Return the lines of the store of bristles, none where nothing bent."""
    if flow.bent == flow.reloaded == 0.0:
        return []
    return [("stored in bristles", flow.bent), ("bristles loaded anew", flow.reloaded)]
