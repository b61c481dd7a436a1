"""Make every picture of these pages anew, from the studies and commands that they show.

`make pictures` runs this; it needs Chromium for the pictures of pages. The studies run in a
temporary folder; a picture changes only when it has been made. Plots are made twice, for light
and for dark pages (`name.png` and `name_dark.png`). Names of parts, such as `studies`, on the
command line make only these.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

from matplotlib.figure import Figure
from PIL import Image

from sims import (
    backdrive,
    bodies,
    case_study,
    demo,
    energy_flow,
    fleet,
    holding,
    hopping,
    impact,
    imperfect_loop,
    log_to_mujoco,
    parallelogram,
    standing,
    stepping,
    trot,
    wedge,
    wedge_forces,
)
from sims.plots import sweep_figure
from wbc import load_robot, save_robot
from wbc.cli import main as wbc
from wbc.effects import CoulombFriction
from wbc.files import atomic_write
from wbc.measurement import load_logs, save_log
from wbc.view import DARK, LIGHT, Theme, write_animation, write_picture, write_playback
from wbc.view.channels import log_impacts
from wbc.view.pictures import opened
from wbc.view.plots import drawing, write_figure

IMAGES = Path(__file__).resolve().parent / "images"
OUT = Path("out")  # where the studies write
Draw = Callable[[Theme], Mapping[str, Figure]]


def explained() -> None:
    """Explain a log: the second part of the demo."""
    diagnosis, _ = demo.explain(demo.Console(markup=False), 6.0)
    plots(lambda theme: {"explained": diagnosis.plot()}, explained="explained")
    with opened(OUT / "report.html", (1100, 1000)) as page:
        page.wait_for_function("window.report && window.report.ready")
        page.screenshot(path=OUT / "head.png")
        for theme, ending in (("light", ""), ("dark", "_dark")):
            page.evaluate(f"report.setTheme('{theme}')")
            for name, place in (("residuals", "#panels"), ("staircase", "#staircase")):
                page.locator(place).screenshot(path=OUT / f"{name}{ending}.png")
    keep(OUT / "head.png", "report")
    for name in ("residuals", "residuals_dark", "staircase", "staircase_dark"):
        keep(OUT / f"{name}.png", name)


def followed() -> None:
    """Follow two legs over four days."""
    files = [str(path) for path in fleet.record_fleet()]
    leg = load_robot("planar_leg_fixed").lossless().with_effect(CoulombFriction("hip", 0.3))
    robot = save_robot(leg, "fitted.toml")
    for theme, ending in (("light", ""), ("dark", "_dark")):
        folder = OUT / theme
        wbc(["trend", *files, "--robot", str(robot), "--figures", str(folder), "--theme", theme])
        keep(folder / "trend.png", "trend" + ending)


def stood() -> None:
    """Stand, squat and land: the first part of the demo."""
    loops = standing.main(4.0)
    robot = load_robot("planar_leg_strong")
    log = loops["dissipative"].landing.log
    save_log(log, OUT / "landing.parquet")
    write_playback(OUT / "landing.html", robot, log, title="Landing from 10 cm", theme="light")
    playback()
    names = {"squat": "standing", "landing": "landing", "power": "power", "energy": "energy"}
    plots(lambda theme: standing.draw(loops, theme), **names)


def playback() -> None:
    """Take the landing in motion, and a moment after the impact."""
    robot, page = load_robot("planar_leg_strong"), OUT / "landing.html"
    (hit, *_), film = log_impacts(robot, load_logs([OUT / "landing.parquet"])[0]), OUT / "fall.gif"
    write_animation(film, page, (0.0, 1.0), speed=0.5, size=(560, 400))
    keep(film, "landing")
    keep(write_picture(OUT / "moment.png", page, hit.time + 1e-3, size=(1280, 760)), "playback")


ARM_POSE = ("--contact", "link_6", "--pose", "joint_2=0.5,joint_3=1.2,joint_5=0.6")


def metrics() -> None:
    """Draw the paper's figure of legs, of a quadruped and of an arm."""
    for theme in ("light", "dark"):
        folder = OUT / theme
        for robot, options in (
            ("planar_leg_fixed", ()),
            *(("solo12", ()), ("staubli_tx40", ARM_POSE)),
            ("differential_biped", ("--contact", "left_toe")),
        ):
            wbc(["metrics", robot, *options, "--figures", str(folder), "--theme", theme])
        ending = "" if theme == "light" else "_dark"
        keep(folder / "planar_leg_fixed_leg.png", "ellipsoids" + ending)
        keep(folder / "solo12_leg.png", "metrics_solo12" + ending)
        keep(folder / "differential_biped_leg.png", "metrics_differential" + ending)
        keep(folder / "staubli_tx40_leg.png", "metrics_arm" + ending)


ARM_DESIGN = [
    *("design", "staubli_tx40", *ARM_POSE, "--out", "arm.parquet"),
    *("--sweep", "reduction=20:160:15:log", "--sweep", "forward_efficiency=0.5:0.98:15"),
]


