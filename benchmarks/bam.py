"""A servo's missing physics, found by rollouts: candidates on the logs of BAM, fold by fold.

    python -m benchmarks.bam [FOLDER with bam.parquet] [--quick] [--export FOLDER]

Every candidate is a set of effects of the library plus what the DC drive may lack. It is fitted
by output error and judged on runs it has not seen: one gain left out, then one trajectory; the
figures are mean absolute position errors of the rollouts in mrad. What is used on a fold is
chosen inside it, by leaving out one more gain or trajectory of its training runs: which numbers
are held near their starts, and in the rows of the procedures the candidates, too. Those rows are
what to expect of a whole procedure on runs it has not seen.

With --export nothing is fitted: the runs are written as BAM keeps them, for its own search
(`benchmarks/peers/bam_search.py`).
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.bam_runs import DATA, STEP, export, folds, read_runs
from benchmarks.servo_candidates import (
    CANDIDATES,
    ELECTRICAL,
    HOLDS,
    RIVALS,
    SPANS,
    STARTS,
    servo,
)
from benchmarks.servo_choice import PROCEDURES, Forecasts, forecasts, least, outsides
from wbc.effects import load_robot
from wbc.identification.servo.servo_fit import ServoFit, fit_servos
from wbc.robot import Robot
from wbc.sim.servo_rollout import servo_rollout
from wbc.sim.servo_run import ServoRun

ITERATIONS = 25


@dataclass(frozen=True)
class Trial:
    """One candidate with some numbers held: fits to all runs, without each fold, without two.

    Attributes:
        name, hold: of the candidate and of what is held.
        size: how many numbers it has.
        fit: to all runs.
        positions: (T, F, L) rollouts of the F fits in all L runs [rad].
        seconds: CPU time per fit.
    """

    name: str
    hold: str
    size: int
    fit: ServoFit
    positions: np.ndarray
    seconds: float

    @property
    def electrical(self) -> bool:
        return any(name in self.fit.values for name in ELECTRICAL)


@dataclass(frozen=True)
class Bench:
    """The runs, their folds and the measured positions (T, L) [rad]."""

    robot: Robot
    runs: list[ServoRun]
    cuts: dict[str, list[int]]
    measured: np.ndarray

    @classmethod
    def read(cls, folder: Path) -> Bench:
        runs = read_runs(folder)
        measured = np.stack([run.position for run in runs], axis=1)
        return cls(load_robot("xl330_pendulum"), runs, folds(runs), measured)

    def try_out(self, name: str, hold: str) -> Trial:
        numbers = CANDIDATES.get(name) or RIVALS[name]
        left_out = outsides(list(self.cuts.values()))
        start = time.process_time()
        fits = fit_servos(
            lambda values: servo(self.robot, values),
            {number: SPANS[number] for number in numbers},
            self.runs,
            STEP,
            [[k for k in range(len(self.runs)) if k not in out] for out in left_out],
            STARTS,
            ITERATIONS,
            {number: weight for number, weight in HOLDS[hold].items() if number in numbers},
        )
        seconds = (time.process_time() - start) / len(fits)
        positions = servo_rollout([(fit.robot, fit.drive) for fit in fits], self.runs, STEP)
        return Trial(name, hold, len(numbers), fits[0], positions, seconds)

    def choices(
        self, trials: Sequence[Trial], procedure: Callable[[Forecasts], np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return each fold's error (folds,) [mrad] and the weights (folds, trials) used on it."""
        positions = np.stack([trial.positions for trial in trials])
        sizes, cuts = np.array([trial.size for trial in trials]), list(self.cuts.values())
        errors, weights = [], []
        for k, cut in enumerate(cuts):
            known = forecasts(positions, self.measured, cuts, sizes, k)
            weights.append(procedure(known))
            mean = np.tensordot(weights[-1], positions[:, :, 1 + k, cut], axes=1)
            errors.append(1e3 * np.abs(mean - self.measured[:, cut]).mean())
        return np.array(errors), np.array(weights)

    def print_trial(self, trial: Trial) -> None:
        errors = 1e3 * np.abs(trial.positions - self.measured[:, None]).mean(axis=0)
        outer = [errors[1 + k, cut].mean() for k, cut in enumerate(self.cuts.values())]
        line(f"{trial.name}, {trial.hold}", errors[0].mean(), outer, f"{trial.seconds:11.2f}")
        print("    " + ", ".join(f"{key} {value:.4g}" for key, value in trial.fit.values.items()))


