"""What counts as solved: a row that is far from its bound must not hide what the others miss."""

from __future__ import annotations

import numpy as np

from wbc.sim import Elements, StepProgram, Unilateral, solve_program

_ROWS = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -0.6, 0.8]])
_FREE = np.array([0.1, 8e-4, 1.0])
"""All three barriers open when nothing holds them."""
_TARGETS = np.array([-1e7, 0.0, 0.0])
"""The first is kept ahead of its closing in a part of 1e-10 s: it may close at 1e7 rad/s."""
_BEFORE = np.array([0.0, 0.0, 1.0])
"""The third was pressed in the part before, and pushed the robot at the second."""


def test_a_contact_that_opens_does_not_pull_beside_a_barrier_that_is_kept() -> None:
    none, empty = np.zeros(0), np.zeros((0, 3))
    elements = Elements(empty, *[none] * 9)
    unilateral = Unilateral(_ROWS[:1], _ROWS[1:], empty, np.zeros(2), _TARGETS)
    program = StepProgram(np.eye(3), _FREE, elements, unilateral)
    assert solve_program(program, _BEFORE).impulse.min() >= 0.0
