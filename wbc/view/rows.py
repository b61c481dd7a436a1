"""Tables of texts that terminal and report share; those of an answer are its own methods."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from wbc.identification.answer.shown import plain, told, with_interval
from wbc.tables import TextTable

if TYPE_CHECKING:
    from wbc.identification import OpenLoop
    from wbc.identification.classic import ClassicFit
    from wbc.identification.formulas import Discovery
    from wbc.identification.readings import LogQuality


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
