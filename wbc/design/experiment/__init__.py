"""The experiment that decides: a motion that tells rival causes apart, and what to expect of it."""

from wbc.design.experiment.motions import (
    FourierPath as FourierPath,
    MotionLimits as MotionLimits,
    predicted as predicted,
    write_set_points as write_set_points,
)
from wbc.design.experiment.rivals import (
    BAND as BAND,
    Cause as Cause,
    Pair as Pair,
    Predictions as Predictions,
    Rivals as Rivals,
    parameter_names as parameter_names,
    parse_cause as parse_cause,
    require_predictable as require_predictable,
    typical_values as typical_values,
)
from wbc.design.experiment.search import (
    CLASSIC as CLASSIC,
    DESIGNED as DESIGNED,
    RANDOM as RANDOM,
    Designed as Designed,
    compare_motions as compare_motions,
    deciding as deciding,
    design_experiment as design_experiment,
    expected as expected,
    experiment_json as experiment_json,
    informing as informing,
    random_paths as random_paths,
    shrinking as shrinking,
)
from wbc.design.experiment.tied import tied_causes as tied_causes, tied_rivals as tied_rivals