def line(name: str, seen: float | None, outer: Sequence[float] | np.ndarray, *rest: str) -> None:
    first = " " * 10 if seen is None else f"{seen:10.1f}"
    numbers = "".join(f"{x:10.1f}" for x in (*outer, np.mean(outer)))
    print(f"{name:35s}" + first + numbers + "".join(rest), flush=True)


def print_gaps(rows: Mapping[str, np.ndarray], first: str) -> None:
    for name in [other for other in rows if other != first]:
        gap = rows[name] - rows[first]
        error = gap.std(ddof=1) / np.sqrt(gap.size)
        print(f"{name} minus {first}: {gap.mean():.1f} +- {error:.1f} mrad over the folds")


def print_choices(bench: Bench, offered: Sequence[Trial]) -> dict[str, np.ndarray]:
    print("candidate chosen inside each fold, too")
    rows = {}
    for label, procedure in PROCEDURES.items():
        rows[label], weights = bench.choices(offered, procedure)
        line(label, None, rows[label])
        for cut, row in zip(bench.cuts, weights, strict=True):
            used = [(w, t) for w, t in zip(row, offered, strict=True) if w > 0.005]
            share = sum(w for w, t in used if t.electrical)
            text = "; ".join(f"{w:.2f} {t.name}, {t.hold}" for w, t in used)
            print(f"    {cut}: electrical {share:.2f}: {text}")
    return rows


def print_choices_from_fewer(bench: Bench, offered: Sequence[Trial]) -> dict[str, np.ndarray]:
    """Stack without the candidates that have a term: how much that term is needed."""
    print("stacked from fewer")
    rows = {}
    for label, without in (
        ("no electrical term", ELECTRICAL),
        ("no load friction near rest", ("load_stribeck",)),
        ("no warm winding", ("heating",)),
    ):
        fewer = [t for t in offered if not any(name in t.fit.values for name in without)]
        rows[label], _ = bench.choices(fewer, PROCEDURES["stacked"])
        line(label, None, rows[label])
    return rows


def main(folder: Path, *, quick: bool = False) -> dict[str, np.ndarray]:
    bench = Bench.read(folder)
    names = [*CANDIDATES][4:6] if quick else [*CANDIDATES, *RIVALS]
    print(f"{len(bench.runs)} runs; mean absolute position error [mrad] on the fold left out")
    head = ["fit", *bench.cuts, "mean"]
    print(f"{'':35s}" + "".join(f"{key[:9]:>10s}" for key in head) + f"{'CPU s/fit':>11s}")
    trials = []
    for name in names:
        for hold in HOLDS:
            trials.append(bench.try_out(name, hold))
            bench.print_trial(trials[-1])
    print("what is held chosen inside each fold")
    rows = {}
    for name in names:
        rows[name], _ = bench.choices([t for t in trials if t.name == name], least)
        line(name, None, rows[name])
    print_gaps(rows, names[0] if quick else "+ load stribeck, sag")
    offered = [trial for trial in trials if trial.name in CANDIDATES]
    rows |= print_choices(bench, offered)
    if not quick:
        rows |= print_choices_from_fewer(bench, offered)
    fits = trials[0].positions.shape[1]
    print(f"{sum(fits * trial.seconds for trial in trials):.0f} CPU s for all fits")
    return rows


if __name__ == "__main__":
    reader = argparse.ArgumentParser()
    reader.add_argument("folder", nargs="?", type=Path, default=DATA)
    reader.add_argument("--quick", action="store_true")
    reader.add_argument("--export", type=Path)
    given = reader.parse_args()
    if given.export:
        export(given.folder, given.export)
    else:
        main(given.folder, quick=given.quick)
