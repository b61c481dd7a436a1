"""What tasks, contacts and limits say about themselves, held against differences and motions."""

from wbc.control.checking.derivatives import DerivativeErrors, check_contact, check_task
from wbc.control.checking.limits import TorqueLimitErrors, check_joint_limit, check_torque_limit

__all__ = [
    "DerivativeErrors",
    "TorqueLimitErrors",
    "check_contact",
    "check_joint_limit",
    "check_task",
    "check_torque_limit",
]
