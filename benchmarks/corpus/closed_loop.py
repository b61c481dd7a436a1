"""Pendulums and two-link arms under a joint controller, many runs side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.corpus.case import Case
from benchmarks.corpus.excitation import Excitation, reference
from benchmarks.corpus.lanes import Lanes
from benchmarks.corpus.stepping import STEP, SteppedArms

Run = tuple[Case, Excitation]


@dataclass(frozen=True, eq=False)
class Trace:
    """What perfect sensors would have seen at the motor outputs: q, v, reported torque, (N, m)."""

    time: np.ndarray
    q: np.ndarray
    v: np.ndarray
    torque: np.ndarray


def run_lanes(runs: Sequence[Run], rate: float) -> list[Trace]:
    """Return what sensors at `rate` [Hz] see of every run; runs do not touch one another."""
    lanes = Lanes([case.machine for case, _ in runs], [case.flaws for case, _ in runs])
    steps = round(max(excitation.duration for _, excitation in runs) / STEP)
    every = round(1.0 / rate / STEP)
    times = np.arange(steps) * STEP
    arms = SteppedArms(lanes, _wanted(runs, times))
    rows = [arms.step(k, float(t)) for k, t in enumerate(times)][::every]
    seen = [np.array(part) for part in zip(*rows, strict=True)]
    traces = []
    for b, (case, excitation) in enumerate(runs):
        n, count = len(case.machine.driven), round(excitation.duration * rate)
        traces.append(Trace(np.arange(count) / rate, *(part[:count, b, :n] for part in seen)))
    return traces


def _wanted(runs: Sequence[Run], times: np.ndarray) -> np.ndarray:
    """Return reference position and velocity, (2, T, B, 2); runs that end early hold on."""
    wanted = np.zeros((2, len(times), len(runs), 2))
    for b, (case, excitation) in enumerate(runs):
        path = reference(case.machine, excitation)
        n, inside = len(case.machine.driven), times <= excitation.duration
        wanted[0, :, b, :n] = path(np.minimum(times, excitation.duration))
        wanted[1, inside, b, :n] = path(times[inside], 1)
    return wanted
