"""Design sweeps: many variations of a robot, their metrics, and the best compromises among them."""

from wbc.design.stored import (
    Objective as Objective,
    pareto_front as pareto_front,
    parse_objective as parse_objective,
    run_study as run_study,
)
from wbc.design.study import (
    Gearbox as Gearbox,
    Study as Study,
    SweepParameter as SweepParameter,
    choose_gearboxes as choose_gearboxes,
    describe_columns as describe_columns,
    parse_sweep as parse_sweep,
    read_gearboxes as read_gearboxes,
)
