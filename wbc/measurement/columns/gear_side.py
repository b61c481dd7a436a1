"""On which side of the gear a foreign column stands, and the factor to the side that we name.

With the gear ratio N (rotor turns per turn of the motor's output): psi = phi / N and
motor torque = N rotor torque. `motor` and `joint` are one side here: where a topology D mixes
motors into joints, name the columns of all of them with `weights`.
"""

from __future__ import annotations

from wbc.errors import LogError, unknown_name

SIDES = ("rotor", "motor", "joint")

_OUTPUT_MOTION = (
    "position",
    "velocity",
    "acceleration",
    "target_position",
    "target_velocity",
    "goal_position",
)
_ROTOR_MOTION = ("rotor_position", "rotor_velocity")


def side_factor(side: str, quantity: str, gear_ratio: float, place: str) -> float:
    """Return by what to multiply a value on `side` to get `quantity` of a log.

    Args:
        side: `rotor` (before the reduction), `motor` or `joint` (after it).
        quantity: quantity of the target column.
        gear_ratio: N, not zero.
        place: map file and key, for messages.

    Raises:
        LogError: an unknown side, or a quantity for which a side means nothing.
    """
    if side not in SIDES:
        raise LogError(f"{place}.side: " + unknown_name("side", side, SIDES))
    before = side == "rotor"
    if quantity in _OUTPUT_MOTION:
        return 1.0 / gear_ratio if before else 1.0
    if quantity in _ROTOR_MOTION:
        return 1.0 if before else gear_ratio
    if quantity == "rotor_torque":
        return 1.0 if before else 1.0 / gear_ratio
    if quantity == "motor_torque":
        return gear_ratio if before else 1.0
    raise LogError(
        f"{place}.side: a {quantity} has no side of the gear; leave the key out (use scale for a "
        "plain factor)."
    )
