"""The effects by their names: the final classes of the files in this room."""

from __future__ import annotations

from types import MappingProxyType

from wbc.effects import drive, friction, gear_losses, links, position_torques, presliding, sensing
from wbc.effects.formula import CustomTorque
from wbc.errors import EffectError, require_known
from wbc.robot import Effect

_FILES = (friction, presliding, gear_losses, drive, links, position_torques, sensing)

EFFECTS: MappingProxyType[str, type[Effect]] = MappingProxyType(
    {
        kind.name: kind
        for file in _FILES
        for kind in vars(file).values()
        # `final` notes that it was there; a file may hold classes of others.
        if getattr(kind, "__final__", False) and kind.__module__ == file.__name__
    }
)
"""Every effect class by the name that logs, files and reports use."""


def effect_class(name: str) -> type[Effect]:
    """Return the effect class called `name`.

    Raises:
        EffectError: no such effect; the message lists those there are.
    """
    # A formula is no cause that a diagnosis could consider, but files and robots hold it.
    known: dict[str, type[Effect]] = {**EFFECTS, CustomTorque.name: CustomTorque}
    require_known(EffectError, "effect", name, known)
    return known[name]
