"""How the whole robot should move along."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import final

from wbc.control.tasks.axes import axis_rows
from wbc.control.tasks.momentum.momentum_task import MomentumTask


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class LinearMomentumTask(MomentumTask):
    """Linear momentum of the whole robot along some world axes [kg m/s].

    Attributes:
        axes: which of "xyz" belong to the task.
    """

    name: str = "linear_momentum"
    axes: str = "xyz"
    _rows: slice = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the axes."""
        super().__post_init__()
        object.__setattr__(self, "_rows", axis_rows(self.axes, self.name))

    def rows(self) -> slice:
        """Return the linear rows of the axes."""
        return self._rows
