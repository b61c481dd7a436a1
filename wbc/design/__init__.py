"""Design sweeps: many variations of a robot, their metrics, and the best compromises among them."""

from wbc.design.pareto import Objective, pareto_front, parse_objective
from wbc.design.simulated import SIMULATIONS
from wbc.design.study import Study, describe_columns
from wbc.design.sweep_parameter import SweepParameter, parse_sweep
from wbc.design.table import read_designs
from wbc.design.work import run_study

__all__ = [
    "SIMULATIONS",
    "Objective",
    "Study",
    "SweepParameter",
    "describe_columns",
    "pareto_front",
    "parse_objective",
    "parse_sweep",
    "read_designs",
    "run_study",
]
