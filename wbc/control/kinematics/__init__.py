"""Dynamics and kinematics of one tick."""

from wbc.control.kinematics.frame_rows import FrameTable, RowKind, StateRows
from wbc.control.kinematics.kinematics import Kinematics

__all__ = ["FrameTable", "Kinematics", "RowKind", "StateRows"]