SOLO_DESIGN = [
    *("design", "solo12", "--out", "solo12.parquet", "--sweep", "reduction=4:40:20:log"),
    *("--sweep", "forward_efficiency=0.55:0.98:20"),
]
EXPERIMENTS = {
    "experiment": "planar_leg_fixed --speed 6 --span 1 --rounds 320 --between rotor_inertia@knee "
    "payload_mass@shin",
    "experiment_quadruped": "solo12 --speed 6 --span 0.6 --rounds 160 --between "
    "rotor_inertia@FL_KFE payload_mass@FL_LOWER_LEG",
    "experiment_link": "staubli_tx40 --speed 3 --span 1 --rounds 480 --noise 0.2 --between "
    "center_of_mass@link_4+payload_mass@link_4",
}


def designs() -> None:
    """Draw maps and front of a sweep, and the studies of choosing a gearbox."""
    sweeps = ("reduction=6:160:40:log", "forward_efficiency=0.45:0.98:40")
    command = ["design", "planar_leg", *(part for sweep in sweeps for part in ("--sweep", sweep))]
    for theme in ("light", "dark"):
        wbc([*command, "--figures", str(OUT / theme), "--theme", theme])
        ending = "" if theme == "light" else "_dark"
        keep(OUT / theme / "planar_leg_design_map.png", "design_map" + ending)
        keep(OUT / theme / "planar_leg_design_front.png", "design_front" + ending)
        wbc([*ARM_DESIGN, "--figures", str(OUT / theme), "--theme", theme])
        keep(OUT / theme / "staubli_tx40_design_map.png", "design_arm" + ending)
        wbc([*SOLO_DESIGN, "--figures", str(OUT / theme), "--theme", theme])
        keep(OUT / theme / "solo12_design_map.png", "design_solo12" + ending)
    lying = bodies.main()
    plots(lambda theme: {"bodies": bodies.figure(lying, theme)}, bodies="bodies")
    plots(case_study.draw, case_foot="case_foot", case_efficiency="case_efficiency")
    flow, blocks = energy_flow.main(), wedge.panels(wedge.main())
    plots(
        lambda theme: {
            "energy_flow": energy_flow.flow_figure(flow, theme),
            "wedge": sweep_figure(blocks, theme=theme),
        },
        energy_flow="energy_flow",
        wedge="wedge",
    )
    plots(
        lambda theme: {"wedge_forces": wedge_forces.forces_figure(theme=theme)},
        wedge_forces="wedge_forces",
    )
    keep(wedge_forces.film(OUT / "wedge_film.gif"), "wedge_film")


def experiments() -> None:
    """Plan the motions that decide."""
    for name, options in EXPERIMENTS.items():
        for theme, ending in (("light", ""), ("dark", "_dark")):
            folder, (robot, *rest) = OUT / theme, options.split()
            wbc(["experiment", robot, "--lossless", *rest, "--theme", theme,
                 "--figures", str(folder)])  # fmt: skip
            keep(folder / f"{robot}_experiment.png", name + ending)


def studies() -> None:
    """Run the other studies and keep their plots."""
    several = {"hopping": hopping, "impact": impact, "holding": holding, "backdrive": backdrive}
    for name, study in several.items():
        found = study.main()
        plots(lambda theme, study=study, found=found: study.draw(found, theme), **{name: name})
    legs = {"parallelogram": parallelogram.main()["parallelogram"]}
    plots(lambda theme: parallelogram.draw(legs, theme), squat_parallelogram="parallelogram")


def loops() -> None:
    """Run the study of imperfect loops."""
    panels = imperfect_loop.sweeps()
    plots(
        lambda theme: {"imperfect_loop": sweep_figure(panels, theme=theme)},
        imperfect_loop="imperfect_loop",
    )


def exported() -> None:
    """Explain logs of a leg and move it in MuJoCo."""
    panels = log_to_mujoco.panels(log_to_mujoco.main())
    plots(
        lambda theme: {"log_to_mujoco": sweep_figure(panels, theme=theme)},
        log_to_mujoco="log_to_mujoco",
    )


def walked() -> None:
    """Run the studies of walking and take their films."""
    found = trot.main()
    plots(lambda theme: trot.draw(found, theme), trot="trot")
    page, film = trot.film(OUT / "trot.html", 2.4), OUT / "trot.gif"
    write_animation(film, page, (0.4, 2.4), speed=0.5, size=(640, 440), frame_rate=10.0)
    keep(film, "trot")
    steps = stepping.main(engines=("MuJoCo",), scenes=("on the spot", "forward", "step"))
    plots(lambda theme: stepping.draw(steps, theme), stepping="stepping")
    page, film = stepping.film(OUT / "stepping.html", 6), OUT / "stepping.gif"
    write_animation(film, page, (0.5, 6.0), size=(600, 680), frame_rate=6.0)
    keep(film, "stepping")


def plots(draw: Draw, **names: str) -> None:
    """Keep light and dark plots; `names` are those to keep, with their names on the pages."""
    for theme, ending in ((LIGHT, ""), (DARK, "_dark")):
        with drawing(theme):
            drawn = draw(theme)
        for own, figure in drawn.items():
            if name := names.get(own):
                keep(write_figure(OUT / f"{name}{ending}.png", figure), name + ending)


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


PARTS = {
    part.__name__: part
    for part in (
        metrics,
        designs,
        experiments,
        explained,
        followed,
        stood,
        studies,
        loops,
        exported,
        walked,
    )
}


def main(names: list[str]) -> None:
    """Make the pictures of these parts, of all without any."""
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        OUT.mkdir()
        for name in names or PARTS:
            PARTS[name]()


if __name__ == "__main__":
    main(sys.argv[1:])
