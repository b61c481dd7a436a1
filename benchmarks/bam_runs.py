"""BAM's XL330 logs: read as runs of a servo, cut into folds, written as BAM keeps them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from math import pi
from pathlib import Path

import numpy as np

from benchmarks.servo_candidates import SUPPLY
from wbc.measurement import Log, load_logs
from wbc.sim.servo_run import ServoRun

ROOT = Path(__file__).resolve().parent.parent
DATA = ROOT.parent / "shared" / "data" / "bam_servo"
STEP = 0.005  # [s]
DUTY_PER_RAD = 4096 / (2 * pi) / (256 * 885)  # times kp, the firmware's law


def read_logs(folder: Path) -> list[tuple[Log, int, str]]:
    """Return log, gain and trajectory of every run."""
    logs = load_logs([folder / "bam.parquet"], ROOT / "robots" / "xl330_pendulum" / "columns.toml")
    parts = [log.source.part.split("_", 2)[1:] for log in logs]
    return [
        (log, int(gain.removeprefix("kp")), trajectory)
        for log, (gain, trajectory) in zip(logs, parts, strict=True)
    ]


def read_runs(folder: Path) -> list[ServoRun]:
    return [
        ServoRun.from_log(log, "shaft", gain * DUTY_PER_RAD, STEP)
        for log, gain, _ in read_logs(folder)
    ]


def export(folder: Path, target: Path) -> None:
    """Write every run as BAM's own processing does: interpolated to an even clock, as JSON."""
    target.mkdir(parents=True, exist_ok=True)
    names = {
        "position": "position",
        "speed": "velocity",
        "goal_position": "goal_position",
        "torque_enable": "enabled",
    }
    for log, gain, trajectory in read_logs(folder):
        clock = np.arange(log.time[0], log.time[-1], STEP)
        series = {
            theirs: np.interp(clock, log.time, log.columns[f"shaft.{ours}"]).tolist()
            for theirs, ours in names.items()
        }
        series["torque_enable"] = [share > 0.5 for share in series["torque_enable"]]
        rows = zip(*series.values(), strict=True)
        content = {
            "motor": "xl330",
            "mass": 0.49,
            "arm_mass": 0.0,
            "length": 0.1,
            "vin": SUPPLY,
            "kp": gain,
            "trajectory": trajectory,
            "dt": STEP,
            "entries": [dict(zip(series, row, strict=True)) for row in rows],
        }
        (target / f"{log.source.part}.json").write_text(json.dumps(content), encoding="utf-8")


def folds(runs: Sequence[ServoRun]) -> dict[str, list[int]]:
    parts = [run.name.split("_", 2)[1:] for run in runs]
    result: dict[str, list[int]] = {}
    for place in (0, 1):
        for value in dict.fromkeys(part[place] for part in parts):
            result[value] = [k for k, part in enumerate(parts) if part[place] == value]
    return result
