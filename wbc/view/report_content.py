"""Everything a report says, as plain data for its template."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Any

from wbc.effects import EFFECTS
from wbc.identification import Comparison, Diagnosis, Finding, Ranked
from wbc.identification.answer.diagnosis.sentence import (
    MEANINGS,
    TITLES,
    verdict_sentence,
)
from wbc.identification.answer.diagnosis.to_do import COMMAND, Commands, what_to_do
from wbc.identification.answer.numbers import plain, sure, with_deviation
from wbc.identification.answer.provenance import provenance
from wbc.identification.formulas import Discovery
from wbc.measurement import LogQuality, LogSource
from wbc.robot.effect import spoken
from wbc.view.rows import estimate_cells, formula_rows, short_label

_STRONG = 0.1
_MOST_DEPENDENCES = 10
_VARIABLES = {
    "direction": "forth or back",
    "mesh power": "load times speed",
    "load against direction": "size of the load, minus when moving back",
    "rotor angle": "within one turn of the motor",
}
"""What a variable is whose name does not say it."""


def headline(
    comparison: Comparison, diagnosis: Diagnosis | None, commands: Commands | None
) -> dict[str, Any]:
    """Return the verdict with its meaning, the first sentence, the others, what to do now."""
    if diagnosis is None:
        verdict, badge, text, to_do = "compared", "compared", comparison.sentence, ""
        meaning = "the model beside the logs, nothing was fitted"
    else:
        verdict, text = diagnosis.verdict, verdict_sentence(diagnosis)
        badge, meaning = TITLES[verdict], MEANINGS[verdict]
        to_do = what_to_do(diagnosis, commands)
    first, stop, rest = text.partition(". ")
    return {
        "verdict": verdict,
        "badge": badge,
        "meaning": meaning,
        "sentence": first + ("." if stop else ""),
        "more": rest,
        "to_do": [(line.startswith(COMMAND), line.strip()) for line in to_do.splitlines()],
    }


def correlation_table(diagnosis: Diagnosis | None) -> dict[str, Any]:
    """Return names and cells (text, size from 0 to 1) of the correlations; empty without any."""
    if diagnosis is None or not diagnosis.correlation.matrix.size:
        return {}
    found = diagnosis.correlation
    names = [f"{spoken(name)} of {spoken(effect)} at {at}" for effect, at, name in found.names]
    cells = [
        [{"text": plain(round(float(x), 2), 2), "size": round(abs(float(x)), 2)} for x in row]
        for row in found.matrix
    ]
    return {"names": names, "rows": list(zip(names, cells, strict=True))}


def provenance_rows(sources: Sequence[LogSource], command: str) -> dict[str, str]:
    """Return label -> text of how to reproduce a result."""
    facts = provenance(sources, command)
    rows = {"command": command} if command else {}
    rows["seed"] = f"{facts['seed']} (of the blocks drawn for the intervals)"
    rows["versions"] = ", ".join(f"{name} {number}" for name, number in facts["versions"].items())
    rows["python"] = facts["python"]
    if facts["commit"]:
        rows["commit"] = facts["commit"]
    rows["written"] = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    for source in sources:
        # The digest is that of the file, which may hold many logs.
        path = source.label.partition("#")[0]
        known = sum(1 for other in sources if other.label.partition("#")[0] == path)
        digest = f"sha256 {source.sha256}" if source.sha256 else "made in memory"
        rows[f"data: {path}"] = digest if known == 1 else f"{digest} ({known} logs)"
    return rows


def titled(text: str) -> str:
    """Return a text as a title has it: its first letter is a capital."""
    return text[:1].upper() + text[1:]


def dependence_rows(comparison: Comparison) -> list[dict[str, Any]]:
    """Return what the residual depends on most: output, variable and share of its variance."""
    strong = [b for b in comparison.where if b.share > _STRONG][:_MOST_DEPENDENCES]
    return [
        {
            "output": b.output,
            "variable": b.variable,
            "meaning": _VARIABLES.get(b.variable, ""),
            "share": round(100 * b.share),
        }
        for b in strong
    ]


def stairs(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Return the staircase: label and error of each step."""
    return [
        {
            "label": f"+ {spoken(step.added)} at {step.where}" if step.added else "as given",
            "error": step.error,
            "told": plain(step.error, 2),
        }
        for step in diagnosis.steps
    ]


def finding_cards(findings: Sequence[Finding]) -> list[dict[str, Any]]:
    """Return one card per effect: parameters with intervals, explanation, warnings, rivals."""
    cards = []
    for finding in findings:
        parameters = []
        for name, estimate in finding.numbers.items():
            value, interval, unit = estimate_cells(estimate)
            if estimate.drawn is not None:
                unit += f" (as given {plain(estimate.drawn)})"
            parameters.append(
                {"name": spoken(name), "value": value, "interval": interval, "unit": unit}
            )
        cards.append(
            {
                "effect": titled(spoken(finding.effect.name)),
                "where": finding.effect.where,
                "sure": sure(finding.probability),
                "explanation": finding.effect.explanation,
                "parameters": parameters,
                "warnings": [spoken(warning) for warning in finding.warnings],
                "alternatives": [spoken(name) for name in finding.rivals],
            }
        )
    return cards


def ranked_models(rows: Sequence[Ranked]) -> list[dict[str, Any]]:
    """Return the ranked table: model, error, judgement, odds, paired difference."""
    return [
        {
            "model": row.text if row.effects or row.standing != "found" else "robot as given",
            "error": plain(row.error, 2),
            "beyond": "" if row.standing == "found" else with_deviation(*row.beyond),
            "standing": row.standing,
            "judgement": row.judgement,
            "odds": row.odds,
        }
        for row in rows
    ]


def ranking_words(rows: Sequence[Ranked]) -> list[tuple[str, str]]:
    """Return name and explanation of every effect that a ranked table names."""
    names = dict.fromkeys(name for row in rows for name, _ in (*row.added, *row.removed))
    known = [name for name in names if name in EFFECTS]
    return [(titled(spoken(name)), EFFECTS[name].explanation) for name in known]


def remark_lists(qualities: Sequence[LogQuality]) -> list[dict[str, Any]]:
    """Return what the checks say of every log that is not faultless."""
    return [
        {
            "label": short_label(quality.label),
            "findings": [
                {
                    "severity": f.severity,
                    "text": f"{f.column}: {f.text}" if f.column else f.text,
                    "way_out": f.way_out,
                }
                for f in quality.findings
            ],
        }
        for quality in qualities
        if quality.findings
    ]


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
        "terms": formula_rows(discovery),
        "proposals": [
            {
                "formula": proposal.formula,
                "share": round(100.0 * proposal.share),
                "warnings": list(proposal.warnings),
                "rivals": {name: ", ".join(r) for name, r in proposal.rivals.items() if r},
            }
            for proposal in discovery.proposals
        ],
    }
