"""What people look at: playback, pictures, plots and the report.

Names are loaded when they are first used: meshcat and the browser are needed only by who draws.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from wbc.errors import needs

if TYPE_CHECKING:
    from wbc.view.palette import DARK, LIGHT, Theme
    from wbc.view.pictures import write_animation, write_picture
    from wbc.view.playback import write_playback
    from wbc.view.track import Ghost, model_ghost

__all__ = [
    "DARK",
    "LIGHT",
    "Ghost",
    "Theme",
    "model_ghost",
    "write_animation",
    "write_picture",
    "write_playback",
]

_HOMES = ("palette", "track", "playback", "pictures")  # each loads those before it, or takes little


def __getattr__(name: str) -> Any:
    for home in _HOMES if name in __all__ else ():
        with needs("view", f"{name} of wbc.view"):
            module = import_module(f"wbc.view.{home}")
        if hasattr(module, name):
            return getattr(module, name)
    raise AttributeError(f"module 'wbc.view' has no attribute '{name}'")


def __dir__() -> list[str]:
    return __all__
