"""How the whole robot should turn about its centre of mass."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import final

from wbc.control.tasks.axes import axis_rows
from wbc.control.tasks.momentum.momentum_task import MomentumTask


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class AngularMomentumTask(MomentumTask):
    """Angular momentum about the centre of mass along some world axes [N m s].

    Attributes:
        axes: which of "xyz" belong to the task, "y" for a planar robot.
    """

    name: str = "angular_momentum"
    axes: str = "xyz"
    _rows: slice = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the axes."""
        super().__post_init__()
        rows = axis_rows(self.axes, self.name)
        object.__setattr__(self, "_rows", slice(rows.start + 3, rows.stop + 3, rows.step))

    def rows(self) -> slice:
        """Return the angular rows of the axes."""
        return self._rows
