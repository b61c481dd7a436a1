"""What a tick starts from."""

from __future__ import annotations

from enum import Enum


class WarmStart(Enum):
    """What a tick takes over from the last one.

    ACTIVE_SET tries the constraints that bound the last solution, in one small linear system whose
    solution is taken if it fulfils every condition of optimality; the solver is asked otherwise.
    SOLVER always asks the solver, which starts from its own last solution where it can.
    """

    ACTIVE_SET = "active_set"
    SOLVER = "solver"
