"""The main job of the library in one run: stand a leg, explain a log, plan what to record next."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from rich.console import Console

from sims import standing
from sims.plots import write_figures
from sims.tables import print_columns
from wbc import load_robot, save_robot
from wbc.cli.design import print_experiment
from wbc.cli.models import print_diagnosis
from wbc.design.experiment import (
    MotionLimits,
    design_experiment,
    expected,
    random_paths,
    tied_rivals,
    write_set_points,
)
from wbc.effects import CoulombFriction, TransmissionEfficiency
from wbc.identification import Diagnosis, compare, diagnose
from wbc.identification.answer.words import Commands
from wbc.measurement import load_log, load_logs, save_log
from wbc.sim.excitation import record_with
from wbc.view import write_playback
from wbc.view.report import write_report

OUT = Path("out")
LOOPS = (
    "dissipative: lossy gears, and the controller knows the losses; conservative: the same gears, "
    "and the controller believes them perfect; ideal: perfect gears. The aim is a small height "
    "error: torque and heat of the dissipative loop may be larger."
)
"""Says above the first table what its columns are."""


def stand(console: Console, duration: float) -> list[Path]:
    """Compare three closed loops of the leg; return the files written."""
    console.rule("1. Stand, squat and land on lossy gears")
    loops = standing.main(duration, progress=console.is_terminal)
    console.print(LOOPS)
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
    hidden = [TransmissionEfficiency("knee", 0.8, 0.75), CoulombFriction("hip", 0.5)]
    console.print("hidden in the plant: " + ", ".join(map(str, hidden)))
    runs = record_with(leg, hidden, duration=duration)
    written = [save_log(log, OUT / f"run{i}.csv") for i, log in enumerate(runs)]
    logs = load_logs(written)
    console.print(compare(leg, logs).error_rows())
    diagnosis = diagnose(leg, logs)
    commands = Commands(
        list(map(str, written)),
        "planar_leg_fixed",
        saved=str(OUT / "fitted.toml"),
        lossless=True,
    )
    print_diagnosis(console, diagnosis, commands)
    console.print(compare(diagnosis.robot, logs).error_rows())
    written += [
        save_robot(diagnosis.robot, OUT / "fitted.toml", diagnosis.intervals()),
        write_report(
            OUT / "report.html",
            leg,
            logs,
            diagnosis,
            command="make demo",
            commands=commands,
        ),
    ]
    return diagnosis, written


def plan(console: Console, diagnosis: Diagnosis, duration: float, rounds: int) -> list[Path]:
    """Plan the motion that would tell what was found from its closest rival; return its files."""
    console.rule("3. The motion that would tell the two closest rivals apart")
    if diagnosis.verdict == "named":
        console.print(
            "An example, not needed here: the logs of part 2 already tell which effects the model "
            "lacks. Where several causes explain the logs equally well, record such a motion."
        )
    leg = load_robot("planar_leg_fixed").lossless()
    tied = tied_rivals(diagnosis.to_json(), leg, noise=0.01 * leg.transmission.torque_limit)
    rivals = replace(tied, causes=tied.causes[:2])
    limits = MotionLimits.of(leg, span=1.0, speed=6.0)
    designed = design_experiment(rivals, limits, duration, rounds=rounds)
    chance = expected(rivals, limits, next(random_paths(rivals, limits, duration, 1, 1)))
    print_experiment(rivals, {"random": chance, "designed": designed}, console)
    path = write_set_points(OUT / "trajectory.csv", leg, designed.path, rate=100.0)
    return [
        path,
        write_playback(
            OUT / "trajectory.html", leg, load_log(path), title="The motion that decides"
        ),
    ]


def main(duration: float = 2.0, excitation: float = 6.0, rounds: int = 320) -> Diagnosis:
    """Run the three parts, print their tables and say where the files are."""
    console = Console(markup=False, highlight=False)
    OUT.mkdir(exist_ok=True)
    files = stand(console, duration)
    diagnosis, more = explain(console, excitation)
    planned = plan(console, diagnosis, 10.0, rounds)
    console.rule("4. Files")
    for path in [*files, *more, *planned]:
        console.print(f"  {path}")
    for line in last_lines(diagnosis.verdict):
        console.print(line, soft_wrap=True)
    return diagnosis


def last_lines(verdict: str) -> list[str]:
    """Return the pages to open, and the next step: use what is certain, or record what decides."""
    sure = verdict == "named"
    example = " (an example)" if sure else ""
    fitted = OUT / "fitted.toml"
    logs = " ".join(str(OUT / f"run{k}.csv") for k in range(3))
    step = (
        f"use the corrected model: wbc compare {logs} --robot {fitted}"
        if sure
        else f"move the robot along {OUT / 'trajectory.csv'} (set points) and record a log"
    )
    return [
        "open in a browser, offline:",
        "  out/landing.html     the leg lands from 10 cm",
        "  out/report.html      what the logs say of the leg",
        f"  out/trajectory.html  the motion that tells the two closest rivals apart{example}",
        f"next: {step}",
    ]


if __name__ == "__main__":
    main()
