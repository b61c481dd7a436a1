"""Efforts as rows on the variables of the contact-force program."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.arrays import FloatArray
from wbc.control.efforts import Effort
from wbc.control.output_torques import OutputTorques


class EffortCost:
    """1/2 |rows x - right|^2, a row for every gear and effort, of root weight (slope T + share).

    Attributes:
        rows: (k, n).
        right: (k,).
    """

    def __init__(
        self, efforts: Sequence[Effort], plant: OutputTorques, rows: FloatArray, right: FloatArray
    ) -> None:
        """Take the efforts and the memory for their rows (k, n), (k,)."""
        self._efforts, self._plant, self.rows, self.right = tuple(efforts), plant, rows, right
        self._size = plant.robot.transmission.size

    def fill(
        self, torque_map: FloatArray, slopes: FloatArray, speed: FloatArray, last: FloatArray
    ) -> None:
        """Write the rows for one slope per gear.

        Args:
            torque_map: (m, n), T = torque_map @ x + D' bias_m.
            slopes: e (m,) in the predicted directions.
            speed: expected dpsi (m,) [rad/s].
            last: T (m,) of the last tick [N m].
        """
        plant, m = self._plant, self._size
        nv = plant.rotor.shape[1]
        for place, effort in enumerate(self._efforts):
            cost = effort.cost(plant.robot, slopes, speed, last)
            where = slice(place * m, (place + 1) * m)
            root, rows = np.sqrt(cost.weight), self.rows[where]
            scale = root * cost.slope
            np.multiply(torque_map, scale[:, None], out=rows)
            offset = scale * plant.output_bias
            if cost.rotor:
                rows[:, :nv] += (cost.rotor * root)[:, None] * plant.rotor
                offset += cost.rotor * root * plant.rotor_bias
            np.negative(offset, out=self.right[where])
