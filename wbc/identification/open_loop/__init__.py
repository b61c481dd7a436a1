"""How far a robot that is simulated from a measured state strays from the log."""

from wbc.identification.open_loop.open_loop import HORIZONS, OpenLoop, open_loop

__all__ = ["HORIZONS", "OpenLoop", "open_loop"]
