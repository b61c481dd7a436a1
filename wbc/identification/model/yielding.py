"""Which effects let links stray from their motors, and how such links must be followed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from wbc.effects.yielding_gear import YieldingGear
from wbc.robot import Effect


def deflects(effect: Effect | type[Effect]) -> bool:
    """Whether the link behind the effect's gear moves on its own, so that it must be simulated."""
    kind = effect if isinstance(effect, type) else type(effect)
    return kind.deflection is not Effect.deflection or kind.spring is not Effect.spring


def some_deflect(effects: Iterable[Effect]) -> bool:
    """Whether a link behind one of the effects' gears must be simulated."""
    return any(deflects(effect) for effect in effects)


def loose(effects: Iterable[Effect]) -> bool:
    """Whether a link behind one of the effects' gears bounces."""
    return any(deflects(effect) and effect.spring() is None for effect in effects)


def strike_together(effects: Sequence[Effect]) -> bool:
    """Whether several links move behind flanks, one gear in front of each."""
    gears = [effect for effect in effects if isinstance(effect, YieldingGear)]
    others = any(deflects(e) and not isinstance(e, YieldingGear) for e in effects)
    return loose(gears) and not others and 1 < len({gear.where for gear in gears}) == len(gears)
