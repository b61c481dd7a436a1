"""What people look at: playback, pictures, plots and the report.

Names are loaded when they are first used: meshcat and the browser are needed only by who draws.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from wbc.errors import needs
from wbc.view.palette import DARK as DARK, LIGHT as LIGHT, Theme as Theme

if TYPE_CHECKING:
    from wbc.view.channels import Ghost as Ghost, model_ghost as model_ghost
    from wbc.view.pictures import write_animation as write_animation, write_picture as write_picture
    from wbc.view.playback import write_playback as write_playback

_HOMES = {
    "Ghost": "channels",
    "model_ghost": "channels",
    "write_animation": "pictures",
    "write_picture": "pictures",
    "write_playback": "playback",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'wbc.view' has no attribute '{name}'")
    with needs("view", f"{name} of wbc.view"):
        return getattr(import_module(f"wbc.view.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return ["DARK", "LIGHT", "Theme", *_HOMES]
