"""Equalities of a tick, compiled: the balance of what no motor drives, and contacts at rest."""

from __future__ import annotations

from wbc.compiled import compiled, inner
from wbc.control.memory import COUNT, NUMBER, ProgramMemory
from wbc.control.qp.active_set import place_row
from wbc.control.tree import fill_state_rows
from wbc.mechanics.linear import dot


@compiled(counted=False)
def rest_contacts(program: ProgramMemory) -> None:
    """Write J of the contacts, and what brings them to rest: J qdd = -damping J v - dJ/dt v."""
    contacts, velocity = program.contacts, program.velocity
    fill_state_rows(program.tree, contacts.rows, program.numbers[NUMBER.mass])
    jacobian, drift = contacts.rows.jacobian, contacts.rows.drift
    for i in range(len(drift)):
        contacts.target[i] = -contacts.damping[i] * dot(jacobian[i], velocity) - drift[i]


@inner
def place_balance(program: ProgramMemory) -> float:
    """Write (M qdd - scale J' f)_undriven = -bias_undriven, and the rows of contacts below.

    Returns:
        the sum of the sizes of what stands on the right.
    """
    gears, solver, at, total = program.gears, program.solver, program.counts[COUNT.cost], 0.0
    jacobian, target, nv = program.contacts.rows.jacobian, program.contacts.target, len(gears.bias)
    for row in program.undriven:
        place_row(solver, at, gears.mass[row], -gears.bias[row], 0.0)
        for k in range(len(jacobian)):
            solver.rows[at, nv + k] = -program.numbers[NUMBER.scale] * jacobian[k, row]
        at, total = at + 1, total + abs(gears.bias[row])
    for k in range(len(jacobian)):
        place_row(solver, at + k, jacobian[k], target[k], 0.0)
        total += abs(target[k])
    return total
