"""Make ties: poor first runs, and causes of the size at which others explain such a run as well."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.corpus.case import Case
from benchmarks.corpus.draw import LISTED
from benchmarks.corpus.excitation import Excitation, PlannedExcitation, reference
from benchmarks.corpus.machine import Machine
from wbc.design.experiment import Predictions, Rivals, require_predictable, typical_values
from wbc.effects import effect_class
from wbc.errors import DesignError
from wbc.robot import Effect, Motion, Robot

RUNS = 4  # poor first runs per machine
CAUSES = 2  # per first run, as long as the machine has others
KINDS = ("slow", "one_joint", "holds", "multisine")
SHORTEST, LONGEST = 2.0, 4.0  # [s]
SMALLEST = 0.2  # share of the usual stroke
_RATE = 50.0  # [Hz] at which rivals are looked for
_LEFT = 2.0  # [nats] that the closest rival leaves of the cause along the first run
_FELT = 60.0  # [nats] of a cause that is plain to see: its name, place and number cost 10
_SMALLER = 0.3  # of the square of a typical size, that a cause may be larger
_ALIKE = 1e-4  # of a cause's squared torque: what another one leaves of it when it is the same
_MOST = 3  # rivals, as many as `wbc experiment` takes beside what was found


@dataclass(frozen=True, eq=False)
class Candidate:
    """A cause, the poor run that hardly shows which one it is, and what comes close to it."""

    run: Excitation
    truth: Effect
    rivals: tuple[Effect, ...]


def candidates(case: Case, robot: Robot, random: np.random.Generator) -> list[Candidate]:
    """Return the ties that are to be expected of a machine, each with a cause of its own."""
    made: list[Candidate] = []
    for k in range(RUNS):
        run = poor_run(case.machine, random, 100 * case.number + k)
        taken = {one.truth.key for one in made}
        made += small_and_close(case, robot, run, random, taken)
    return made


def poor_run(machine: Machine, random: np.random.Generator, number: int) -> Excitation:
    """Return a run as people record it first: short, and slow, small or of one joint."""
    kind, duration = str(random.choice(KINDS)), float(random.uniform(SHORTEST, LONGEST))
    size = float(np.exp(random.uniform(np.log(SMALLEST), 0.0)))
    whole = Excitation(kind, number, duration, number)
    moves = reference(machine, whole)(PlannedExcitation.times(duration)) - machine.center
    return PlannedExcitation(kind, number, duration, number, 0.0, machine.center + size * moves)


def small_and_close(
    case: Case,
    robot: Robot,
    run: Excitation,
    random: np.random.Generator,
    taken: set[tuple[str, str]],
) -> list[Candidate]:
    """Return causes of the size at which others tie along a run, with those others.

    Drawn among the effects of typical size that would still be seen, those taken left out.
    """
    every = every_effect(robot)
    noise = np.asarray(case.torque_noise / np.abs(case.machine.ratio))
    rivals = Rivals(robot, tuple((effect,) for effect in every), noise, band=np.inf)
    time = np.arange(0.0, run.duration, 1.0 / _RATE)
    spline = reference(case.machine, run)
    q, v, a = (spline(time, k) for k in range(3))
    found, scale = rivals.predictions(Motion(q, v, a, time)), case.sensors.rate / _RATE
    felt = scale * np.array([found.signal(i) for i in range(len(every))])
    left = scale * _left(found, noise, len(every))
    left[left <= _ALIKE * felt[:, None]] = np.inf
    least = left.min(axis=1)
    free = np.array([effect.key not in taken for effect in every])
    seen = free & (_FELT * least < _LEFT * felt) & (least > _SMALLER * _LEFT)
    made = []
    for i in random.permutation(np.flatnonzero(seen))[:CAUSES]:
        order = np.argsort(left[i])[:_MOST]
        truth = _resized(every[i], robot, float(np.sqrt(_LEFT / least[i])))
        near = tuple(every[j] for j in order if left[i, j] < 1.5 * least[i])
        made.append(Candidate(run, truth, near))
    return made


def every_effect(robot: Robot) -> list[Effect]:
    """Return every listed effect whose torque a motion tells, at every place, of typical size."""
    found = []
    for name in LISTED:
        kind = effect_class(name)
        for where in kind.places(robot):
            effect = kind.at(where, typical_values(name, kind.null_values(robot, where)))
            try:
                require_predictable(effect, robot)
            except DesignError:
                break
            found.append(effect)
    return found


def _left(found: Predictions, noise: np.ndarray, count: int) -> np.ndarray:
    """Return (i, j) half the square that cause j, refitted, leaves of cause i [nats]."""
    nothing = found.torque(())
    torques = [((found.expected_torques[i] - nothing) / noise).ravel() for i in range(count)]
    added, left = np.stack(torques, axis=1), np.full((count, count), np.inf)
    for j in range(count):
        basis = np.linalg.qr(found.sensitivities[j])[0]
        apart = added - added[:, [j]]
        left[:, j] = 0.5 * np.sum((apart - basis @ (basis.T @ apart)) ** 2, axis=0)
    np.fill_diagonal(left, np.inf)
    return left


def _resized(effect: Effect, robot: Robot, ratio: float) -> Effect:
    null = effect.null_values(robot, effect.where)
    sizes = {p.name for p in effect.parameters if not p.shape and p.name in null}
    moved = {k: null[k] + ratio * (v - null[k]) for k, v in effect.values.items() if k in sizes}
    return effect.with_values({**effect.values, **moved})


def names(effects: Sequence[Effect]) -> list[str]:
    """Return `EFFECT@PLACE` of each."""
    return ["@".join(effect.key) for effect in effects]
