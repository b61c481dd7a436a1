"""What the parts of a tick take of its budget: counted work, no clock."""

from __future__ import annotations

from math import ceil

UNIT = 8000
"""Multiplications in a unit of the budget: a usual step on a quadruped's program."""

# Measured on one core of an Intel Xeon in hostile ticks (processor time, least of repeats): writing
# down a program and checking its solution takes 30 to 40 us on Solo12, beside 1.5 to 2 us a unit.
PROGRAM = 20
"""Units that writing down a program takes, and checking its solution."""

ROUNDS = 4
"""Systems that are solved at most to correct the rows taken as binding."""

# A system takes 4.7 us on the planar leg (9 rows), 13 us on Solo12 (34) and 18 us on Talos (40).
_CALL = 19000


def units(work: int) -> int:
    """Return the units of the budget that some multiplications take."""
    return ceil(work / UNIT)


# ProxQP, with a fourth of a microsecond for 1000 multiplications: an iteration takes 5.5 us with 12
# variables and equalities (planar leg), 22 us with 48 (Solo12) and 38 us with 66 (Talos).
_ITERATION, _OF_PAIR = 14000, 30


def foreign_iterations(allowed: float, n: int, equalities: int) -> int:
    """Return how many iterations of another solver a part of the budget pays for, at least one.

    Args:
        allowed: units.
        n, equalities: size of the program.
    """
    work = _ITERATION + _OF_PAIR * (n + equalities) ** 2
    return max(int(allowed * UNIT / work), 1)


def overshoot(n: int, rows: int) -> int:
    """Return how far a tick may go beyond its budget.

    A program that starts just below it may be written down, and settled before and after its
    climb: the rows that bind are corrected up to `ROUNDS` times each.
    """
    return PROGRAM + 2 * units(ROUNDS * system_work(n, rows))


def system_work(n: int, rows: int) -> int:
    """Return what solving with the rows taken as binding takes, in multiplications.

    Args:
        n: variables.
        rows: of the program, to which a third of the variables is added as bounds that bind.
    """
    size = rows + n // 3
    return _CALL + size**2 * n // 2 + size**3 // 6 + 4 * size * (size + n)
