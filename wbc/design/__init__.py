"""Design sweeps: many variations of a robot, their metrics, and the best compromises among them."""

from wbc.design.study import (
    Gearbox as Gearbox,
    Objective as Objective,
    Study as Study,
    SweepParameter as SweepParameter,
    choose_gearboxes as choose_gearboxes,
    describe_columns as describe_columns,
    pareto_front as pareto_front,
    parse_objective as parse_objective,
    parse_sweep as parse_sweep,
    read_gearboxes as read_gearboxes,
    run_study as run_study,
)
