"""Whether the size of a cause stays the same wherever the machine is.

The law of a cause that is there has one size at all speeds, positions and loads, and at all times.
What only stands in for something else has another one wherever that is another. With m what a cause
adds, and s a variable of the logs with mean 0 and mean square 1 where m is, the column m s beside
all numbers of the fit says by which share a the size of the cause grows with s. Over all s,

    log mean (p(a | stand-in) / p(a | itself))

is the evidence for a stand-in. Densities are normal, of mean 0, with the variance of a and that of
`_STAND_IN` more, or, in so many cases each, those of `_ITSELF`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import logsumexp
from scipy.stats import norm

from wbc.arrays import FloatArray
from wbc.identification.choice.drop_screen import Normal
from wbc.identification.choice.evidence import Hypothesis
from wbc.identification.model.estimation_problem import ALIKE, EstimationProblem
from wbc.identification.model.fit import Fit
from wbc.identification.records import record as rows
from wbc.identification.records.record import Record

Variables = dict[str, tuple[str, FloatArray]]
"""Name of what a torque may depend on -> unit and values (N,)."""

_STAND_IN = 0.3  # from 0.15 to 0.6 the area under the curve of true over false causes is 0.88
# The first is that of laws that are exact, as in generated logs: from 0.005 to 0.02 that area is
# 0.88 to 0.87. Friction of recorded machines is not: of 18 frictions of three machines what changes
# most surely does so by 3 to 28 %, half of them by 8 % or more.
_ITSELF = ((0.95, 0.01), (0.05, 0.1))
# Share of the squares of what a cause adds, from which on an output feels it. With all outputs the
# evidence of 20 frictions of recorded machines differs by at most 0.3 nats.
_FELT = 0.01
_TOLD = 1e-6  # share of the squares of a column that other columns must leave: less is rounding


def quantities(record: Record, column: int) -> Variables:
    """Return unit and values (N,) of what the torque at one output may depend on, by name."""
    robot, motion = record.robot, record.motion
    row, gear = rows.output_row(robot, column), rows.output_gear(robot, column)
    speed, load = motion.velocity[:, row], record.load[:, row]
    time = np.arange(len(speed)) / record.rate
    seen = {
        "speed": ("rad/s", speed),
        "acceleration": ("rad/s^2", np.asarray(motion.acceleration)[:, row]),
        "load": ("N m", load),
        "time": ("s", time),
    }
    if gear is not None:
        position, way = motion.position[:, robot.actuated_position[gear]], np.sign(speed)
        turned = np.mod(position * float(robot.transmission.gear_ratio[gear]), 2.0 * np.pi)
        # When the joint last changed direction.
        changed = np.where(np.diff(way, prepend=way[:1]) != 0.0, time, 0.0)
        seen |= {
            "position": ("rad", position),
            "rotor angle": ("rad", turned),
            "mesh power": ("W", load * speed),
            "direction": ("1", way),
            "load against direction": ("N m", np.abs(load) * way),
            "time since reversal": ("s", time - np.maximum.accumulate(changed)),
        }
        if motion.temperature is not None:
            seen["temperature"] = ("deg C", motion.temperature[:, gear])
    forces = record.forces.items()
    return seen | {f"force at {n}": ("N", np.linalg.norm(f, axis=1)) for n, f in forces}


def stand_in_evidence(
    problem: EstimationProblem, h: Hypothesis, fit: Fit, adds: Sequence[FloatArray]
) -> list[tuple[float, str]]:
    """Return for each cause of a hypothesis the evidence that it stands in for another [nats].

    Negative where its size is the same everywhere; 0 where nothing tells. With it the variable with
    which its size changes most surely; empty where nothing tells.

    Args:
        problem: the logs.
        h: the hypothesis.
        fit: of it.
        adds: (rows, outputs) by which each cause changes the residual.
    """
    if not h.effects:
        return []
    usual, weights = fit.usual.jacobian, np.sqrt(h.samples / np.maximum(h.outputs, 1.0))
    jacobian, residual = fit.jacobian * weights[:, None], fit.residual * weights
    flat = jacobian.reshape(residual.size, -1)
    normal = Normal.of(flat.T @ flat + usual.T @ usual, residual.ravel() @ flat)
    # What filters and simulations distort may look like a cause that is larger somewhere.
    distorted = ALIKE**2 * float(weights**2 @ problem.distorted(h.distorts))
    found, seen = [], dict[int, tuple[list[str], FloatArray, FloatArray]]()
    for added in (own * weights for own in adds):
        power = np.sum(added**2, axis=0)
        felt, most = power >= _FELT * power.sum(), int(problem.floor.judged[power.argmax()])
        if most not in seen:
            seen[most] = _variables(problem.records, most)
        names, here, there = seen[most]
        where = np.sum(added**2, axis=1)
        own = _even(here, where)
        varying = np.hstack([own, _even(np.abs(own), where), _even(there, where)])
        columns = (added[:, felt, None] * varying[:, None]).reshape(-1, varying.shape[1])
        beside = jacobian[:, felt].reshape(len(columns), -1).T @ columns / normal.size[:, None]
        alone = np.sum(columns**2, axis=0)
        told = alone - np.sum(beside * (normal.covariance @ beside), axis=0)
        along = residual[:, felt].ravel() @ columns + normal.lowest @ beside
        clear = told > _TOLD * alone
        off = distorted * len(residual) / max(float(power.sum()), 1e-300)
        each = _log_odds(along[clear] / told[clear], 1.0 / told[clear] + off)
        most_surely = names[int(np.flatnonzero(clear)[each.argmax()])] if each.size else ""
        whole = float(logsumexp(each) - np.log(each.size)) if each.size else 0.0
        found.append((whole, most_surely))
    return found


def _variables(records: Sequence[Record], column: int) -> tuple[list[str], FloatArray, FloatArray]:
    """Return the names of variables on which what is added, mostly at one output, may depend.

    With them what the output itself depends on (rows, k); how far that is from its mean has names,
    too. Then where the other joints are, and which run it is (rows, l).
    """
    robot, here, there = records[0].robot, [], []
    others = np.flatnonzero(np.arange(robot.transmission.size) != rows.output_gear(robot, column))
    each = [quantities(record, column) for record in records]
    names = [name for name in each[0] if all(name in own for own in each)]
    for k, (record, seen) in enumerate(zip(records, each, strict=True)):
        here.append(record.thinned(np.column_stack([seen[name][1] for name in names])))
        run = np.broadcast_to(np.arange(len(records)) == k, (len(here[-1]), len(records)))
        elsewhere = record.motion.position[:, robot.actuated_position[others]]
        there.append(np.hstack([record.thinned(elsewhere), run]))
    names += [f"distance of {name} from its mean" for name in names]
    names += [f"position of {robot.transmission.joints[k]}" for k in others]
    names += [f"run {k + 1}" for k in range(len(records))]
    return names, np.concatenate(here), np.concatenate(there)


def _even(values: FloatArray, weights: FloatArray) -> FloatArray:
    """Return values (rows, k) with the mean 0 and the mean square 1 by weights (rows,)."""
    shares = weights / max(float(weights.sum()), 1e-300)
    values = values - shares @ values
    spread = np.sqrt(shares @ values**2)
    return np.asarray(values / np.where(spread > 0.0, spread, np.inf))


def _log_odds(shares: FloatArray, variances: FloatArray) -> FloatArray:
    """Return (k,) the log odds that causes whose size grows by these shares are stand-ins."""

    def density(more: float) -> FloatArray:
        return np.asarray(norm.logpdf(shares, scale=np.sqrt(variances + more**2)))

    itself = [np.log(often) + density(more) for often, more in _ITSELF]
    return np.asarray(density(_STAND_IN) - logsumexp(itself, axis=0))
