"""One small final class per physical effect, shared by controller, simulator and logs."""

from wbc.effects.catalogue import EFFECTS, effect_class
from wbc.effects.drive.actuation_delay import ActuationDelay
from wbc.effects.drive.current_limit import CurrentLimit
from wbc.effects.drive.rotor_inertia import RotorInertia
from wbc.effects.drive.supply_sag import SupplySag
from wbc.effects.drive.thermal_drift import ThermalDrift
from wbc.effects.drive.torque_constant import TorqueConstant
from wbc.effects.drive.torque_offset import TorqueOffset
from wbc.effects.drive.torque_ripple import TorqueRipple
from wbc.effects.drive.voltage_scaling import VoltageScaling
from wbc.effects.formula.custom_torque import CustomTorque
from wbc.effects.formula.torque_term import TorqueTerm
from wbc.effects.friction.coulomb_friction import CoulombFriction
from wbc.effects.friction.directional_viscous_friction import DirectionalViscousFriction
from wbc.effects.friction.load_friction import LoadFriction
from wbc.effects.friction.load_stribeck_friction import LoadStribeckFriction
from wbc.effects.friction.quadratic_drag import QuadraticDrag
from wbc.effects.friction.stribeck_friction import StribeckFriction
from wbc.effects.friction.thermal_viscous_friction import ThermalViscousFriction
from wbc.effects.friction.viscous_friction import ViscousFriction
from wbc.effects.gear.backlash import Backlash
from wbc.effects.gear.joint_compliance import JointCompliance
from wbc.effects.gear.transmission_efficiency import TransmissionEfficiency
from wbc.effects.joint_effect import JointEffect
from wbc.effects.links.center_of_mass import CenterOfMass
from wbc.effects.links.gravity_direction import GravityDirection
from wbc.effects.links.joint_spring import JointSpring
from wbc.effects.links.link_inertia import LinkInertia
from wbc.effects.links.link_inertias import LinkInertias
from wbc.effects.links.payload_mass import PayloadMass
from wbc.effects.presliding.load_presliding import LoadPresliding
from wbc.effects.presliding.presliding import Presliding
from wbc.effects.saved import load_robot, save_robot
from wbc.effects.sensing.force_sensor_gain import ForceSensorGain
from wbc.effects.sensing.position_offset import PositionOffset

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
