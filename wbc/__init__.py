"""Whole-body control, simulation and diagnosis of robots with lossy transmissions."""

from wbc.effects import load_robot, save_robot
from wbc.robot import Robot

__all__ = ["Robot", "load_robot", "save_robot"]
