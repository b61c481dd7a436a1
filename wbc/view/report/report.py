"""The report: one offline page that says what is missing, how sure that is, and where to look."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from wbc.files import write_text
from wbc.identification import Comparison, Diagnosis, OpenLoop
from wbc.identification.answer.comparison.compare import compare_problem
from wbc.identification.answer.diagnosis.to_do import Commands
from wbc.identification.answer.numbers import efforts
from wbc.identification.answer.series import series_of
from wbc.identification.formulas import Discovery
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.measurement import Log, check_logs
from wbc.robot import Robot
from wbc.view.playback.ghost import model_ghost
from wbc.view.playback.playback import playback_page
from wbc.view.quantities.residuals import residuals_in
from wbc.view.report.content import (
    correlation_table,
    dependence_rows,
    finding_cards,
    headline,
    left_rows,
    log_name,
    open_loop_part,
    output_rows,
    provenance_rows,
    quality_rows,
    ranking_rows,
    ranking_words,
    step_rows,
)
from wbc.view.report.formulas import formula_part
from wbc.view.report.plot_data import residual_plots

_PAGE = Path(__file__).parent / "page"
_UNIT = re.compile(r"(?<=\d) (?=%|N\b|kg\b|s\b|s/rad|rad|m\b|floors|noise floors)|(?<=>) (?=\d)")


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
    comparison = compare_problem(problem)
    context: dict[str, Any] = {
        "title": f"{robot.name}: {'comparison' if diagnosis is None else 'diagnosis'}",
        "robot": robot.name,
        "base": "free base" if robot.floating_size else "fixed base",
        "theme": theme,
        **headline(comparison, diagnosis, commands),
        "outputs": output_rows(comparison),
        "dependences": dependence_rows(comparison),
        "quality": quality_rows(check_logs(logs, robot)),
        "floor_source": comparison.floor.source,
        "notes": list(robot.notes),
        "efforts": efforts(o.unit for o in comparison.outputs),
        "left": left_rows(comparison, diagnosis),
        "open_loop": open_loop_part(simulated),
        "diagnosed": diagnosis is not None,
        "correlation": correlation_table(diagnosis),
        "provenance": provenance_rows([log.source for log in logs], command),
        "logs": [log_name(series.name) for series in comparison.series],
    }
    context |= _diagnosis_part(diagnosis, comparison) | {"formulas": formula_part(discovery)}
    context["playback"] = _embedded(_playback(robot, logs[0], comparison))
    fitted = problem.robot if diagnosis is None else diagnosis.robot
    after = series_of(fitted, problem.records)
    plots = residual_plots(residuals_in(problem, fitted), comparison.series, after)
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
        "steps": step_rows(diagnosis),
        "cards": finding_cards(diagnosis.findings),
        "ranking": ranking_rows(diagnosis.ranking),
        "words": ranking_words(diagnosis.ranking),
        "warnings": list(diagnosis.warnings),
        "remainder": diagnosis.remainder,
    }


def _playback(robot: Robot, log: Log, comparison: Comparison) -> str:
    ghost = model_ghost(robot, log, comparison.floor.values, "the model as given")
    title = f"{log_name(log.source.label)} and the model as given"
    size = np.max(np.abs(np.array(list(ghost.residual.values()))), axis=0)
    worst = float(ghost.residual_time[int(np.argmax(size))])
    return playback_page(robot, log, ghost=ghost, title=title, at=worst)


def _embedded(value: object) -> str:
    """Return JSON that can stand inside a script element."""
    return json.dumps(value, separators=(",", ":")).replace("<", "\\u003c")
