"""Design sweeps: many variations of a robot, their metrics, and the best compromises among them."""

from wbc.design.gearboxes import (
    Gearbox as Gearbox,
    choose_gearboxes as choose_gearboxes,
    read_gearboxes as read_gearboxes,
)
from wbc.design.stored import (
    Objective as Objective,
    best_designs as best_designs,
    pareto_front as pareto_front,
    parse_objective as parse_objective,
    run_study as run_study,
    sampled_designs as sampled_designs,
)
from wbc.design.study import (
    Study as Study,
    SweepParameter as SweepParameter,
    describe_columns as describe_columns,
    parse_sweep as parse_sweep,
)
