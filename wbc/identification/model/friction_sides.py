"""On which side of a gear that yields its joint's friction rubs: fits choose."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from wbc.effects.yielding_gear import Side, YieldingGear
from wbc.identification.model.fit import ITERATIONS, Fit
from wbc.identification.model.link_friction import rubbing_effects
from wbc.robot import Effect, Motion, Robot

_TRIED = 3  # steps of a fit after which the sides are compared
_CLEAR = 1.5  # times the error of the better side, from which on the other is not tried again

_Key = tuple[str, str, tuple[str, ...]]


@dataclass(frozen=True, eq=False)
class FrictionSides:
    """The sides that fits chose where it was clear, by gear and by what rubs there.

    Attributes:
        robot: that lacks the effects.
        motion: of one log.
    """

    robot: Robot
    motion: Motion
    _chosen: dict[_Key, Side] = field(default_factory=dict)

    def best(self, effects: Sequence[Effect], fit: Callable[[Sequence[Effect], int], Fit]) -> Fit:
        """Return the fit with friction on the sides that leave least.

        Args:
            effects: start values.
            fit: of effects whose sides are given, in so many steps at most.
        """
        whole = self.robot.with_effects(*effects)
        found: Fit | None = None
        for k, gear in enumerate(effects):
            if not isinstance(gear, YieldingGear):
                continue
            rubbing = rubbing_effects(whole, gear.where, self.motion)
            key = gear.where, gear.name, tuple(sorted(effect.name for effect in rubbing))
            side = self._chosen.get(key) if rubbing else "either"
            if side is not None:
                found = found if side == gear.friction_side else None
                effects = _with_side(effects, k, side)
                continue
            fits = {side: fit(_with_side(effects, k, side), _TRIED) for side in _sides(gear)}
            better, worse = sorted(fits, key=lambda side: fits[side].error)
            if fits[worse].error > _CLEAR * fits[better].error:
                self._chosen[key] = better
            found = fits[better]
            effects = found.effects
        return found if found is not None and found.settled else fit(effects, ITERATIONS)


def _sides(gear: YieldingGear) -> tuple[Side, Side]:
    """Return the sides to try, the one chosen in a smaller model first: it wins a tie."""
    return ("motor", "link") if gear.friction_side == "motor" else ("link", "motor")


def _with_side(effects: Sequence[Effect], k: int, side: Side) -> tuple[Effect, ...]:
    gear = effects[k]
    own = gear.with_friction_at(side) if isinstance(gear, YieldingGear) else gear
    return (*effects[:k], own, *effects[k + 1 :])
