"""The experiment that decides: a motion that tells rival causes apart, and what to expect of it."""

from wbc.design.experiment.fourier import FourierPath
from wbc.design.experiment.limits import MotionLimits
from wbc.design.experiment.rivals import Rivals, parse_rival
from wbc.design.experiment.search import (
    Designed,
    deciding,
    design_experiment,
    expected,
    informing,
    random_paths,
)

__all__ = [
    "Designed",
    "FourierPath",
    "MotionLimits",
    "Rivals",
    "deciding",
    "design_experiment",
    "expected",
    "informing",
    "parse_rival",
    "random_paths",
]
