"""The discovery step of `wbc diagnose`: formulas for what no named effect explains."""

from __future__ import annotations

from rich.console import Console
from rich.table import Table

from wbc.identification.formulas import Discovery


def print_discovery(console: Console, discovery: Discovery) -> None:
    """Print the proposals with what they remove, and how far to believe them."""
    console.print("discovery: formulas proposed by regression, not causes", style="bold")
    if discovery.proposals:
        console.print(_proposals_table(discovery))
    for proposal in discovery.proposals:
        console.print(proposal.formula)
        for name, rivals in proposal.rivals.items():
            if rivals:
                console.print(f"  instead of {name} as well: {', '.join(rivals)}")
        for warning in proposal.warnings:
            console.print(f"  warning: {warning}")
    for name, where in discovery.dropped:
        console.print(f"{name} at {where} is not needed beside the formulas")
    error = discovery.error
    console.print(f"held-out error: {error.before:.2f} -> {error.after:.2f} noise floors")
    console.print(discovery.summary)
    if discovery.proposals and discovery.remainder:
        console.print(discovery.remainder)


def _proposals_table(discovery: Discovery) -> Table:
    table = Table("proposed torque", "value", "90 % interval", "unit", "folds", box=None)
    table.columns[0].overflow = "fold"
    table.columns[1].justify = table.columns[4].justify = "right"
    for proposal in discovery.proposals:
        where = proposal.effect.where
        table.add_row(f"at {where}: removes {100.0 * proposal.share:.0f} %")
        for name, e in proposal.coefficients.items():
            interval = f"{e.low:.4g} .. {e.high:.4g}"
            folds = f"{100.0 * proposal.stability[name]:.0f} %"
            table.add_row(f"  {name}", f"{e.value:.4g}", interval, e.unit, folds)
    return table
