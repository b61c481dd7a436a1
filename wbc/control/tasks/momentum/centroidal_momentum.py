"""How the whole robot should move along and turn about its centre of mass."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from wbc.control.tasks.momentum.momentum_task import MomentumTask

_ALL = slice(0, 6)


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class CentroidalMomentumTask(MomentumTask):
    """The whole momentum about the centre of mass, linear over angular [kg m/s, N m s]."""

    name: str = "centroidal_momentum"

    def rows(self) -> slice:
        """Return all six rows."""
        return _ALL
