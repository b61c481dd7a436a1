"""Evaluated terms, the redundant model, and the dissipative equation of motion."""

from wbc.dynamics.batch import (
    contact_jacobians,
    contact_torque,
    inertial_parameters,
    inertial_regressor,
    inverse_dynamics,
    level_normal,
    link_torque,
    motor_torque,
    output_torque,
    rotor_torque,
)
from wbc.dynamics.equation import (
    DissipativeEquation,
    RedundantModel,
    RotorCoupling,
    constraint_jacobian,
    constraint_nullspace,
    dissipative_equation,
    redundant_model,
    rotor_coupling,
)
from wbc.dynamics.terms import Terms, Workspace, evaluate

__all__ = [
    "DissipativeEquation",
    "RedundantModel",
    "RotorCoupling",
    "Terms",
    "Workspace",
    "constraint_jacobian",
    "constraint_nullspace",
    "contact_jacobians",
    "contact_torque",
    "dissipative_equation",
    "evaluate",
    "inertial_parameters",
    "inertial_regressor",
    "inverse_dynamics",
    "level_normal",
    "link_torque",
    "motor_torque",
    "output_torque",
    "redundant_model",
    "rotor_coupling",
    "rotor_torque",
]
