"""Two legs recorded on four days; the friction in the hip of the second one grows."""

from __future__ import annotations

from pathlib import Path

from wbc import load_robot
from wbc.effects import CoulombFriction
from wbc.measurement import save_log
from wbc.sim.excitation import ENCODER, record_run

DAYS = ("2026-03-01", "2026-03-08", "2026-03-15", "2026-03-22")
LEVELS = {"leg_1": (0.30, 0.30, 0.30, 0.30), "leg_2": (0.30, 0.35, 0.40, 0.45)}  # [N m]


def record_fleet(folder: str | Path = "fleet", duration: float = 2.5) -> list[Path]:
    """Write one log per leg and day, `folder/LEG/DAY.csv`; return the files.

    Args:
        folder: is made where it is missing.
        duration: of each log [s].
    """
    believed = load_robot("planar_leg_fixed").lossless()
    files: list[Path] = []
    for leg, levels in LEVELS.items():
        for week, (day, level) in enumerate(zip(DAYS, levels, strict=True)):
            real = believed.with_effect(CoulombFriction("hip", level))
            run = record_run(real, believed, seed=week, duration=duration)
            log = ENCODER.measure(real, run, seed=len(files))
            file = Path(folder, leg, f"{day}.csv")
            file.parent.mkdir(parents=True, exist_ok=True)
            files.append(save_log(log, file))
    return files


if __name__ == "__main__":
    for path in record_fleet():
        print(path)
