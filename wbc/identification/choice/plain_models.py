"""The plain fits that every answer has to match: nothing is chosen in them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.effects.drive import RotorInertia, TorqueConstant, TorqueOffset
from wbc.effects.friction import (
    CoulombFriction,
    RotorCoulombFriction,
    RotorViscousFriction,
    StribeckFriction,
    ViscousFriction,
)
from wbc.effects.gear_losses import LoadFriction
from wbc.effects.links import LinkInertia, LinkInertias
from wbc.identification.choice.evidence import Hypothesis
from wbc.identification.choice.trials import Trials
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.robot import Effect

FRICTION: tuple[type[Effect], ...] = (
    ViscousFriction,
    CoulombFriction,
    RotorViscousFriction,
    RotorCoulombFriction,
    TorqueOffset,
)
"""Friction and offset of each joint; rotor friction where it differs from that of the joint."""
JOINTS: tuple[type[Effect], ...] = (*FRICTION, RotorInertia)
"""What the classic fit has at every joint beside the links."""

_OF_JOINTS = 2  # plain fits that change neither links nor drives


def plain_fits(
    trials: Trials, classes: Sequence[type[Effect]], *, links: bool = True
) -> list[Hypothesis]:
    """Return the plain fits, each without the causes that say nothing on these logs.

    Friction and offsets; rotor inertias; the classic fit; it with a torque constant, with load
    friction, and with friction that falls with speed, at every joint. The classic fit has the
    inertias of all links. As numbers of a robot they are those of bodies that can exist, and
    friction takes power. Free base parameters are not bound to that: where torques are wrong by a
    factor at some joints, they take it up. On a recorded six-axis arm bodies that can exist leave
    0.97 to 1.5 times what free base parameters leave held out, 0.94 to 1.1 times with torque
    constants, and 0.84 to 1.02 times with load friction. Where friction falls, free numbers have
    viscous friction below zero: at a calf of a recorded quadruped bodies that can exist leave 1.08
    times as much, 1.01 times with Stribeck friction.

    Each begins from nothing, and where the one before ended; what leaves less counts. At the calves
    of that quadruped load friction is found from nothing alone (0.69 instead of 1.04 times), and
    Stribeck friction beside it from there alone. One that nothing can be told from is the last.

    Args:
        trials: on the logs.
        classes: effects that may be used.
        links: whether those count that change the inertias of links or the drives.
    """
    problem = trials.problem
    robot = problem.robot
    drawn = LinkInertias if LinkInertias.places(robot) else LinkInertia
    parts = (
        at_all_joints(problem, FRICTION),
        at_all_joints(problem, (RotorInertia,)),
        [drawn.at(where, drawn.null_values(robot, where)) for where in drawn.places(robot)],
        at_all_joints(problem, (TorqueConstant,)),
        at_all_joints(problem, (LoadFriction,)),
        [_falling(problem, own) for own in at_all_joints(problem, (StribeckFriction,))],
    )
    fits: list[Hypothesis] = []
    start: tuple[Effect, ...] = ()
    for part in parts if links else parts[:_OF_JOINTS]:
        if more := tuple(own for own in part if isinstance(own, tuple(classes))):
            start = (*start, *more)
            ahead = [trials.of((*last.effects, *more), last) for last in fits[-1:]]
            if tried := [h for h in (trials.of(start), *ahead) if h is not None]:
                fits.append(without_idle(trials, min(tried, key=lambda h: h.error)))
                if fits[-1].only_noise(problem):
                    break
    return fits


def at_all_joints(problem: EstimationProblem, kinds: Sequence[type[Effect]]) -> tuple[Effect, ...]:
    """Return effects that change nothing yet, at every judged joint that moves."""
    robot = problem.robot
    moving = np.setdiff1d(problem.judged_joints, problem.still).tolist()
    return tuple(
        kind.at(where, kind.null_values(robot, where))
        for kind in kinds
        for where in kind.places(robot)
        if where in moving
    )


def _falling(problem: EstimationProblem, own: Effect) -> Effect:
    """Return Stribeck friction whose speed begins at the rms speed of its joint."""
    row = problem.robot.velocity_index(own.where)
    speed = np.concatenate([record.motion.velocity[:, row] for record in problem.records])
    (bounds,) = (p for p in own.parameters if p.name == "speed")
    begun = np.clip(np.sqrt(np.mean(speed**2)), bounds.low, bounds.high)
    return own.with_values({"speed": float(begun)})


def without_idle(trials: Trials, h: Hypothesis) -> Hypothesis:
    """Return a hypothesis without the causes that change nothing on these logs."""
    whole = trials.ended(h)
    return trials.ended(trials.of(trials.busy(whole)) or whole)
