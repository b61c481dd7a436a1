"""A robot with its effects, written for the simulators that people train in."""

from wbc.export.export import FORMATS, Exported, export_robot, losses_path
from wbc.export.loss_numbers import loss_numbers

__all__ = [
    "FORMATS",
    "Exported",
    "export_robot",
    "loss_numbers",
    "losses_path",
]
