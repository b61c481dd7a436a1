"""Contacts: where the robot may push against the ground, and how hard."""

from wbc.control.contacts.contact import BoundContact, Cone, Contact
from wbc.control.contacts.friction import ConeApproximation
from wbc.control.contacts.point import BoundPoint, PointContact
from wbc.control.contacts.surface import SurfaceContact

__all__ = [
    "BoundContact",
    "BoundPoint",
    "Cone",
    "ConeApproximation",
    "Contact",
    "PointContact",
    "SurfaceContact",
]
