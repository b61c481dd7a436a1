"""One small final class per physical effect, shared by controller, simulator and logs."""

from wbc.effects.catalogue import EFFECTS, effect_class
from wbc.effects.drive import (
    ActuationDelay,
    CurrentLimit,
    RotorInertia,
    TorqueConstant,
    TorqueOffset,
)
from wbc.effects.formula import CustomTorque, TorqueTerm
from wbc.effects.friction import (
    CoulombFriction,
    DirectionalViscousFriction,
    QuadraticDrag,
    StribeckFriction,
    ThermalViscousFriction,
    ViscousFriction,
)
from wbc.effects.gear_losses import (
    Backlash,
    JointCompliance,
    LoadFriction,
    LoadStribeckFriction,
    TransmissionEfficiency,
)
from wbc.effects.joint_effect import JointEffect
from wbc.effects.link_inertias import LinkInertia, LinkInertias
from wbc.effects.links import CenterOfMass, ContactRadius, GravityDirection, PayloadMass
from wbc.effects.position_torques import JointSpring, TorqueRipple
from wbc.effects.presliding import LoadPresliding, Presliding
from wbc.effects.saved import load_robot, save_robot
from wbc.effects.sensing import ForceSensorGain, PositionOffset
from wbc.effects.supply import SupplySag, ThermalDrift, VoltageScaling

__all__ = [
    "EFFECTS",
    "ActuationDelay",
    "Backlash",
    "CenterOfMass",
    "ContactRadius",
    "CoulombFriction",
    "CurrentLimit",
    "CustomTorque",
    "DirectionalViscousFriction",
    "ForceSensorGain",
    "GravityDirection",
    "JointCompliance",
    "JointEffect",
    "JointSpring",
    "LinkInertia",
    "LinkInertias",
    "LoadFriction",
    "LoadPresliding",
    "LoadStribeckFriction",
    "PayloadMass",
    "PositionOffset",
    "Presliding",
    "QuadraticDrag",
    "RotorInertia",
    "StribeckFriction",
    "SupplySag",
    "ThermalDrift",
    "ThermalViscousFriction",
    "TorqueConstant",
    "TorqueOffset",
    "TorqueRipple",
    "TorqueTerm",
    "TransmissionEfficiency",
    "ViscousFriction",
    "VoltageScaling",
    "effect_class",
    "load_robot",
    "save_robot",
]
