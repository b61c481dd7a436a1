"""What force a contact should carry."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from wbc.arrays import FloatArray
from wbc.errors import ControlError


@final
@dataclass(frozen=True, eq=False, kw_only=True)
class ContactForceTask:
    """weight/2 |f - f_ref|^2 on the force of one contact.

    `Reference.position` is f_ref: (3,) [N] in world axes for a point, (6,) [N, N m] in its frame
    for a surface. Without a reference, or while the contact is not active, the task is idle.

    Attributes:
        name: how references call it.
        contact: name of the contact.
        weight: >= 0, one number or one per component [1/N^2].
    """

    name: str
    contact: str
    weight: float | FloatArray = 1e-4

    def __post_init__(self) -> None:
        """Check the weight."""
        weight = np.asarray(self.weight, dtype=np.float64)
        if not np.isfinite(weight).all() or (weight < 0.0).any():
            raise ControlError(f"task '{self.name}': weight must be >= 0, got {self.weight}.")
