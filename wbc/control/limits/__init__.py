"""Limits: what motors and joints cannot do."""

from wbc.control.limits.collision import CollisionLimit, CollisionRows, Shape
from wbc.control.limits.joint import JointLimit
from wbc.control.limits.motor_braking import MotorBraking
from wbc.control.limits.rotor_torque import RotorTorqueLimit

__all__ = [
    "CollisionLimit",
    "CollisionRows",
    "JointLimit",
    "MotorBraking",
    "RotorTorqueLimit",
    "Shape",
]
