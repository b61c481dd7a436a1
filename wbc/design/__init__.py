"""Design sweeps: many variations of a robot, their metrics, and the best compromises among them."""

from wbc.design.gearboxes import Gearbox, choose_gearboxes, read_gearboxes
from wbc.design.stored import (
    Objective,
    best_designs,
    pareto_front,
    parse_objective,
    run_study,
    sampled_designs,
)
from wbc.design.study import Study, SweepParameter, describe_columns, parse_sweep

__all__ = [
    "Gearbox",
    "Objective",
    "Study",
    "SweepParameter",
    "best_designs",
    "choose_gearboxes",
    "describe_columns",
    "pareto_front",
    "parse_objective",
    "parse_sweep",
    "read_gearboxes",
    "run_study",
    "sampled_designs",
]
