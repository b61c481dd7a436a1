"""What the solutions of a program ask of the gears, and the rows that limit it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wbc.arrays import BoolArray, FloatArray, IntArray
from wbc.compiled import (
    Count,
    Dense,
    Matrix,
    Nothing,
    Number,
    OutDense,
    OutFlags,
    OutMatrix,
    OutRow,
    OutVector,
    Places,
    Row,
    Vector,
    compiled,
)
from wbc.control.contacts.contact_set import ContactSet
from wbc.control.output_torques import OutputTorques
from wbc.control.program.balance import place_output
from wbc.control.program.rows.inequality_rows import InequalityRows
from wbc.control.program.rows.torque_rows import (
    place_beyond,
    place_directed_rows,
    place_torque_map,
    place_torque_rows,
)
from wbc.fixed_arrays import FixedArrays, FixedTable, array_at


class Judged(NamedTuple):
    """What a solution asks of the gears.

    Attributes:
        output, share: T and what the rotors take themselves (m,) [N m].
        beyond: (m,) gears whose torque by the mesh law is beyond their limits.
    """

    output: FloatArray
    share: FloatArray
    beyond: BoolArray


class GearTorqueRows:
    """Torques of the gears as rows over x = [qdd, f / scale], and what keeps them in limits.

    Attributes:
        map: (m, n), T = map @ x + D' bias_m.
        directed: rows, lower and upper bounds of the program whose directions are searched.
    """

    def __init__(
        self,
        plant: OutputTorques,
        contacts: ContactSet,
        rows: InequalityRows,
        gears: IntArray,
        scale: float,
    ) -> None:
        """Make room.

        Args:
            plant: the dynamics.
            contacts: the active contacts.
            rows: the inequalities of the program.
            gears: numbers of the gears that have a torque limit (g,).
            scale: [N] per unit of force variable.
        """
        self._plant, self._contacts, self._rows = plant, contacts, rows
        self._gears, self._scale = np.ascontiguousarray(gears, dtype=np.int_), scale
        m, n, more = plant.robot.transmission.size, rows.C.shape[1], rows.size + len(gears)
        self.map, self._bias = np.zeros((m, n)), np.zeros(m)
        self.directed = np.zeros((more, n)), np.zeros(more), np.zeros(more)
        self._read: tuple[FloatArray, FloatArray] | None = None
        self._fixed: FixedArrays

    def place_map(self) -> None:
        """Write the map from x to T; call when the terms of a state are known."""
        place_map_fixed(self._memory(), self._scale, int(self._plant.topology is None))

    def limit(self, slopes: FloatArray, lower: FloatArray, upper: FloatArray) -> None:
        """Write the rows of the torque limits for one slope per gear.

        Args:
            slopes: e (m,) in the predicted directions.
            lower, upper: least and greatest N tau_phi (m,) [N m].
        """
        limit_fixed(self._memory(), slopes, lower, upper)

    def direct(
        self,
        slopes: tuple[FloatArray, FloatArray],
        limits: tuple[FloatArray, FloatArray],
        choice: FloatArray,
    ) -> None:
        """Write `directed`: the convex rows of all gears, one half-space of some, other rows.

        Args:
            slopes: e (m,) where T > 0, and where T < 0.
            limits: least and greatest N tau_phi (m,) [N m].
            choice: as for `place_directed_rows`.
        """
        direct_fixed(self._memory(), *slopes, *limits, choice)

    def judged(
        self,
        x: FloatArray,
        slopes: tuple[FloatArray, FloatArray],
        limits: tuple[FloatArray, FloatArray],
    ) -> Judged:
        """Return what x (n,) asks of the gears, other arguments as for `direct`."""
        m = len(self._bias)
        output, share, beyond = np.empty(m), np.empty(m), np.empty(m, dtype=np.bool_)
        given = *slopes, *limits
        judge_fixed(self._memory(), self._scale, x, *given, output, share, beyond)
        return Judged(output, share, beyond)

    def _memory(self) -> IntArray:
        """Return the memory of GEARS, described anew where the plant's has moved."""
        plant, read = self._plant, self._read
        if read is None or plant.mass is not read[0] or plant.bias is not read[1]:
            self._read = plant.mass, plant.bias
            terms = plant.terms(plant.bias, self._contacts.jacobian, self._scale)
            mass, bias, jacobian, _, _, *more = terms
            rows, own = self._rows, (self.map, self._bias, self._gears)
            plain = rows.C, rows.lower, rows.upper
            self._fixed = FixedArrays(
                GEARS,
                (mass, bias, jacobian, *more, *own, *rows.of_torque, *plain, *self.directed),
            )
        return self._fixed.table


