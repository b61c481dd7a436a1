"""How the rows of a part or of an impact end: every row on its law, with coupled rotors.

The inertial coupling of rotors and housings is in no law of a row: rounds take it from the last
iterate.
"""

from __future__ import annotations

import numpy as np

from wbc.compiled import Dense, OutRow, Row, inner
from wbc.mechanics.laws import own_speed
from wbc.mechanics.linear import add_times, copy_to, dot, rest_of_way, solve_inertia
from wbc.mechanics.memory import copied_row, copied_table
from wbc.mechanics.newton import (
    PASSIVE,
    SEVERAL,
    UNSOLVED,
    residual,
    solve_system,
    speeds_at,
)
from wbc.mechanics.rows import RowSystem
from wbc.sim.step.part_rows import PartRows, part_system, rotor_brings
from wbc.sim.step.self_locking import solve_rows
from wbc.sim.step.tables import Opened

NO_INERTIA = SEVERAL + 1
"""H_l is not positive definite."""
USED, WAY, MISSED = range(3)
"""Of a solution: linear systems solved, what found it, and the speed by which a passive one misses
the laws, else zero."""

_ROUNDS = 200
_COUPLING_TOLERANCE = 1e-13


@inner
def lag_coupling(
    plant: Opened,
    rows: PartRows,
    system: RowSystem,
    speed: Row,
    last: Row,
    laws: Dense,
    shifted: OutRow,
) -> None:
    """Put the inertial coupling of rotors and housings at a last iterate into the rows.

    The rotor's momentum is I_r (phi_dot + a'J_omega v), so a change of v asks the impulse N C dv of
    the rotor (at the motor output, C = I_r a'J_omega) and a change of its spin asks C' N dw of the
    links. Both are taken from the last iterate; the iteration contracts by about the share of rotor
    in link inertia.

    Args:
        plant: with `coupling` and `gyration`.
        rows: of the part.
        system: of the rows, whose free speeds are changed.
        speed: v (nv,) before.
        last: v (nv,) of the last iterate.
        laws: (m, 9) without coupling, over a step; those of the system are changed.
        shifted: v (nv,) without the rows, to write.
    """
    gears, n, m, step = plant.gears, len(speed), len(plant.gears.rows), rows.step
    for c in range(n):
        shifted[c] = -step * gears.gyration[0, c]
    for i in range(m):
        turned, taken = 0.0, step * gears.gyration[0, n + i]
        for c in range(n):
            turned += gears.rows[i, c] * (last[c] - speed[c])
            taken += gears.coupling[i, c] * (last[c] - speed[c])
        add_times(-turned, gears.coupling[i], shifted)
        if step > 0.0:
            system.laws[i, 0], system.laws[i, 1] = laws[i, 0] - taken, laws[i, 1] - taken
        elif not gears.yields[i]:
            brought = gears.inertia[i] * rows.motor[i] - taken
            rotor_brings(gears, i, brought, system.laws[i])
    solve_inertia(rows.lower, shifted)
    add_times(1.0, rows.free, shifted)
    for i in range(len(system.free)):
        system.free[i] = dot(shifted, rows.matrix[i])


@inner
def settles(after: Row, last: OutRow) -> float:
    """Return by how much a round has changed v (nv,), zero where it is rounding."""
    moved, largest = 0.0, 0.0
    for c in range(len(after)):
        moved = max(moved, abs(after[c] - last[c]))
        largest = max(largest, abs(last[c]))
    return 0.0 if moved <= _COUPLING_TOLERANCE * (1.0 + largest) else moved


@inner
def solve_part(plant: Opened, rows: PartRows, speed: Row, work: float) -> int:
    """Write how the rows of a part end, with every row on its law.

    Args:
        plant: what moves; `after` and `work` of its end are written.
        rows: of the part; laws and free velocity are those of the solution afterwards.
        speed: v (nv,) before.
        work: share of what `solve_system` may do in an impact.

    Returns:
        what found it; UNSOLVED or more where nothing did.
    """
    gears, heap = plant.gears, plant.heap
    system, coupled = part_system(plant, rows), len(gears.coupling) > 0
    laws, last, shifted = system.laws, copied_row(heap, speed), rows.free
    used, way, missed = 0, 0, 0.0
    impulse, after, work_of = rows.impulse, plant.end.after, plant.end.work
    if coupled:
        laws, shifted = copied_table(heap, laws), copied_row(heap, rows.free)
    begun = heap.used[0]
    for _ in range(_ROUNDS if coupled else 1):
        heap.used[0] = begun
        if coupled:
            lag_coupling(plant, rows, system, speed, last, laws, shifted)
        if coupled or gears.loose:
            more, way = solve_system(system, rows.start, work, impulse)
        else:
            more, way = solve_rows(system, rows.start, work, impulse)
        used += more
        speeds_at(system, impulse, after, rows.speed)
        rest_of_way(rows.lower, after)
        add_times(1.0, shifted, after)
        if way >= UNSOLVED or not coupled:
            break
        copy_to(impulse, rows.start)
        missed = settles(after, last)
        copy_to(after, last)
        if missed == 0.0:
            break
    if way < UNSOLVED and not np.isfinite(np.sum(after)):
        way = UNSOLVED
    if missed > 0.0 and way < UNSOLVED:  # the rounds end before all is settled
        way, missed = PASSIVE, max(missed, system.tolerance)
    if way == PASSIVE or len(rows.flanks) > 0:
        off = residual(system, impulse)  # springs of flanks are those of the solution then
        missed = max(missed, off if way == PASSIVE else 0.0)
    for i in range(len(gears.rows) if len(rows.flanks) > 0 else 0):
        if gears.yields[i]:
            own = own_speed(system.laws[i], system.slope[i], impulse[i], rows.speed[i])
            rows.end[i] = own - rows.speed[i]
    copy_to(shifted, rows.free)
    work_of[USED], work_of[WAY], work_of[MISSED] = used, way, missed
    return way
