"""The main job of the library in one run: stand a leg on lossy gears, then explain a log."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console

from sims import standing
from sims.plots import write_figures
from sims.tables import print_columns
from wbc import load_robot, save_robot
from wbc.cli.logs.compare import error_table
from wbc.cli.logs.diagnose import print_diagnosis
from wbc.effects import CoulombFriction, TransmissionEfficiency
from wbc.identification import Diagnosis, compare, diagnose
from wbc.measurement import save_log
from wbc.sim.excitation import record_with
from wbc.view import write_playback
from wbc.view.report import write_report

OUT = Path("out")


def stand(console: Console, duration: float) -> list[Path]:
    """Compare three closed loops of the leg; return the files written."""
    console.rule("1. Stand, squat and land on lossy gears")
    loops = standing.main(duration, progress=console.is_terminal)
    print_columns("planar leg, 60 N m motors (assumed)", {k: v.figures for k, v in loops.items()})
    robot = load_robot("planar_leg_strong")
    ours = loops["dissipative"]
    return [
        save_log(ours.squat.log, OUT / "squat.parquet"),
        save_log(ours.landing.log, OUT / "landing.parquet"),
        write_playback(
            OUT / "landing.html",
            robot,
            ours.landing.log,
            marks=ours.landing.marks,
            title="Landing from 10 cm",
        ),
        *write_figures(OUT, standing.draw(loops)),
    ]


def explain(console: Console, duration: float) -> tuple[Diagnosis, list[Path]]:
    """Hide two effects in a leg, record it, and find them; return the diagnosis and files."""
    console.rule("2. Explain a log")
    leg = load_robot("planar_leg_fixed").lossless()
    hidden = [TransmissionEfficiency.wedge("knee", 0.8), CoulombFriction("hip", 0.5)]
    console.print("hidden in the plant: " + ", ".join(map(str, hidden)))
    logs = record_with(leg, hidden, duration=duration)
    console.print(error_table(compare(leg, logs)))
    diagnosis = diagnose(leg, logs)
    print_diagnosis(console, diagnosis)
    console.print(error_table(compare(diagnosis.robot, logs)))
    written = [save_log(log, OUT / f"run{i}.csv") for i, log in enumerate(logs)]
    written += [
        save_robot(diagnosis.robot, OUT / "fitted.toml", diagnosis.intervals()),
        write_report(OUT / "report.html", leg, logs, diagnosis, command="make demo"),
    ]
    return diagnosis, written


def main(duration: float = 4.0, excitation: float = 6.0) -> Diagnosis:
    """Run both parts, print their tables and say where the files are."""
    console = Console(markup=False, highlight=False)
    OUT.mkdir(exist_ok=True)
    files = stand(console, duration)
    diagnosis, more = explain(console, excitation)
    console.rule("3. Files")
    for path in [*files, *more]:
        console.print(f"  {path}")
    console.print("open out/landing.html (playback) and out/report.html in a browser, offline")
    return diagnosis


if __name__ == "__main__":
    main()
