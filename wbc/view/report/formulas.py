"""What a report says of formulas that were proposed for the rest."""

from __future__ import annotations

from typing import Any

from wbc.identification.answer.numbers import plain, with_interval
from wbc.identification.formulas import Discovery
from wbc.robot.effect import spoken


def formula_part(discovery: Discovery | None) -> dict[str, Any] | None:
    """Return the proposals with their terms, and how far to believe them; None without any."""
    if discovery is None:
        return None
    error = discovery.error
    return {
        "summary": discovery.summary,
        "error": f"{plain(error.before)} to {plain(error.after)} noise floors",
        "remainder": discovery.remainder if discovery.proposals else "",
        "dropped": [f"{spoken(name)} at {where}" for name, where in discovery.dropped],
        "proposals": [
            {
                "formula": proposal.formula,
                "share": round(100.0 * proposal.share),
                "warnings": list(proposal.warnings),
                "terms": [
                    {
                        "name": name,
                        "value": with_interval(e.value, e.low, e.high)[0],
                        "interval": with_interval(e.value, e.low, e.high)[1],
                        "unit": e.unit,
                        "folds": round(100.0 * proposal.stability[name]),
                        "rivals": ", ".join(proposal.rivals.get(name, ())),
                    }
                    for name, e in proposal.coefficients.items()
                ],
            }
            for proposal in discovery.proposals
        ],
    }
