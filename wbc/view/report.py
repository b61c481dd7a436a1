"""The report: one offline page that says what is missing, how sure that is, and where to look."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects import EFFECTS
from wbc.errors import needs
from wbc.files import write_text
from wbc.identification import Comparison, Diagnosis, OpenLoop, Ranked
from wbc.identification.answer import shown, words
from wbc.identification.answer.comparison import compare_problem
from wbc.identification.answer.shown import Series, series_of
from wbc.identification.choice.constancy import quantities
from wbc.identification.formulas import Discovery
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.open_loop import open_loop_rows
from wbc.identification.readings.checks import check_logs, clock_rows
from wbc.identification.records.record import Record, output_names, output_units
from wbc.measurement.checks import true_runs
from wbc.measurement.log import Log, LogSource, short_label
from wbc.robot import Robot
from wbc.robot.effect import spoken

with needs("view", "writing a report"):
    from markupsafe import Markup
    from plotly.offline import get_plotlyjs

    from wbc.view.channels import model_ghost
    from wbc.view.playback import embedded, pages, write_playback

_STRONG = 0.1
_MOST_DEPENDENCES = 10
# What a variable is whose name does not say it.
_VARIABLES = {
    "direction": "forth or back",
    "mesh power": "load times speed",
    "load against direction": "size of the load, minus when moving back",
    "rotor angle": "within one turn of the motor",
}
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
    discovery: Discovery | None = None,
    commands: words.Commands | None = None,
    simulated: Sequence[OpenLoop] = (),
) -> Path:
    """Write what `compare` or `diagnose` found as one HTML file without any network.

    The page begins with the verdict in a sentence and what to do now. Then it shows what is left at
    each joint in its unit, how far the simulated robot strays from the logs, and the effects with
    their parameters. Measured and modelled torque over time, with the residual, follow, and the log
    with the model as a ghost. At its end are formulas proposed for the rest, the error after each
    effect, which parameters move together, what else was tried, the quality of the logs, and how
    to reproduce it.

    Args:
        path: the file to write (whole or not at all).
        robot: the robot as it was given to `compare` or `diagnose`.
        logs: the logs, in the same order; the first one is played.
        diagnosis: what `diagnose` returned; a report of the comparison alone when left out.
        command: how to run it again, for the last section.
        discovery: what `discover` proposes for what the effects leave.
        commands: how to go on from the answer on the command line; in Python when left out.
        simulated: what `open_loop` returned of the robot as given, and of the corrected one.

    Raises:
        IdentificationError: logs that cannot be compared with this robot.
        LogError: a channel is missing.
    """
    problem = EstimationProblem.from_logs(robot, logs)
    comparison, qualities = compare_problem(problem), check_logs(logs, robot)
    given, steps = comparison.series, [] if diagnosis is None else stairs(diagnosis)
    fitted = given if diagnosis is None else series_of(diagnosis.robot, problem.records)
    data = residual_plots(problem, given, fitted)
    data |= {"steps": steps, "fitted": bool(diagnosis and diagnosis.findings)}
    context: dict[str, Any] = {
        "title": f"{robot.name}: {'comparison' if diagnosis is None else 'diagnosis'}",
        "left": comparison.error_rows() if diagnosis is None else diagnosis.left_rows(),
        "open_loop": open_loop_rows(simulated) if simulated else None,
        "clocks": clock_rows(qualities),
        "quality": [quality for quality in qualities if quality.findings],
        "dependences": [b for b in comparison.where if b.share > _STRONG][:_MOST_DEPENDENCES],
        "variables": _VARIABLES,
        "efforts": shown.efforts(o.unit for o in comparison.outputs),
        "words": ranking_words(() if diagnosis is None else diagnosis.ranking),
        "provenance": provenance_rows([log.source for log in logs], command),
        "logs": data["logs"],
        "playback": embedded(_playback(robot, logs[0], comparison)),
        "data": embedded(data),
        "plotly": get_plotlyjs(),
    }
    context |= {"robot": robot, "diagnosis": diagnosis, "comparison": comparison, "steps": steps}
    context |= {"discovery": discovery, "simulated": simulated}
    environment = pages("page", autoescape=True, finalize=_unbroken)
    used = spoken, titled, shown.plain, shown.sure, shown.with_deviation, short_label
    environment.filters |= {one.__name__: one for one in used}
    page = environment.get_template("report.html.j2")
    return write_text(path, page.render(context | headline(comparison, diagnosis, commands)))


def _unbroken(value: object) -> object:
    """Return a text whose numbers stay on the line of their units; commands are Markup already."""
    if not isinstance(value, str) or isinstance(value, Markup):
        return value
    return _UNIT.sub("\u00a0", value.replace("->", "→").replace("N m", "N\u00a0m"))


def headline(
    comparison: Comparison, diagnosis: Diagnosis | None, commands: words.Commands | None
) -> dict[str, Any]:
    """Return the verdict with its meaning, the first sentence, the others, what to do now."""
    verdict = badge = "compared"
    meaning, to_do = "the model beside the logs, nothing was fitted", ""
    text = comparison.sentence
    if diagnosis is not None:
        verdict, text = diagnosis.verdict, words.verdict_sentence(diagnosis)
        (badge, meaning), to_do = words.VERDICTS[verdict], words.what_to_do(diagnosis, commands)
    first, stop, rest = text.partition(". ")
    lines = [(line.startswith(words.COMMAND), line.strip()) for line in to_do.splitlines()]
    told = {"verdict": verdict, "badge": badge, "meaning": meaning, "to_do": lines}
    return told | {"sentence": first + ("." if stop else ""), "more": rest}


def provenance_rows(sources: Sequence[LogSource], command: str) -> dict[str, str]:
    """Return label -> text of how to reproduce a result."""
    facts = shown.provenance(sources, command)
    rows = {"command": command} if command else {}
    rows["versions"] = ", ".join(f"{name} {number}" for name, number in facts["versions"].items())
    rows["python"] = facts["python"]
    rows["written"] = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    for source in sources:
        path = source.label.partition("#")[0]  # the digest is that of the file
        rows[f"data: {path}"] = f"sha256 {source.sha256}" if source.sha256 else "made in memory"
    return rows


def titled(text: str) -> str:
    """Return a text as a title has it: its first letter is a capital."""
    return text[:1].upper() + text[1:]


def stairs(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Return the staircase: label and error of each step."""
    steps = []
    for one in diagnosis.steps:
        label = f"+ {spoken(one.added)} at {one.where}" if one.added else "as given"
        steps.append({"label": label, "error": one.error, "told": shown.plain(one.error, 2)})
    return steps


