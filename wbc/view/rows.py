"""Tables of texts that terminal and report share; those of an answer are its own methods."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from wbc.identification.answer.shown import plain, told, with_deviation, with_interval
from wbc.tables import TextTable

if TYPE_CHECKING:
    from wbc.identification import Contestant, OpenLoop
    from wbc.identification.classic import ClassicFit
    from wbc.identification.formulas import Discovery
    from wbc.identification.readings import LogQuality
    from wbc.identification.servo import Rollouts
    from wbc.identification.trend import Trend


def _unit(unit: str) -> str:
    """Return a unit as a table has it: that of a ratio is not written."""
    return "" if unit == "1" else unit


def _percent(share: float) -> str:
    return f"{100.0 * share:.0f} %"


def short_label(label: str) -> str:
    """Return the name of a log without its folders."""
    path, mark, part = label.partition("#")
    return "+".join(Path(file).name for file in path.split("+")) + mark + part


def clock_rows(qualities: Sequence[LogQuality]) -> TextTable:
    """Return length and clock of every log."""
    cells = []
    for q in qualities:
        clock = f"{q.rate:.1f}", f"{100.0 * q.jitter:.1f} %", f"{1e3 * q.longest_gap:.1f} ms"
        cells.append((short_label(q.label), str(q.rows), f"{q.duration:.3f}", *clock))
    return TextTable.of("~log|>rows|>length [s]|>rate [Hz]|>jitter|>longest gap", cells)


def joint_rows(told: Mapping[str, tuple[float, float]]) -> TextTable:
    """Return how well the rows of logs tell whose columns are whose."""
    return TextTable.of(
        "~joint|>columns are its own|>torque explained",
        ((joint, *map(_percent, shares)) for joint, shares in told.items()),
        caption="by motion and torque alone, without names",
    )


def contest_rows(ranked: Sequence[Contestant]) -> TextTable:
    """Return robots beside the best of them."""
    cells = []
    for c in ranked:
        worse = "" if c.standing == "best" else with_deviation(c.difference, c.deviation)
        standing = "; ".join((c.standing, *c.warnings))
        cells.append((str(c.rank), c.name, plain(c.error), worse, str(c.parameters), standing))
    return TextTable.of(
        "|robot|>error|>worse by|>numbers|",
        cells,
        "robots",
        "error: rms in floors; worse by: mean square against the best, standard error",
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
    return TextTable.of(
        "|".join(["open loop", *(f">after {horizon:g} s" for horizon in first.horizons), ""]),
        cells,
        caption="rms position error of the simulated robot so long after a measured state, of how "
        "far the joint moved",
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
    return TextTable.of("~proposed torque|>value|90 % interval|unit|>folds", cells)


def drift_rows(trend: Trend, drifting: bool) -> TextTable:
    """Return the quantities that drift, or those that do not surely."""
    cells = []
    for d in trend.drifts:
        if d.drifts == drifting:
            ends = plain(d.first.value), plain(d.last.value)
            change = with_deviation(d.change, d.deviation)
            cells.append((d.machine, d.name, *ends, change, _unit(d.unit)))
    # A large change with few sessions may be chance: what is listed second need not stay.
    return TextTable.of(
        f"~{'drifts' if drifting else 'no sure drift'}||>first|>last|>change|",
        cells,
        caption="change: of the line through all sessions, ± standard error" if drifting else "",
    )


def parameter_rows(fit: ClassicFit) -> TextTable:
    """Return the parameters of a classic fit: names break, numbers do not."""
    cells: list[tuple[str, ...]] = []
    for p in fit.parameters:
        value, interval = with_interval(p.value, p.low, p.high)
        cells.append((p.name, value, interval, plain(p.given), p.unit))
        if p.combination:
            cells.append((f"  with {p.combination}",))
    heads = ("~parameter", ">value", "90 % interval", ">as given", "unit")
    return TextTable(heads, tuple(cells), whole=True)


def fit_rows(fit: ClassicFit) -> TextTable:
    """Return what a classic fit leaves at every joint."""
    found = zip(fit.joints, fit.before, fit.left, strict=True)
    return TextTable.of("left at|before|after", ((j, f"{b:.3g}", f"{a:.3g}") for j, b, a in found))


def servo_model_rows(found: Rollouts) -> TextTable:
    """Return the models of a servo that were tried, each with what those above it have."""
    cells = []
    for model in found.models:
        missed = plain(1e3 * model.seen, 2), plain(1e3 * model.error, 2)
        cells.append((model.name, *missed, "chosen" if model is found.chosen else ""))
    return TextTable.of(
        "model|>all logs [mrad]|>held out [mrad]|",
        cells,
        caption="mean absolute position error; each model has what those above it have",
    )


def servo_number_rows(found: Rollouts) -> TextTable:
    """Return the fitted numbers of a servo."""
    from wbc.identification.servo import UNITS

    fit = found.chosen.fit
    bound = {name: "at its bound" if name in fit.at_bound else "" for name in fit.values}
    return TextTable.of(
        "number|>value|unit|",
        ((n, plain(x), _unit(UNITS[n]), bound[n]) for n, x in fit.values.items()),
    )
