"""Efforts: what the gears and motors should spend little of."""

from wbc.control.efforts.contact_force import ContactForceTask
from wbc.control.efforts.effort import Effort, GearCost
from wbc.control.efforts.joule_heat import JouleHeatEffort
from wbc.control.efforts.mesh_loss import MeshLossEffort
from wbc.control.efforts.output_torque import OutputTorqueEffort
from wbc.control.efforts.rotor_torque import RotorTorqueEffort

__all__ = [
    "ContactForceTask",
    "Effort",
    "GearCost",
    "JouleHeatEffort",
    "MeshLossEffort",
    "OutputTorqueEffort",
    "RotorTorqueEffort",
]
