"""Which effects let links stray from their motors, and behind which gears they do."""

from __future__ import annotations

from collections.abc import Iterable

from wbc.effects.gear.yielding_gear import YieldingGear
from wbc.robot import Effect, Robot
from wbc.transmission import Flanks

_PLAY = 0.25  # of what flanks wind up by, below which they are a spring


def deflects(effect: Effect | type[Effect]) -> bool:
    """Whether the link behind the effect's gear moves on its own, so that it must be simulated."""
    return issubclass(effect if isinstance(effect, type) else type(effect), YieldingGear)


def some_deflect(effects: Iterable[Effect]) -> bool:
    """Whether a link behind one of the effects' gears must be simulated."""
    return any(deflects(effect) for effect in effects)


def loose(effects: Iterable[Effect]) -> bool:
    """Whether a link behind one of the effects' gears bounces."""
    return any(isinstance(effect, YieldingGear) and effect.has_play for effect in effects)


def plays(flanks: Flanks, load: float) -> bool:
    """Whether play counts beside what its flanks wind up by under a load [N m]."""
    return flanks.play * flanks.stiffness > _PLAY * load


def yielding_gears(robot: Robot) -> dict[str, Flanks]:
    """Return the gears of a robot, by joint, behind which its effects let the link stray."""
    gears = robot.transmission
    return {e.where: gears.flanks(e.where) for e in robot.effects if deflects(e)}
