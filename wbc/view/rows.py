"""The tables of an answer as rows of texts: terminal, report and notebook show the same ones."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from wbc.identification.answer.numbers import (
    efforts,
    plain,
    sure,
    told,
    with_deviation,
    with_interval,
)
from wbc.view.table import TextTable

if TYPE_CHECKING:
    from wbc.identification import Comparison, Contestant, Diagnosis, Estimate, OpenLoop
    from wbc.identification.classic import ClassicFit
    from wbc.identification.formulas import Discovery
    from wbc.identification.servo.servo_models import Rollouts
    from wbc.identification.trend import FleetDiagnosis, Trend
    from wbc.measurement import LogQuality

_RANKED = 5  # rows of a ranking in a terminal
_PLACES = 8  # rows of what an error depends on


def _rows(
    heads: str, cells: Iterable[Sequence[str]], title: str = "", caption: str = ""
) -> TextTable:
    """Return a table; its heads are separated by a bar."""
    return TextTable(tuple(heads.split("|")), tuple(tuple(row) for row in cells), title, caption)


def _unit(unit: str) -> str:
    """Return a unit as a table has it: that of a ratio is not written."""
    return "" if unit == "1" else unit


def short_label(label: str) -> str:
    """Return the name of a log without its folders."""
    path, mark, part = label.partition("#")
    return "+".join(Path(file).name for file in path.split("+")) + mark + part


def output_rows(comparison: Comparison) -> TextTable:
    """Return what else a comparison says of the residual of every output."""
    return _rows(
        "output|>acceleration error [rad/s²]|>correlation time [s]|>peak frequency [Hz]",
        (
            (
                o.output,
                *(plain(x, 2) for x in (o.acceleration, o.correlation_time, o.frequency)),
            )
            for o in comparison.outputs
        ),
    )


def clock_rows(qualities: Sequence[LogQuality]) -> TextTable:
    """Return length and clock of every log."""
    return _rows(
        "~log|>rows|>length [s]|>rate [Hz]|>jitter|>longest gap",
        (
            (
                short_label(q.label),
                str(q.rows),
                f"{q.duration:.3f}",
                f"{q.rate:.1f}",
                f"{100.0 * q.jitter:.1f} %",
                f"{1e3 * q.longest_gap:.1f} ms",
            )
            for q in qualities
        ),
    )


def joint_rows(told: Mapping[str, tuple[float, float]]) -> TextTable:
    """Return how well the rows of logs tell whose columns are whose."""
    return _rows(
        "~joint|>columns are its own|>torque explained",
        (
            (joint, f"{100.0 * own:.0f} %", f"{100.0 * share:.0f} %")
            for joint, (own, share) in told.items()
        ),
        caption="by motion and torque alone, without names",
    )


def error_rows(comparison: Comparison) -> TextTable:
    """Return the residual of every output against its floor."""
    reported = efforts(o.unit for o in comparison.outputs)
    return _rows(
        "output|unit|>residual|>measured|>floor|>x floor",
        (
            (
                o.output,
                o.unit,
                plain(o.rms, 2),
                "" if o.size != o.size else plain(o.size),
                plain(o.floor, 2),
                plain(o.ratio, 2),
            )
            for o in comparison.outputs
        ),
        "error",
        f"rms {reported} over all logs; residual: measured - model; floor: noise",
    )


def contest_rows(ranked: Sequence[Contestant]) -> TextTable:
    """Return robots beside the best of them."""
    return _rows(
        "|robot|>error|>worse by|>numbers|",
        (
            (
                str(c.rank),
                c.name,
                plain(c.error),
                "" if c.standing == "best" else with_deviation(c.difference, c.deviation),
                str(c.parameters),
                "; ".join((c.standing, *c.warnings)),
            )
            for c in ranked
        ),
        "robots",
        "error: rms in floors; worse by: mean square against the best, standard error",
    )


def where_rows(comparison: Comparison) -> TextTable:
    """Return the strongest dependences of the residual."""
    cells = []
    for b in comparison.where[:_PLACES]:
        ends = (int(b.mean.argmin()), int(b.mean.argmax()))
        means = (f"{b.mean[k]:+.2g} at {b.center[k]:.2g}" for k in ends)
        cells.append((b.output, b.variable, b.unit, f"{100.0 * b.share:.0f} %", *means))
    return _rows(
        "output|depends on|unit|>share|>from|>to",
        cells,
        "where it fails",
        "share of the residual's variance that its mean over this variable explains",
    )


def open_loop_rows(simulated: Sequence[OpenLoop]) -> TextTable:
    """Return position errors after each horizon: of one robot, or as given and with what was found.

    Beside them stands how far the joint moved in that time.
    """
    first, cells = simulated[0], []
    for row, (joint, unit) in enumerate(zip(first.joints, first.units, strict=True)):
        errors = []
        for k in range(len(first.horizons)):
            found = [told(one.error[row, k]) for one in simulated if not one.reason]
            # Two robots need two lines: three horizons of them are wider than a terminal.
            between = "\n" if len(found) > 1 else " "
            errors.append(f"{' -> '.join(found)}{between}of {told(first.moved[row, k])}")
        cells.append((joint, *errors, unit))
    return _rows(
        "|".join(["open loop", *(f">after {horizon:g} s" for horizon in first.horizons), ""]),
        cells,
        caption="rms position error of the simulated robot so long after a measured state, of how "
        "far the joint moved",
    )


def left_rows(diagnosis: Diagnosis) -> TextTable:
    """Return what is left at each output; "after" only where something was found."""
    found = bool(diagnosis.findings)
    cells = []
    for o in diagnosis.outputs:
        numbers = (o.before, *((o.after,) if found else ()), o.attainable, o.floor)
        told_unit = o.unit if o.judged else f"{o.unit}, set aside"
        cells.append((o.output, *(plain(x, 2) for x in numbers), told_unit))
    reported = efforts(o.unit for o in diagnosis.outputs)
    return _rows(
        f"left at|>before|{'>after|' if found else ''}>attainable|>noise floor|",
        cells,
        caption=f"rms {reported} that the model does not explain; attainable: what the best model "
        "of the motion would leave; noise floor: what noise leaves",
    )


def estimate_cells(estimate: Estimate) -> tuple[str, str, str]:
    """Return value, interval and unit of a number."""
    value, interval = with_interval(estimate.value, estimate.low, estimate.high)
    return value, interval, _unit(estimate.unit)


def effect_rows(diagnosis: Diagnosis) -> TextTable:
    """Return the effects found; one with a single number takes a single line."""
    cells: list[tuple[str, ...]] = []
    for finding in diagnosis.findings:
        name = f"{finding.effect.name} at {finding.effect.where}"
        certainty, alone = sure(finding.probability), len(finding.numbers) == 1
        if not alone:
            cells.append((name, "", "", "", certainty))
        for number, e in finding.numbers.items():
            first = (name, certainty) if alone else (f"  {number}", "")
            cells.append((first[0], *estimate_cells(e), first[1]))
            if e.drawn is not None:
                cells.append(("  as given" if alone else "    as given", plain(e.drawn)))
        if finding.alternatives:
            cells.append(("  or " + ", or ".join(finding.rivals),))
        cells += [(f"  warning: {warning}",) for warning in finding.warnings]
    return _rows("~effect at place|>value|90 % interval|unit|is it there?", cells)


def step_rows(diagnosis: Diagnosis) -> TextTable:
    """Return how the error falls with each effect that is added."""
    return _rows(
        "added|where|>held-out error",
        (
            (step.added or "(the model as given)", step.where, plain(step.error, 2))
            for step in diagnosis.steps
        ),
        caption=f"in noise floors (floor from {diagnosis.error.floor_source})",
    )


def ranking_rows(diagnosis: Diagnosis, whole: bool) -> TextTable:
    """Return the models tried, with what they leave beyond the one found."""
    tried = [row for row in diagnosis.ranking if row.standing != "found"]
    cells: list[tuple[str, ...]] = [
        (row.text, plain(row.error, 2), with_deviation(*row.beyond), row.judgement)
        for row in (tried if whole else tried[:_RANKED])
    ]
    if len(tried) > _RANKED and not whole:
        cells.append((f"and {len(tried) - _RANKED} more (--verbose)",))
    return _rows(
        "what else was tried|>error|>beyond it|",
        cells,
        caption="most probable first; error: held out, in noise floors; beyond it: minus the error "
        "of what was found, ± standard error; `wbc list effects` explains the names",
    )


def formula_rows(discovery: Discovery) -> TextTable:
    """Return the terms of the formulas that were proposed."""
    cells: list[tuple[str, ...]] = []
    for proposal in discovery.proposals:
        cells.append((f"at {proposal.effect.where}: removes {100.0 * proposal.share:.0f} %",))
        for name, e in proposal.coefficients.items():
            folds = f"{100.0 * proposal.stability[name]:.0f} %"
            interval = f"{e.low:.4g} .. {e.high:.4g}"
            cells.append((f"  {name}", f"{e.value:.4g}", interval, e.unit, folds))
    return _rows("~proposed torque|>value|90 % interval|unit|>folds", cells)


def fleet_rows(fleet: FleetDiagnosis) -> TextTable:
    """Return verdict and causes of every machine that has an answer."""
    return _rows(
        "machine|date|verdict|~causes",
        (
            (m.machine, m.date.removesuffix("T00:00:00"), m.verdict, "\n".join(m.causes))
            for m in fleet.machines
            if not m.failure
        ),
    )


def drift_rows(trend: Trend, drifting: bool) -> TextTable:
    """Return the quantities that drift, or those that do not surely."""
    # A large change with few sessions may be chance: what is listed second need not stay.
    head = "drifts" if drifting else "no sure drift"
    return _rows(
        f"~{head}||>first|>last|>change|",
        (
            (
                drift.machine,
                drift.name,
                plain(drift.first.value),
                plain(drift.last.value),
                with_deviation(drift.change, drift.deviation),
                _unit(drift.unit),
            )
            for drift in trend.drifts
            if drift.drifts == drifting
        ),
        caption="change: of the line through all sessions, ± standard error" if drifting else "",
    )


def parameter_rows(fit: ClassicFit) -> TextTable:
    """Return the parameters of a classic fit: names break, numbers do not."""
    cells: list[tuple[str, ...]] = []
    for p in fit.parameters:
        value, interval = with_interval(p.value, p.low, p.high)
        cells.append((p.name, value, interval, plain(p.drawn), p.unit))
        if p.combination:
            cells.append((f"  with {p.combination}",))
    heads = ("~parameter", ">value", "90 % interval", ">drawn", "unit")
    return TextTable(heads, tuple(cells), whole=True)


def fit_rows(fit: ClassicFit) -> TextTable:
    """Return what a classic fit leaves at every joint."""
    found = zip(fit.joints, fit.before, fit.left, strict=True)
    return _rows("left at|before|after", ((j, f"{b:.3g}", f"{a:.3g}") for j, b, a in found))


def servo_model_rows(found: Rollouts) -> TextTable:
    """Return the models of a servo that were tried, each with what those above it have."""
    return _rows(
        "model|>all logs [mrad]|>held out [mrad]|",
        (
            (
                model.name,
                plain(1e3 * model.seen, 2),
                plain(1e3 * model.error, 2),
                "chosen" if model is found.chosen else "",
            )
            for model in found.models
        ),
        caption="mean absolute position error; each model has what those above it have",
    )


def servo_number_rows(found: Rollouts) -> TextTable:
    """Return the fitted numbers of a servo."""
    from wbc.identification.servo.servo_models import UNITS

    fit = found.chosen.fit
    return _rows(
        "number|>value|unit|",
        (
            (
                name,
                plain(value),
                _unit(UNITS[name]),
                "at its bound" if name in fit.at_bound else "",
            )
            for name, value in fit.values.items()
        ),
    )
