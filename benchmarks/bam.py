"""A servo's missing physics, found by rollouts: candidates on the logs of BAM, fold by fold.

    python benchmarks/bam.py [FOLDER with bam.parquet] [--quick]

Every candidate is a set of effects of the library plus what the DC drive may lack. It is fitted
by output error and judged on runs it has not seen: one gain left out, then one trajectory; the
figures are mean absolute position errors of the rollouts in mrad. Which numbers are held near
their starts is chosen inside each fold, by leaving out one more gain or trajectory of its training
runs, and in the last row the candidate is chosen so as well: that row is what to expect of the
whole procedure on runs it has not seen.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import inf, pi
from pathlib import Path

import numpy as np

from wbc.effects import (
    CoulombFriction,
    LoadFriction,
    StribeckFriction,
    ViscousFriction,
    load_robot,
)
from wbc.identification.servo_fit import ServoFit, Span, fit_servos, servo_errors
from wbc.measurement import load_logs
from wbc.robot import Robot
from wbc.robot.dc_drive import DcDrive
from wbc.sim.servo_run import ServoRun

ROOT = Path(__file__).resolve().parent.parent
STEP = 0.005
SUPPLY = 7.4
DUTY_PER_RAD = 4096 / (2 * pi) / (256 * 885)  # times kp, the firmware's law
ITERATIONS = 25
# Data sheet of the XL330-M288 at 5 V: stalls with 0.52 N m and 1.47 A, idles at 103 rpm. That puts
# the torque constant between 0.354 (all losses inside) and 0.464 N m/A and the resistance at
# 3.40 ohm. Round numbers elsewhere.
SPANS = {
    "torque_constant": Span(0.1, 0.41, 1.5),
    "resistance": Span(0.5, 3.4, 12.0),
    "armature": Span(1e-4, 0.002, 0.02),
    "coulomb": Span(0.0, 0.01, 0.2),
    "viscous": Span(0.0, 0.005, 0.1),
    "load": Span(0.0, 0.2, 0.9),
    "stribeck": Span(0.0, 0.01, 0.2),
    "stribeck_speed": Span(0.02, 0.5, 5.0),
    "source_resistance": Span(0.0, 1.0, 8.0),
    "current_limit": Span(0.2, 1.75, 5.0),
    "heating": Span(0.0, 0.02, 1.0),
    "cooling": Span(0.0, 0.1, 3.0),
}
# Sticking makes the error of a rollout jump: a second start saves a fit from a poor valley.
STARTS: tuple[dict[str, float], ...] = (
    {},
    {
        "load": 0.4,
        "stribeck": 0.03,
        "source_resistance": 3.0,
        "current_limit": 1.2,
        "heating": 0.1,
        "cooling": 1.0,
    },
)
# What the runs leave open stays near the starts above: [rad] per doubling.
HOLDS = {
    "sheet held": {"torque_constant": 0.1, "resistance": 0.1},
    "all held": dict.fromkeys(SPANS, 0.1),
}
BASE = ("torque_constant", "resistance", "armature", "coulomb", "viscous")
LOAD = (*BASE, "load", "stribeck", "stribeck_speed")
CANDIDATES = {
    "coulomb, viscous": BASE,
    "+ load friction": (*BASE, "load"),
    "+ stribeck": LOAD,
    "+ supply sag": (*LOAD, "source_resistance"),
    "+ current limit": (*LOAD, "current_limit"),
    "+ sag, limit": (*LOAD, "source_resistance", "current_limit"),
    "+ warm winding": (*LOAD, "heating", "cooling"),
}


@dataclass(frozen=True)
class Trial:
    """One candidate with some numbers held, on all folds.

    Attributes:
        fit: to all runs.
        seen: its error on them [mrad].
        outer: error on each fold left out [mrad].
        inner: for each fold left out, the mean error over the others, each left out, too [mrad].
        seconds: CPU time of all fits.
        fits: how many those are.
    """

    fit: ServoFit
    seen: float
    outer: np.ndarray
    inner: np.ndarray
    seconds: float
    fits: int


def servo(base: Robot, values: Mapping[str, float]) -> tuple[Robot, DcDrive]:
    gears = base.transmission
    for name, value in (
        ("torque_constant", values["torque_constant"]),
        ("resistance", values["resistance"]),
        ("rotor_inertia", values["armature"]),
    ):
        gears = gears.with_value(name, "shaft", value)
    robot = base.with_transmission(gears).with_effects(
        CoulombFriction("shaft", values["coulomb"]),
        ViscousFriction("shaft", values["viscous"]),
        LoadFriction("shaft", values.get("load", 0.0)),
        StribeckFriction("shaft", values.get("stribeck", 0.0), values.get("stribeck_speed", 0.5)),
    )
    drive = DcDrive(
        SUPPLY,
        source_resistance=values.get("source_resistance", 0.0),
        current_limit=values.get("current_limit", inf),
        heating=values.get("heating", 0.0),
        cooling=values.get("cooling", 0.0),
    )
    return robot, drive


def read_runs(folder: Path) -> list[ServoRun]:
    logs = load_logs([folder / "bam.parquet"], ROOT / "robots" / "xl330_pendulum" / "columns.toml")
    gains = [float(log.source.part.split("_")[1].removeprefix("kp")) for log in logs]
    return [
        ServoRun.from_log(log, "shaft", gain * DUTY_PER_RAD, STEP)
        for log, gain in zip(logs, gains, strict=True)
    ]


def folds(runs: Sequence[ServoRun]) -> dict[str, list[int]]:
    parts = [run.name.split("_", 2)[1:] for run in runs]
    result: dict[str, list[int]] = {}
    for place in (0, 1):
        for value in dict.fromkeys(part[place] for part in parts):
            result[value] = [k for k, part in enumerate(parts) if part[place] == value]
    return result


def try_out(
    base: Robot, names: Sequence[str], runs: Sequence[ServoRun], hold: Mapping[str, float]
) -> Trial:
    """Fit all runs, all but each fold, and all but each pair of folds."""
    cuts, everything = list(folds(runs).values()), range(len(runs))
    pairs = list(combinations(range(len(cuts)), 2))
    outside = [[], *cuts, *(cuts[i] + cuts[j] for i, j in pairs)]
    start = time.process_time()
    fits = fit_servos(
        lambda values: servo(base, values),
        {name: SPANS[name] for name in names},
        runs,
        STEP,
        [[k for k in everything if k not in out] for out in outside],
        STARTS,
        ITERATIONS,
        {name: weight for name, weight in hold.items() if name in names},
    )
    seconds = time.process_time() - start
    errors = 1e3 * servo_errors(fits, runs, STEP)
    inner = np.zeros((len(cuts), len(cuts)))
    for row, (i, j) in zip(errors[1 + len(cuts) :], pairs, strict=True):
        inner[i, j] = row[[k for k in cuts[j] if k not in cuts[i]]].mean()
        inner[j, i] = row[[k for k in cuts[i] if k not in cuts[j]]].mean()
    outer = np.array([row[cut].mean() for row, cut in zip(errors[1:], cuts, strict=False)])
    means = inner.sum(axis=1) / (len(cuts) - 1)
    return Trial(fits[0], float(errors[0].mean()), outer, means, seconds, len(fits))


def chosen(trials: Sequence[Trial]) -> tuple[np.ndarray, list[int]]:
    """Return the folds' errors if each takes the trial with the least inner error, and which."""
    best = np.argmin([trial.inner for trial in trials], axis=0)
    return np.array([trials[b].outer[k] for k, b in enumerate(best)]), best.tolist()


