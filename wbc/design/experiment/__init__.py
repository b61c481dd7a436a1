"""The experiment that decides: a motion that tells rival causes apart, and what to expect of it."""

from wbc.design.experiment.fourier import FourierPath
from wbc.design.experiment.limits import MotionLimits
from wbc.design.experiment.rivals import Cause, Rivals, parameter_names, parse_cause
from wbc.design.experiment.search import (
    Designed,
    deciding,
    design_experiment,
    expected,
    informing,
    random_paths,
    shrinking,
    torque_misfit,
)
from wbc.design.experiment.tied import tied_causes

__all__ = [
    "Cause",
    "Designed",
    "FourierPath",
    "MotionLimits",
    "Rivals",
    "deciding",
    "design_experiment",
    "expected",
    "informing",
    "parameter_names",
    "parse_cause",
    "random_paths",
    "shrinking",
    "tied_causes",
    "torque_misfit",
]
