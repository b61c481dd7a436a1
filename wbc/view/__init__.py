"""What people look at: playback, pictures, plots and the report."""

from wbc.view.ghost import Ghost, log_ghost, model_ghost
from wbc.view.ground import GroundSlab, flat_ground, profile_ground
from wbc.view.live import LiveView
from wbc.view.palette import DARK, LIGHT, Theme
from wbc.view.pictures import write_animation, write_picture
from wbc.view.playback import write_playback

__all__ = [
    "DARK",
    "LIGHT",
    "Ghost",
    "GroundSlab",
    "LiveView",
    "Theme",
    "flat_ground",
    "log_ghost",
    "model_ghost",
    "profile_ground",
    "write_animation",
    "write_picture",
    "write_playback",
]
