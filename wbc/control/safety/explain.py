"""Why a tick had no solution, found when somebody asks."""

from __future__ import annotations

from wbc.control.command import Command
from wbc.control.safety.conflict import Conflict
from wbc.errors import ControlError


def explain(command: Command) -> str:
    """Return in one sentence why a tick had no solution; empty where nothing is in the way.

    For a program whose constraints contradict one another it names the one that the
    closest-to-feasible motion breaks most, and by how much. It solves a second program, which may
    take a hundred times as long as a tick: ask outside the loop.

    Raises:
        ControlError: this is no command.
    """
    if not isinstance(command, Command):
        raise ControlError(f"explain takes a Command, got {type(command).__name__}.")
    refused = command.refused
    if refused is None:
        return command.message
    return Conflict.of(refused.problem.dense(), refused.names).message
