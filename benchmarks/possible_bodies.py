"""The classic fit beside the same model of bodies that can exist: how much its freedom is worth.

    python -m benchmarks.possible_bodies DATA [--only NAME ...] [--json FILE]

A classic fit of base parameters asks of no link that it can exist, and of no rotor inertia or
friction that it is not negative. Here links have pseudo-inertias that are positive definite (hardly
drawn to their drawing), and rotor inertia, viscous and Coulomb friction of every joint are not
negative; offsets are free. No diagnosis whose links can exist explains more with these effects.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from rich.table import Table

from benchmarks.classic_fit import left_by, ratio_error
from benchmarks.recorded import run_on_machines
from wbc.effects import EFFECTS
from wbc.effects.links import pseudo_inertia
from wbc.identification.classic.classic_fit import classic_fit
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.measurement import Log
from wbc.robot import Effect, Robot

# Standard deviation of the log-Cholesky parameters, 25 times that of usual drawings: on Go2 the
# ratios of the hips fall by 0.04 to 0.14 from 0.2 to 1.0 and by at most 0.03 from there to 5.0.
_HARDLY_DRAWN = 5.0
_ITERATIONS = 60
_KINDS = (
    "coulomb_friction", "viscous_friction", "rotor_coulomb_friction", "rotor_viscous_friction",
    "rotor_inertia", "torque_offset", "link_inertias",
)  # fmt: skip


def main() -> None:
    """Measure, print, write."""
    pseudo_inertia.USUAL = _HARDLY_DRAWN
    run_on_machines(__doc__.splitlines()[0], measure)


def measure(
    machine: str, robot: Robot, logs: Sequence[Log], budget: float
) -> tuple[dict[str, Any], Table]:
    """Return what both leave per joint [N m], held out, and the table."""
    start = time.process_time()
    problem = EstimationProblem.from_logs(robot, logs)
    classic = classic_fit(problem)
    fit = problem.fit(
        [effect for kind in _KINDS for effect in _everywhere(kind, robot)], _ITERATIONS
    )
    left = left_by(problem, fit)
    possible = np.sqrt(np.mean(left**2, axis=0))
    errors = ratio_error(left, classic.residual, problem.blocks)
    table = Table("joint", "classic", "bodies that can exist", "ratio", box=None, title=machine)
    each = zip(classic.joints, classic.left, possible, errors, strict=True)
    for joint, one, other, error in each:
        table.add_row(joint, f"{one:.3g}", f"{other:.3g}", f"{other / one:.3f} ± {error:.3f}")
    table.caption = f"rms held out [N m]; {time.process_time() - start:.1f} CPU s"
    return {
        "joints": list(classic.joints),
        "classic": classic.left.tolist(),
        "possible": possible.tolist(),
        "ratio_error": errors.tolist(),
    }, table


def _everywhere(name: str, robot: Robot) -> list[Effect]:
    kind = EFFECTS[name]
    return [kind.at(where, kind.null_values(robot, where)) for where in kind.places(robot)]


if __name__ == "__main__":
    main()
