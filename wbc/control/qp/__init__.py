"""The quadratic programs of a tick: their rows, levels, directions of gears and solvers."""
