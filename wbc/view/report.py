"""The report: one offline page that says what is missing, how sure that is, and where to look."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from wbc.arrays import FloatArray
from wbc.extras import needs
from wbc.files import write_text
from wbc.identification import Comparison, Diagnosis, OpenLoop
from wbc.identification.answer.comparison import compare_problem
from wbc.identification.answer.diagnosis.to_do import Commands
from wbc.identification.answer.numbers import efforts
from wbc.identification.answer.series import series_of
from wbc.identification.formulas import Discovery
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.measurement import Log, check_logs
from wbc.robot import Robot
from wbc.view.report_content import (
    correlation_table,
    dependence_rows,
    finding_cards,
    formula_part,
    headline,
    provenance_rows,
    ranked_models,
    ranking_words,
    remark_lists,
    stairs,
)
from wbc.view.residuals import LogResiduals, ResidualRun, residuals_in
from wbc.view.rows import (
    clock_rows,
    error_rows,
    left_rows,
    open_loop_rows,
    output_rows,
    short_label,
)

with needs("view", "writing a report"):
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from markupsafe import Markup
    from plotly.offline import get_plotlyjs

    from wbc.view.playback import playback_page
    from wbc.view.track import model_ghost

__all__ = ["report_page", "write_report"]

_PAGE = Path(__file__).parent / "page"
_UNIT = re.compile(
    r"(?<=\d) (?=%|N\b|kg\b|s\b|s/rad|rad|m\b|floors|noise floors)|(?<=>) (?=\d)|(?<=m) (?=s/rad)"
)


def write_report(
    path: str | Path,
    robot: Robot,
    logs: Sequence[Log],
    diagnosis: Diagnosis | None = None,
    *,
    command: str = "",
    theme: str = "",
    discovery: Discovery | None = None,
    commands: Commands | None = None,
    simulated: Sequence[OpenLoop] = (),
) -> Path:
    """Write what `compare` or `diagnose` found as one HTML file without any network.

    Top to bottom: the verdict in a sentence, what to do now, what is left at each joint in its
    unit, how far the simulated robot strays from the logs, the effects with their parameters,
    measured and modelled torque over time with the residual, the log with the model as a ghost,
    formulas proposed for the rest, the staircase of the error, which parameters move together, the
    ranked table of what else was tried, the quality of the logs, and how to reproduce it.

    Args:
        path: the file to write (whole or not at all).
        robot: the robot as it was given to `compare` or `diagnose`.
        logs: the logs, in the same order; the first one is played.
        diagnosis: what `diagnose` returned; a report of the comparison alone when left out.
        command: how to run it again, for the last section.
        theme: "light", "dark", or "" for what the reader's system prefers.
        discovery: what `discover` proposes for what the effects leave.
        commands: how to go on from the answer on the command line; in Python when left out.
        simulated: what `open_loop` returned of the robot as given, and of the corrected one.

    Raises:
        IdentificationError: logs that cannot be compared with this robot.
        LogError: a channel is missing.
    """
    page = report_page(robot, logs, diagnosis, command, theme, discovery, commands, simulated)
    return write_text(path, page)


def report_page(
    robot: Robot,
    logs: Sequence[Log],
    diagnosis: Diagnosis | None,
    command: str,
    theme: str,
    discovery: Discovery | None = None,
    commands: Commands | None = None,
    simulated: Sequence[OpenLoop] = (),
) -> str:
    """Return the HTML text of `write_report`."""
    problem = EstimationProblem.from_logs(robot, logs)
    comparison, qualities = compare_problem(problem), check_logs(logs, robot)
    context: dict[str, Any] = {
        "title": f"{robot.name}: {'comparison' if diagnosis is None else 'diagnosis'}",
        "robot": robot.name,
        "base": "free base" if robot.floating_size else "fixed base",
        "theme": theme,
        **headline(comparison, diagnosis, commands),
        "outputs": output_rows(comparison),
        "clocks": clock_rows(qualities),
        "dependences": dependence_rows(comparison),
        "quality": remark_lists(qualities),
        "floor_source": comparison.floor.source,
        "notes": list(robot.notes),
        "efforts": efforts(o.unit for o in comparison.outputs),
        "left": error_rows(comparison) if diagnosis is None else left_rows(diagnosis),
        "open_loop": open_loop_rows(simulated) if simulated else None,
        "not_simulated": simulated[-1].reason if simulated else "",
        "diagnosed": diagnosis is not None,
        "correlation": correlation_table(diagnosis),
        "provenance": provenance_rows([log.source for log in logs], command),
        "logs": [short_label(series.name) for series in comparison.series],
    }
    context |= _diagnosis_part(diagnosis, comparison) | {"formulas": formula_part(discovery)}
    context["playback"] = _embedded(_playback(robot, logs[0], comparison))
    fitted = problem.robot if diagnosis is None else diagnosis.robot
    series = series_of(fitted, problem.records)
    plots = residual_plots(residuals_in(problem, comparison.series, series))
    context["data"] = _embedded(
        {**plots, "steps": context["steps"], "fitted": bool(context["cards"])}
    )
    for name, file in (("css", "report.css"), ("script", "report.js")):
        context[name] = (_PAGE / file).read_text(encoding="utf-8")
    environment = Environment(
        loader=FileSystemLoader(_PAGE),
        undefined=StrictUndefined,
        autoescape=True,
        finalize=_unbroken,
    )
    return environment.get_template("report.html.j2").render(plotly=get_plotlyjs(), **context)


def _unbroken(value: object) -> object:
    """Return a text whose numbers stay on the line of their units; commands are Markup already."""
    if not isinstance(value, str) or isinstance(value, Markup):
        return value
    return _UNIT.sub("\u00a0", value.replace("->", "→").replace("N m", "N\u00a0m"))


def _diagnosis_part(diagnosis: Diagnosis | None, comparison: Comparison) -> dict[str, Any]:
    if diagnosis is None:
        return {key: [] for key in ("steps", "cards", "ranking", "words")} | {
            "warnings": list(comparison.warnings),
            "remainder": "",
        }
    return {
        "steps": stairs(diagnosis),
        "cards": finding_cards(diagnosis.findings),
        "ranking": ranked_models(diagnosis.ranking),
        "words": ranking_words(diagnosis.ranking),
        "warnings": list(diagnosis.warnings),
        "remainder": diagnosis.remainder,
    }


def _playback(robot: Robot, log: Log, comparison: Comparison) -> str:
    ghost = model_ghost(robot, log, comparison.floor.values, "the model as given")
    title = f"{short_label(log.source.label)} and the model as given"
    size = np.max(np.abs(np.array(list(ghost.residual.values()))), axis=0)
    worst = float(ghost.residual_time[int(np.argmax(size))])
    return playback_page(robot, log, ghost=ghost, title=title, at=worst)


def _embedded(value: object) -> str:
    """Return JSON that can stand inside a script element."""
    return json.dumps(value, separators=(",", ":")).replace("<", "\\u003c")


_ROWS = 700  # of one line: about as many as a screen has points across
_NUMBERS = 500_000  # of all lines together: some 3 MB of text
_POINTS = 450
_STRETCHES = 200  # near reversals, shaded in one plot: more would be a grey wall


def residual_plots(residuals: LogResiduals) -> dict[str, Any]:
    """Return per output: torques and residuals over time, residuals over speed, position and load.

    Args:
        residuals: of the robot as given and of the one with the effects found.
    """
    runs = residuals.runs
    rows = min(_ROWS, max(100, _NUMBERS // (6 * len(runs) * len(residuals.outputs))))
    panels = []
    for k, output in enumerate(residuals.outputs):
        before, after = (residuals.stacked(name, k) for name in ("before", "after"))
        few = slice(None, None, max(1, -(-len(before) // _POINTS)))
        panels.append(
            {
                "output": output,
                "unit": residuals.units[k],
                "floor": float(residuals.floor[k]),
                "over": [
                    {
                        "name": name,
                        "unit": unit,
                        "x": _short(x[few]),
                        "explained": [{"x": _short(c), "y": _short(mean)} for c, mean in curves],
                    }
                    for name, unit, x, curves in residuals.over(k)
                ],
                "before": _short(before[few]),
                "after": _short(after[few]),
                "runs": [_over_time(run, k, k < residuals.driven, rows) for run in runs],
            }
        )
    return {"logs": [short_label(run.given.name) for run in runs], "panels": panels}


def _over_time(run: ResidualRun, k: int, driven: bool, rows: int) -> dict[str, Any]:
    every = slice(None, None, max(1, -(-len(run.time) // rows)))
    lines = {"before": run.before, "after": run.after}
    if driven:
        lines |= {"measured": run.given.measured}
        lines |= {"given": run.given.modelled, "fitted": run.fitted.modelled}
    short = {name: _short(values[every, k]) for name, values in lines.items()}
    unused = [_short(stretch, 6) for stretch in run.unused[k][:_STRETCHES]]
    return {"t": _short(run.time[every], 6), **short, "unused": unused}


def _short(values: FloatArray, digits: int = 4) -> list[float]:
    """Return values with a few significant digits: text is what the file is made of."""
    return [float(f"{value:.{digits}g}") for value in values]
