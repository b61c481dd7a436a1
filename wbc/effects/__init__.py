"""One small final class per physical effect, shared by controller, simulator and logs."""

from wbc.effects.catalogue import EFFECTS, effect_class
from wbc.effects.coulomb_friction import CoulombFriction
from wbc.effects.joint_effect import JointEffect
from wbc.effects.joint_spring import JointSpring
from wbc.effects.load_friction import LoadFriction
from wbc.effects.payload_mass import PayloadMass
from wbc.effects.quadratic_drag import QuadraticDrag
from wbc.effects.rotor_inertia import RotorInertia
from wbc.effects.saved import load_robot, save_robot
from wbc.effects.stribeck_friction import StribeckFriction
from wbc.effects.torque_constant import TorqueConstant
from wbc.effects.torque_offset import TorqueOffset
from wbc.effects.torque_ripple import TorqueRipple
from wbc.effects.transmission_efficiency import TransmissionEfficiency
from wbc.effects.viscous_friction import ViscousFriction

__all__ = [
    "EFFECTS",
    "CoulombFriction",
    "JointEffect",
    "JointSpring",
    "LoadFriction",
    "PayloadMass",
    "QuadraticDrag",
    "RotorInertia",
    "StribeckFriction",
    "TorqueConstant",
    "TorqueOffset",
    "TorqueRipple",
    "TransmissionEfficiency",
    "ViscousFriction",
    "effect_class",
    "load_robot",
    "save_robot",
]
