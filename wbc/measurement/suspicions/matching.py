"""Which joint of a log is which joint of a robot, told by motion and torque."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import permutations
from math import factorial

import numpy as np
from scipy.special import logsumexp

from wbc.measurement.columns.apply import mended
from wbc.measurement.log import Log
from wbc.measurement.suspicions.bench import Bench
from wbc.measurement.suspicions.evidence import evidence
from wbc.measurement.suspicions.readings import as_it_stands
from wbc.measurement.suspicions.rows import rows_of
from wbc.robot import Robot

_MOST_ORDERS = 720
_SURE = 0.9


def match_joints(
    robot: Robot, log: Log, ours: Sequence[str], theirs: Sequence[str]
) -> tuple[dict[str, str], bool]:
    """Return joint of the robot -> joint of the log, and whether the rows tell it.

    The order in which the reported torques follow what the motion needs; the order of the names
    where that cannot be told.

    Args:
        robot: whose joints some names of the log are thought to mean.
        log: with columns of `theirs`.
        ours: joints of the robot without columns.
        theirs: joints of the log that the robot does not have, as many.
    """
    plain = dict(zip(ours, theirs, strict=True))
    if len(ours) < 2 or factorial(len(ours)) > _MOST_ORDERS:
        return plain, len(ours) == 1
    renamed = mended(
        log,
        {
            "columns": {
                f"{one}.{name.removeprefix(other + '.')}": {"from": name}
                for one, other in plain.items()
                for name in log.columns
                if name.startswith(f"{other}.")
            }
        },
    )
    rows = rows_of(robot, renamed)
    if rows is None or len(set(rows.quantities)) > 1:
        return plain, False
    bench = Bench(rows)
    single, driven = list(robot.single_joints), list(robot.transmission.joints)
    orders = list(permutations(range(len(ours))))
    scores = []
    for order in orders:
        reading = as_it_stands(rows)
        places, torques = reading.order.copy(), reading.torque_order.copy()
        for k, source in enumerate(order):
            places[single.index(ours[k])] = single.index(ours[source])
            if ours[k] in driven and ours[source] in driven:
                torques[driven.index(ours[k])] = driven.index(ours[source])
        changed = replace(reading, order=places, torque_order=torques)
        scores.append(evidence([(bench.reports(changed), bench.unrelated(changed))]))
    best = int(np.argmax(scores))
    sure = float(np.exp(scores[best] - logsumexp(scores))) > _SURE
    chosen = orders[best] if sure else orders[0]
    return {ours[k]: theirs[source] for k, source in enumerate(chosen)}, sure
