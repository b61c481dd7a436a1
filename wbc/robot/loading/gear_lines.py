"""Lines of a robot.toml that a message asks for."""

from __future__ import annotations

from wbc.robot.loading.description import GEAR_UNITS


def state_gear(joint: str, *keys: str) -> str:
    """Return how to state numbers of a gear, with the lines to copy.

    The lines stand below the sentence, indented; what follows them belongs on a new line.

    Args:
        joint: whose gear.
        keys: of [gears.JOINT], see docs/diagnosis/describe-your-robot.md.
    """
    lines = [
        f'{key} = {{ value = VALUE, unit = "{GEAR_UNITS[key]}", source = "data sheet" }}'
        for key in keys
    ]
    return (
        f"put the number in place of VALUE, below [gears.{joint}] in robot.toml:\n    "
        + "\n    ".join(lines)
    )
