"""Evaluated terms, the redundant model, and the dissipative equation of motion."""

from wbc.dynamics.batch import (
    contact_torque as contact_torque,
    inertial_parameters as inertial_parameters,
    inertial_regressor as inertial_regressor,
    link_torque as link_torque,
    rotor_torque as rotor_torque,
)
from wbc.dynamics.equation import (
    DissipativeEquation as DissipativeEquation,
    RedundantModel as RedundantModel,
    Terms as Terms,
    Workspace as Workspace,
    dissipative_equation as dissipative_equation,
    evaluate as evaluate,
    redundant_model as redundant_model,
)