def line(name: str, seen: float | None, outer: np.ndarray, *rest: str) -> None:
    first = " " * 10 if seen is None else f"{seen:10.1f}"
    numbers = "".join(f"{x:10.1f}" for x in (*outer, outer.mean()))
    print(f"{name:29s}" + first + numbers + "".join(rest), flush=True)


def main(folder: Path, *, quick: bool = False) -> dict[str, np.ndarray]:
    base, runs = load_robot("xl330_pendulum"), read_runs(folder)
    cuts = list(folds(runs))
    names = list(CANDIDATES)[3:5] if quick else list(CANDIDATES)
    holds = list(HOLDS)[:1] if quick else list(HOLDS)
    print(f"{len(runs)} runs; mean absolute position error [mrad] on the fold left out")
    head = ["fit", *cuts, "mean"]
    print(f"{'':29s}" + "".join(f"{key[:9]:>10s}" for key in head) + f"{'CPU s/fit':>11s}")
    trials: dict[str, list[Trial]] = {}
    for name in names:
        trials[name] = [try_out(base, CANDIDATES[name], runs, HOLDS[hold]) for hold in holds]
        for hold, trial in zip(holds, trials[name], strict=True):
            cost = f"{trial.seconds / trial.fits:11.2f}"
            line(f"{name}, {hold}", trial.seen, trial.outer, cost)
            values = trial.fit.values.items()
            print("    " + ", ".join(f"{key} {value:.4g}" for key, value in values))
    print("what is held chosen inside each fold")
    rows = {name: chosen(trials[name])[0] for name in names}
    for name, outer in rows.items():
        line(name, None, outer)
    flat = [(name, hold, t) for name in names for hold, t in zip(holds, trials[name], strict=True)]
    rows["chosen"], picks = chosen([trial for *_, trial in flat])
    line("candidate chosen, too", None, rows["chosen"])
    for cut, pick in zip(cuts, picks, strict=True):
        print(f"    {cut}: {flat[pick][0]}, {flat[pick][1]}")
    first = "+ supply sag"
    for name in [other for other in names if other != first]:
        gap = rows[name] - rows[first]
        error = gap.std(ddof=1) / np.sqrt(gap.size)
        print(f"{name} minus {first}: {gap.mean():.1f} +- {error:.1f} mrad over the folds")
    print(f"{sum(t.seconds for *_, t in flat):.0f} CPU s for all fits")
    return rows


if __name__ == "__main__":
    given = [Path(word) for word in sys.argv[1:] if not word.startswith("-")]
    default = ROOT.parent / "shared" / "data" / "bam_servo"
    main(given[0] if given else default, quick="--quick" in sys.argv)