def ranking_words(rows: Sequence[Ranked]) -> list[tuple[str, str]]:
    """Return name and explanation of every effect that a ranked table names."""
    names = dict.fromkeys(name for row in rows for name, _ in (*row.added, *row.removed))
    known = [name for name in names if name in EFFECTS]
    return [(titled(spoken(name)), EFFECTS[name].explanation) for name in known]


def _playback(robot: Robot, log: Log, comparison: Comparison) -> str:
    ghost = model_ghost(robot, log, comparison.floor.values, "the model as given")
    title = f"{short_label(log.source.label)} and the model as given"
    size = np.max(np.abs(np.array(list(ghost.residual.values()))), axis=0)
    worst = float(ghost.residual_time[int(np.argmax(size))])
    with TemporaryDirectory() as folder:
        page = Path(folder) / "playback.html"
        write_playback(page, robot, log, ghost=ghost, title=title, at=worst)
        return page.read_text(encoding="utf-8")


_HALF = 0.5  # weight below which a row counts as not used
_ROWS = 700  # of one line: about as many as a screen has points across
_NUMBERS = 500_000  # of all lines together: some 3 MB of text
_POINTS = 450
_STRETCHES = 200  # near reversals, shaded in one plot: more would be a grey wall


def residual_plots(
    problem: EstimationProblem, given: Sequence[Series], fitted: Sequence[Series]
) -> dict[str, Any]:
    """Return per output: torques and residuals over time, residuals over speed, position and load.

    Args:
        problem: the robot and its logs.
        given: torques and residuals (rows, outputs) of every log, of the robot that was given.
        fitted: the same of the robot with the effects found.
    """
    robot, runs = problem.robot, list(zip(problem.records, given, fitted, strict=True))
    names, units = output_names(robot), output_units(robot)
    before, after = (np.concatenate([one.residual for one in each]) for each in (given, fitted))
    rows = min(_ROWS, max(100, _NUMBERS // (6 * len(runs) * len(names))))
    few = slice(None, None, max(1, -(-len(before) // _POINTS)))
    panels = []
    for k, unit in enumerate(units):
        driven, over = k < robot.transmission.size, []
        seen = [(record, quantities(record, k)) for record in problem.records]
        for name in ("speed", "position", "load") if driven else ("speed",):
            told = seen[0][1][name][0]
            own_unit = told.replace("N m", "N").replace("rad", "m") if unit == "N" else told
            values = np.concatenate([one.thinned(own[name][1]) for one, own in seen])
            over.append({"name": name, "unit": own_unit, "x": _short(values[few])})
        left = {"before": _short(before[few, k]), "after": _short(after[few, k])}
        panel = {"output": names[k], "unit": unit, "floor": float(problem.floor.values[k])}
        lines = [_over_time(*run, k, driven, rows) for run in runs]
        panels.append(panel | {"over": over, **left, "runs": lines})
    return {"logs": [short_label(one.name) for one in given], "panels": panels}


def _over_time(
    record: Record, given: Series, fitted: Series, k: int, driven: bool, rows: int
) -> dict[str, Any]:
    """Return the lines of one output over the time of a log, and the stretches not used."""
    every = slice(None, None, max(1, -(-len(given.time) // rows)))
    lines = {"before": given.residual, "after": fitted.residual}
    if driven:
        lines |= {"measured": given.measured, "given": given.modelled, "fitted": fitted.modelled}
    short = {name: _short(values[every, k]) for name, values in lines.items()}
    inside = record.weight[record.edge : len(record.weight) - record.edge, k] < _HALF
    ends = record.time[0] + (np.stack(true_runs(inside), axis=1) - [0, 1]) / record.rate
    unused = [_short(stretch, 6) for stretch in ends[:_STRETCHES]]
    return {"t": _short(given.time[every], 6), **short, "unused": unused}


def _short(values: FloatArray, digits: int = 4) -> list[float]:
    """Return values with a few significant digits: text is what the file is made of."""
    return [float(f"{value:.{digits}g}") for value in values]
