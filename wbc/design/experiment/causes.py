"""Causes that an experiment is about: how they are written, which a motion tells, their numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects import effect_class
from wbc.errors import DesignError
from wbc.robot import Effect, Parameter, Robot

Cause = tuple[Effect, ...]
"""Effects that act together; often one."""


def parse_cause(text: str, robot: Robot) -> Cause:
    """Return the cause of `EFFECT@PLACE[:PARAMETER=VALUE,...]`, several joined by `+`.

    Parameters that are left out lie one typical size away from where the effect is not there.

    Raises:
        DesignError: text of another form, or an effect that acts through a soft gear.
        EffectError: an unknown effect, place or parameter.
    """
    return tuple(_effect(part, robot) for part in text.split("+"))


def _effect(text: str, robot: Robot) -> Effect:
    head, _, tail = text.partition(":")
    name, at, where = head.strip().partition("@")
    if not at or not where:
        raise DesignError(f"--between '{text}': use EFFECT@PLACE or EFFECT@PLACE:PARAMETER=VALUE.")
    given: dict[str, float] = {}
    for item in filter(None, tail.split(",")):
        key, _, value = item.partition("=")
        try:
            given[key.strip()] = float(value)
        except ValueError as cause:
            raise DesignError(f"--between '{text}': '{item}' is not PARAMETER=VALUE.") from cause
    kind = effect_class(name)
    typical = typical_values(name, kind.null_values(robot, where))
    effect = kind.at(where, {**typical, **given})
    effect.check_place(robot)
    require_predictable(effect, robot)
    return effect


def typical_values(name: str, null: Mapping[str, float]) -> dict[str, float]:
    """Return the parameters of an effect one typical size away from where it is not there."""
    values = dict(null)
    for parameter in effect_class(name).parameters:
        up = values[parameter.name] + parameter.scale
        inside = up <= parameter.high
        values[parameter.name] = up if inside else values[parameter.name] - parameter.scale
    return values


def require_predictable(effect: Effect, robot: Robot) -> None:
    """Check that the torque of an effect follows from a planned motion.

    Raises:
        DesignError: it does not; a link behind a soft gear follows no plan, and a motor at its
            limit does not either.
    """
    if "drive" in effect.acts_by and "drive_inverse" not in effect.acts_by:
        raise DesignError(
            f"'{effect.name}' shows only where a motor cannot follow, which a planned motion "
            "avoids. Leave it out of --between."
        )
    gears = effect.change(robot).transmission
    if np.isfinite(gears.stiffness).any() or np.any(gears.backlash > 0.0):
        raise DesignError(
            f"'{effect.name}' is a soft or loose gear: its link moves as it likes, so that a "
            "planned motion of the motors does not tell its torque. Leave it out of --between."
        )


def parameter_names(cause: Cause) -> tuple[tuple[Effect, Parameter], ...]:
    """Return effect and parameter of every number of a cause, in the order of `widths`."""
    return tuple((cause[owner], parameter) for owner, parameter in cause_parameters(cause))


def cause_parameters(cause: Cause) -> list[tuple[int, Parameter]]:
    """Return every number of a cause, with the place of its effect in the cause."""
    return [(k, parameter) for k, effect in enumerate(cause) for parameter in effect.parameters]


def cause_values(cause: Cause) -> FloatArray:
    """Return (p,) the numbers of a cause, in the order of `cause_parameters`."""
    return np.array([cause[k].values[parameter.name] for k, parameter in cause_parameters(cause)])


def with_cause_values(cause: Cause, values: Sequence[float] | FloatArray) -> Cause:
    """Return a cause with other numbers (p,), in the order of `cause_parameters`."""
    parts: list[dict[str, float]] = [{} for _ in cause]
    for (k, parameter), value in zip(cause_parameters(cause), values, strict=True):
        parts[k][parameter.name] = float(value)
    return tuple(effect.with_values(part) for effect, part in zip(cause, parts, strict=True))
