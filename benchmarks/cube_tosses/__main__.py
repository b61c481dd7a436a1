"""Predict 25 measured tosses of a cube after a fit on 75: this library, MuJoCo and Drake.

    python -m benchmarks.cube_tosses [picture.png]

Each simulator starts from the first free frames of a toss. Its friction coefficient and contact law
are fitted on the speed after the first impact. Drake is no dependency of this project:
`pip install drake` adds its row.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import platform
import sys
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from time import process_time

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.controller import processor
from benchmarks.cube_tosses import picture
from benchmarks.cube_tosses.data import (
    DATA,
    length_scale,
    load,
    resting_height,
    scaled,
    sliding_friction,
)
from benchmarks.cube_tosses.engines import ENGINES, steps_per_frame
from benchmarks.cube_tosses.engines import Path as Thrown
from benchmarks.cube_tosses.scores import Trial, fit, scores

PACKAGES = {"wbc": "wbc", "wbc, compliant": "wbc", "MuJoCo": "mujoco", "Drake": "drake"}


def installed() -> dict[str, str]:
    """Return the version of every engine that is here."""
    found = {}
    for name, package in PACKAGES.items():
        try:
            found[name] = version(package)
        except PackageNotFoundError:
            print(f"{name} is not installed, its row is left out (pip install {package})")
    return found


def judged(trials: list[Trial], paths: list[Thrown]) -> dict[str, np.ndarray]:
    """Return every score of every toss."""
    each = [scores(trial, path) for trial, path in zip(trials, paths, strict=True)]
    return {key: np.array([one[key] for one in each]) for key in each[0]}


def between_starts(trials: list[Trial], parameters: tuple[float, ...]) -> dict[str, np.ndarray]:
    """Return how far this library's predictions from two halves of the first frames part."""
    throw, each = ENGINES["wbc"](*parameters), []
    for trial in trials:
        halves = (Trial.of(trial.toss, slice(i, None, 2)) for i in (0, 1))
        one, other = (throw(half.start, trial.toss.time) for half in halves)
        pretended = replace(trial.toss, position=other[0], rotation=other[1])
        each.append(scores(replace(trial, toss=pretended), one))
    return {key: np.array([one[key] for one in each]) for key in each[0]}


def row(name: str, found: dict[str, np.ndarray], contact: str, cost: str) -> list[str]:
    """Return a row of the table: medians, the share of right faces."""
    cells = [name, contact]
    for key, values in found.items():
        if key == "face":
            cells.append(f"{int(values.sum())} of {len(values)}")
        else:
            low, high = np.percentile(values, [50, 90])
            cells.append(f"{low:.2g} ({high:.2g})")
    return [*cells, cost]


def prepared() -> tuple[list[Trial], list[Trial]]:
    """Load and scale the tosses, say how; return the training and the held-out trials."""
    given = load()
    factor = length_scale([toss for toss in given if not toss.held_out])
    tosses = [scaled(toss, factor) for toss in given]
    slides = [sliding_friction(toss) for toss in tosses if not toss.held_out]
    heights = [np.median([resting_height(toss) for toss in some]) for some in (given, tosses)]
    print(
        f"lengths times {factor:.4f}: resting height {heights[0]:.3f} -> {heights[1]:.3f} half "
        f"edges; friction of slides on a face {np.nanmedian(slides):.3f}"
    )
    trials = [Trial.of(toss) for toss in tosses]
    held_out = [trial for trial in trials if trial.toss.held_out]
    jump, travel = (np.median([of(t) for t in held_out]) for of in (Trial.jump, Trial.travel))
    print(f"held out: the speed jumps by {jump:.2f} m/s, then the cube comes {1e3 * travel:.0f} mm")
    return [trial for trial in trials if not trial.toss.held_out], held_out


def main() -> dict[str, dict[str, np.ndarray]]:
    """Fit, predict, print; return the scores per engine."""
    if not DATA.exists():
        sys.exit(f"the tosses are not at {DATA}; see docs/measurements/recorded.md")
    training, held_out = prepared()
    engines = installed()
    table = Table(title=f"{len(held_out)} held-out tosses: median (90th percentile) of the error")
    for name in ("", "friction, contact", *scores(held_out[0], held_out[0].path), "us per step"):
        table.add_column(name)
    found, paths = {}, {}
    for name in engines:
        parameters = fit(name, training)
        throw, began = ENGINES[name](*parameters), process_time()
        paths[name] = [throw(trial.start, trial.toss.time) for trial in held_out]
        spent = process_time() - began
        steps = sum(steps_per_frame(t.toss.time) * (len(t.toss.time) - 1) for t in held_out)
        found[name] = judged(held_out, paths[name])
        contact = ", ".join(f"{value:.3g}" for value in parameters)
        table.add_row(*row(name, found[name], contact, f"{1e6 * spent / steps:.0f}"))
        if name == "wbc":
            table.add_row(*row("two starts", between_starts(held_out, parameters), "", ""))
    Console(width=150, markup=False).print(table)
    versions = ", ".join(f"{name} {number}" for name, number in engines.items())
    print(f"{versions}, numpy {np.__version__}, Python {platform.python_version()}, {processor()}")
    if len(sys.argv) > 1:
        picture.write(Path(sys.argv[1]), held_out, paths, found)
    return found


if __name__ == "__main__":
    main()
