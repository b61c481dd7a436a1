"""Make every picture of these pages anew, from the studies and commands that they show.

`make pictures` runs this; it needs Chromium for the pictures of pages. The studies run in a
temporary folder; a picture changes only when it has been made.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from pathlib import Path

from PIL import Image

from sims import (
    backdrive,
    case_study,
    demo,
    energy_flow,
    holding,
    hopping,
    impact,
    imperfect_loop,
    parallelogram,
    wedge,
)
from wbc import load_robot
from wbc.cli import main as wbc
from wbc.files import atomic_write
from wbc.identification import Diagnosis
from wbc.measurement import load_logs
from wbc.view import write_animation, write_picture
from wbc.view.browser import HeadlessBrowser
from wbc.view.impacts import log_impacts
from wbc.view.plots import residual_figure, staircase_figure, write_figure
from wbc.view.report.content import step_rows
from wbc.view.residuals import residuals_of

IMAGES = Path(__file__).resolve().parent / "images"
OUT = Path("out")  # where the studies write


def explained() -> None:
    """Stand, land and explain a log: the demo."""
    diagnosis = demo.main()
    for picture, study in (("standing", "squat"), ("power", "power"), ("landing", "landing")):
        keep(OUT / f"{study}.png", picture)
    keep(OUT / "energy.png", "energy")
    playback()
    residuals(diagnosis)
    with HeadlessBrowser(OUT / "report.html", 1100, 1000) as browser:
        browser.wait_for("window.report && window.report.ready")
        (OUT / "head.png").write_bytes(browser.screenshot())
    keep(OUT / "head.png", "report")


def playback() -> None:
    """Take the landing in motion, and a moment after the impact."""
    robot, page = load_robot("planar_leg_strong"), OUT / "landing.html"
    (hit, *_), film = log_impacts(robot, load_logs([OUT / "landing.parquet"])[0]), OUT / "fall.gif"
    write_animation(film, page, start=0.0, stop=1.0, speed=0.5, width=560, height=400)
    keep(film, "landing")
    keep(write_picture(OUT / "moment.png", page, hit.time + 1e-3, height=760), "playback")


def residuals(diagnosis: Diagnosis) -> None:
    """Draw where the model failed and how the error fell."""
    leg = load_robot("planar_leg_fixed").lossless()
    logs = load_logs([OUT / f"run{k}.csv" for k in range(3)])
    figure = residual_figure(residuals_of(leg, diagnosis.robot, logs), "with the effects found")
    keep(write_figure(OUT / "residuals.png", figure), "residuals")
    steps = [(step["label"], step["error"]) for step in step_rows(diagnosis)]
    figure = staircase_figure(steps, diagnosis.error.floor_source)
    keep(write_figure(OUT / "staircase.png", figure), "staircase")


def metrics() -> None:
    """Draw the paper's two figures."""
    for robot in ("planar_leg_fixed", "planar_leg"):
        wbc(["metrics", robot, "--figures", str(OUT)])
    keep(OUT / "planar_leg_fixed_leg.png", "ellipsoids")
    keep(OUT / "planar_leg_tradeoff.png", "tradeoff")


def designs() -> None:
    """Draw maps and front of a sweep, and the studies of choosing a gearbox."""
    sweeps = ("reduction=6:160:40:log", "forward_efficiency=0.45:0.98:40")
    command = ["design", "planar_leg", "--figures", str(OUT)]
    wbc([*command, *(part for sweep in sweeps for part in ("--sweep", sweep))])
    keep(OUT / "planar_leg_design_map.png", "design_map")
    keep(OUT / "planar_leg_design_front.png", "design_front")
    command = ["experiment", "planar_leg_fixed", "--lossless", "--speed", "6", "--span", "1"]
    command += ["--rounds", "100", "--figures", str(OUT), "--between"]
    wbc([*command, "rotor_inertia@knee", "payload_mass@shin"])
    keep(OUT / "planar_leg_fixed_experiment.png", "experiment")
    for study in (case_study, energy_flow, wedge):
        study.report(study.main())
    for name in ("case_foot", "case_efficiency", "energy_flow", "wedge"):
        keep(OUT / f"{name}.png", name)


def studies() -> None:
    """Run the other studies and keep their plots."""
    hopping.report(hopping.main())
    impact.report(impact.main())
    holding.report(holding.main())
    backdrive.report(backdrive.main())
    parallelogram.report(parallelogram.main())
    imperfect_loop.report(imperfect_loop.main(), imperfect_loop.sweeps())
    for name in ("hopping", "impact", "holding", "backdrive", "imperfect_loop"):
        keep(OUT / f"{name}.png", name)
    keep(OUT / "squat_parallelogram.png", "parallelogram")


def keep(made: Path, name: str) -> None:
    """Put a picture that was made among those of the pages."""
    target = IMAGES / f"{name}{made.suffix}"
    if made.suffix == ".gif":
        atomic_write(target, lambda file: file.write(made.read_bytes()))
    else:
        picture = Image.open(made).convert("RGB")
        if name not in ("playback", "report"):  # a plot needs few colours, a scene all of its own
            picture = picture.quantize(256, dither=Image.Dither.NONE)
        atomic_write(target, lambda file: picture.save(file, format="PNG", optimize=True))
    print(f"  {target.relative_to(IMAGES.parent.parent)}")


def main(parts: tuple[Callable[[], None], ...] = (metrics, designs, explained, studies)) -> None:
    """Make every picture."""
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        OUT.mkdir()
        for part in parts:
            part()


if __name__ == "__main__":
    main()
