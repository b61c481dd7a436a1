"""One small final class per physical effect, shared by controller, simulator and logs."""

from wbc.effects.actuation_delay import ActuationDelay
from wbc.effects.backlash import Backlash
from wbc.effects.catalogue import EFFECTS, effect_class
from wbc.effects.center_of_mass import CenterOfMass
from wbc.effects.coulomb_friction import CoulombFriction
from wbc.effects.current_limit import CurrentLimit
from wbc.effects.custom_torque import CustomTorque
from wbc.effects.directional_viscous_friction import DirectionalViscousFriction
from wbc.effects.force_sensor_gain import ForceSensorGain
from wbc.effects.gravity_direction import GravityDirection
from wbc.effects.joint_compliance import JointCompliance
from wbc.effects.joint_effect import JointEffect
from wbc.effects.joint_spring import JointSpring
from wbc.effects.link_inertia import LinkInertia
from wbc.effects.link_inertias import LinkInertias
from wbc.effects.load_friction import LoadFriction
from wbc.effects.load_presliding import LoadPresliding
from wbc.effects.payload_mass import PayloadMass
from wbc.effects.position_offset import PositionOffset
from wbc.effects.presliding import Presliding
from wbc.effects.quadratic_drag import QuadraticDrag
from wbc.effects.rotor_inertia import RotorInertia
from wbc.effects.saved import load_robot, save_robot
from wbc.effects.stribeck_friction import StribeckFriction
from wbc.effects.supply_sag import SupplySag
from wbc.effects.thermal_drift import ThermalDrift
from wbc.effects.thermal_viscous_friction import ThermalViscousFriction
from wbc.effects.torque_constant import TorqueConstant
from wbc.effects.torque_offset import TorqueOffset
from wbc.effects.torque_ripple import TorqueRipple
from wbc.effects.torque_term import TorqueTerm
from wbc.effects.transmission_efficiency import TransmissionEfficiency
from wbc.effects.viscous_friction import ViscousFriction

__all__ = [
    "EFFECTS",
    "ActuationDelay",
    "Backlash",
    "CenterOfMass",
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
    "effect_class",
    "load_robot",
    "save_robot",
]
