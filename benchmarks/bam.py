"""A servo's missing physics, found by rollouts: candidates on the logs of BAM, fold by fold.

    python benchmarks/bam.py [FOLDER with bam.parquet] [--quick]

Every candidate is a set of effects of the library plus what the DC drive may lack. It is fitted
by output error and judged on runs it has not seen: one gain left out, then one trajectory. The
table gives the mean absolute position error of the rollouts in mrad, per fold, and CPU seconds.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping, Sequence
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
from wbc.identification.servo_fit import ServoFit, Span, fit_servo
from wbc.measurement import load_logs
from wbc.robot import Robot
from wbc.robot.dc_drive import DcDrive
from wbc.sim.servo_run import ServoRun

ROOT = Path(__file__).resolve().parent.parent
STEP = 0.005
SUPPLY = 7.4
DUTY_PER_RAD = 4096 / (2 * pi) / (256 * 885)  # times kp, the firmware's law
HOLD = 0.5  # [rad] per doubling: what a fold leaves open stays near the values below
# Starts: BAM's published model M3 of this servo; round numbers where it has none.
SPANS = {
    "torque_constant": Span(0.1, 0.38, 1.5),
    "resistance": Span(0.5, 3.38, 12.0),
    "armature": Span(1e-4, 0.00192, 0.02),
    "coulomb": Span(0.0, 0.0089, 0.2),
    "viscous": Span(0.0, 0.0044, 0.1),
    "load": Span(0.0, 0.122, 0.9),
    "stribeck": Span(0.0, 0.01, 0.2),
    "stribeck_speed": Span(0.02, 0.5, 5.0),
    "source_resistance": Span(0.0, 1.0, 8.0),
    "current_limit": Span(0.2, 2.0, 5.0),
}
# Sticking makes the error of a rollout jump: more than one start saves a fit from a poor valley.
STARTS: tuple[dict[str, float], ...] = (
    {},
    {"load": 0.25, "stribeck": 0.03, "source_resistance": 3.0, "current_limit": 1.5},
    {"load": 0.25, "resistance": 3.0, "viscous": 0.002, "source_resistance": 2.0},
)
BASE = ("torque_constant", "resistance", "armature", "coulomb", "viscous")
LOAD = (*BASE, "load", "stribeck", "stribeck_speed")
CANDIDATES = {
    "coulomb, viscous": BASE,
    "+ load friction": (*BASE, "load"),
    "+ stribeck": LOAD,
    "+ supply sag": (*LOAD, "source_resistance"),
    "+ current limit": (*LOAD, "current_limit"),
    "+ both": (*LOAD, "source_resistance", "current_limit"),
}


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
    drive = DcDrive(SUPPLY, values.get("source_resistance", 0.0), values.get("current_limit", inf))
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


def fit(base: Robot, names: Sequence[str], runs: Sequence[ServoRun]) -> ServoFit:
    spans = {name: SPANS[name] for name in names}
    return fit_servo(lambda v: servo(base, v), spans, runs, STEP, STARTS, hold=HOLD)


def main(folder: Path, *, quick: bool = False) -> dict[str, dict[str, float]]:
    base, runs = load_robot("xl330_pendulum"), read_runs(folder)
    cuts = folds(runs)
    figures: dict[str, dict[str, float]] = {}
    head = ["fit", *cuts, "mean"]
    print(f"{len(runs)} runs; mean absolute position error [mrad] on the fold left out")
    print(f"{'':18s}" + "".join(f"{name[:9]:>10s}" for name in head) + f"{'CPU s/fit':>10s}")
    for name, free in CANDIDATES.items():
        start = time.process_time()
        found = fit(base, free, runs)
        row = {"fit": 1e3 * float(found.error(runs, STEP).mean())}
        seconds = time.process_time() - start
        for cut, inside in {} if quick else cuts.items():
            rest = [run for k, run in enumerate(runs) if k not in inside]
            held = [runs[k] for k in inside]
            row[cut] = 1e3 * float(fit(base, free, rest).error(held, STEP).mean())
        row["mean"] = float(np.mean([row[cut] for cut in cuts if cut in row] or [np.nan]))
        print(
            f"{name:18s}"
            + "".join(f"{row.get(key, np.nan):10.1f}" for key in head)
            + f"{seconds:10.1f}",
            flush=True,
        )
        print("    " + ", ".join(f"{key} {value:.4g}" for key, value in found.values.items()))
        figures[name] = row
    return figures


if __name__ == "__main__":
    given = [Path(word) for word in sys.argv[1:] if not word.startswith("-")]
    default = ROOT.parent / "shared" / "data" / "bam_servo"
    main(given[0] if given else default, quick="--quick" in sys.argv)