GEARS = (
    *(Dense, Row, Matrix, Places, Dense, Dense, Row, OutRow),
    *(OutDense, OutRow, Places, OutMatrix, OutVector, OutVector),
    *(Dense, Row, Row, OutDense, OutRow, OutRow),
)
"""Kinds of the memory of `GearTorqueRows`.

Mass, bias, contacts' jacobian, driven, topology, rotor, rotor_bias and memory of `place_output`;
map, D' bias_m, limited gears; torque rows and their bounds; all rows; the directed rows.
"""


@compiled(Nothing, FixedTable, Number, Count)
def place_map_fixed(memory: IntArray, scale: float, serial: int) -> None:
    """Do as `place_torque_map` does in the memory of GEARS."""
    place_torque_map(
        array_at(memory, 0, Dense),
        array_at(memory, 1, Row),
        array_at(memory, 2, Matrix),
        scale,
        array_at(memory, 3, Places),
        array_at(memory, 4, Dense),
        serial,
        array_at(memory, 8, OutDense),
        array_at(memory, 9, OutRow),
    )


@compiled(Nothing, FixedTable, *[Vector] * 3)
def limit_fixed(memory: IntArray, slopes: FloatArray, lower: FloatArray, upper: FloatArray) -> None:
    """Do as `place_torque_rows` does in the memory of GEARS."""
    place_torque_rows(
        array_at(memory, 8, Dense),
        array_at(memory, 5, Dense),
        array_at(memory, 9, Vector),
        array_at(memory, 6, Vector),
        array_at(memory, 10, Places),
        slopes,
        lower,
        upper,
        array_at(memory, 11, OutMatrix),
        array_at(memory, 12, OutVector),
        array_at(memory, 13, OutVector),
    )


@compiled(Nothing, FixedTable, *[Vector] * 5)
def direct_fixed(
    memory: IntArray,
    positive: FloatArray,
    negative: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    choice: FloatArray,
) -> None:
    """Copy all rows, and do as `place_directed_rows` does in the memory of GEARS."""
    C, low, high = array_at(memory, 14, Dense), array_at(memory, 15, Row), array_at(memory, 16, Row)
    all_C, all_low = array_at(memory, 17, OutDense), array_at(memory, 18, OutRow)
    all_high, limited = array_at(memory, 19, OutRow), array_at(memory, 10, Places)
    size, gears = len(low), len(limited)
    for i in range(gears, size):
        all_low[i], all_high[i] = low[i], high[i]
        for j in range(C.shape[1]):
            all_C[i, j] = C[i, j]
    place_directed_rows(
        array_at(memory, 8, Dense),
        array_at(memory, 5, Dense),
        array_at(memory, 9, Vector),
        array_at(memory, 6, Vector),
        limited,
        positive,
        negative,
        lower,
        upper,
        choice,
        all_C[:gears],
        all_low[:gears],
        all_high[:gears],
        all_C[size:],
        all_low[size:],
        all_high[size:],
    )


@compiled(Nothing, FixedTable, Number, Row, *[Vector] * 4, OutRow, OutRow, OutFlags)
def judge_fixed(
    memory: IntArray,
    scale: float,
    x: FloatArray,
    positive: FloatArray,
    negative: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    output: FloatArray,
    share: FloatArray,
    beyond: BoolArray,
) -> None:
    """Do as `place_output` and `place_beyond` do in the memory of GEARS."""
    place_output(
        array_at(memory, 0, Dense),
        array_at(memory, 1, Row),
        array_at(memory, 2, Matrix),
        scale,
        x,
        array_at(memory, 3, Places),
        array_at(memory, 4, Dense),
        array_at(memory, 5, Dense),
        array_at(memory, 6, Row),
        array_at(memory, 7, OutRow),
        output,
        share,
    )
    place_beyond(output, share, positive, negative, lower, upper, beyond)
