"""The experiment that decides: a motion that tells rival causes apart, and what to expect of it."""

from wbc.design.experiment.motions import FourierPath, MotionLimits, write_set_points
from wbc.design.experiment.readable import BAND
from wbc.design.experiment.rivals import (
    Cause,
    Pair,
    Predictions,
    Rivals,
    parameter_names,
    parse_cause,
    require_predictable,
    typical_values,
)
from wbc.design.experiment.search import (
    CLASSIC,
    DESIGNED,
    RANDOM,
    Designed,
    compare_motions,
    deciding,
    design_experiment,
    expected,
    experiment_json,
    informing,
    random_paths,
    shrinking,
    torque_misfit,
)
from wbc.design.experiment.tied import tied_causes, tied_rivals

__all__ = [
    "BAND",
    "CLASSIC",
    "DESIGNED",
    "RANDOM",
    "Cause",
    "Designed",
    "FourierPath",
    "MotionLimits",
    "Pair",
    "Predictions",
    "Rivals",
    "compare_motions",
    "deciding",
    "design_experiment",
    "expected",
    "experiment_json",
    "informing",
    "parameter_names",
    "parse_cause",
    "random_paths",
    "require_predictable",
    "shrinking",
    "tied_causes",
    "tied_rivals",
    "torque_misfit",
    "typical_values",
    "write_set_points",
]
