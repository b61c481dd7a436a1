"""Whole-body control, simulation and diagnosis of robots with lossy transmissions."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from wbc.effects import load_robot, save_robot
    from wbc.robot import Robot

__all__ = ["Robot", "load_robot", "save_robot"]


def __getattr__(name: str) -> Any:
    """Load what the package offers when it is asked for: the command sets threads before NumPy."""
    if name not in __all__:
        raise AttributeError(f"module 'wbc' has no attribute '{name}'")
    return getattr(import_module("wbc.robot" if name == "Robot" else "wbc.effects"), name)
