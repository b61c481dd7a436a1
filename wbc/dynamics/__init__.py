"""Evaluated terms, the redundant model, and the dissipative equation of motion."""

from wbc.dynamics.batch import (
    contact_torque,
    inertial_parameters,
    inertial_regressor,
    link_torque,
    rotor_torque,
)
from wbc.dynamics.equation import (
    DissipativeEquation,
    RedundantModel,
    dissipative_equation,
    redundant_model,
)
from wbc.dynamics.terms import Terms, Workspace, evaluate

__all__ = [
    "DissipativeEquation",
    "RedundantModel",
    "Terms",
    "Workspace",
    "contact_torque",
    "dissipative_equation",
    "evaluate",
    "inertial_parameters",
    "inertial_regressor",
    "link_torque",
    "redundant_model",
    "rotor_torque",
]
