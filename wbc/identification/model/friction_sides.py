"""On which side of a gear that yields its joint's friction rubs: every fit tries both."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from wbc.effects.gear.yielding_gear import Side, YieldingGear
from wbc.identification.model.fit import Fit
from wbc.identification.model.link_friction import rubbing_effects
from wbc.robot import Effect, Motion, Robot

# Steps of a fit after which the sides are compared. With dry friction behind a gear that begins a
# third too small, a fit on its side leaves 276 floors^2 after two steps, 253 after three, 3.1 after
# five and 0.88 at its end; on the wrong side 185.
_TRIED = 5


def best_sides(
    robot: Robot,
    effects: Sequence[Effect],
    motion: Motion,
    fit: Callable[[Sequence[Effect], int], Fit],
    iterations: int,
) -> Fit:
    """Return the fit with friction on the sides that leave least.

    It depends on the arguments alone: no fit knows what others found.

    Args:
        robot: that lacks the effects.
        effects: start values.
        motion: of one log.
        fit: of effects whose sides are given, in so many steps at most.
        iterations: at most this many steps.
    """
    whole = robot.with_effects(*effects)
    found: Fit | None = None
    for k, gear in enumerate(effects):
        if not isinstance(gear, YieldingGear):
            continue
        if not rubbing_effects(whole, gear.where, motion):
            found = found if gear.friction_side == "either" else None
            effects = _with_side(effects, k, "either")
            continue
        fits = [fit(_with_side(effects, k, side), _TRIED) for side in _sides(gear)]
        found = min(fits, key=lambda trial: trial.error)
        effects = found.effects
    return found if found is not None and found.settled else fit(effects, iterations)


def _sides(gear: YieldingGear) -> tuple[Side, Side]:
    """Return the sides to try, the one of the start first: it wins a tie."""
    return ("motor", "link") if gear.friction_side == "motor" else ("link", "motor")


def _with_side(effects: Sequence[Effect], k: int, side: Side) -> tuple[Effect, ...]:
    gear = effects[k]
    own = gear.with_friction_at(side) if isinstance(gear, YieldingGear) else gear
    return (*effects[:k], own, *effects[k + 1 :])
