"""Everything a report says, as plain data for its template."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from wbc.effects import EFFECTS
from wbc.identification import Comparison, Diagnosis, Finding, OpenLoop, Ranked
from wbc.identification.answer.diagnosis.sentence import (
    MEANINGS,
    TITLES,
    verdict_sentence,
)
from wbc.identification.answer.diagnosis.to_do import COMMAND, Commands, what_to_do
from wbc.identification.answer.numbers import plain, sure, told, with_deviation, with_interval
from wbc.identification.answer.provenance import provenance
from wbc.measurement import LogQuality, LogSource
from wbc.robot.effect import spoken

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


def left_rows(comparison: Comparison, diagnosis: Diagnosis | None) -> list[list[str]]:
    """Return what is left at each output in its unit, the worst first."""
    if diagnosis is None:
        worst = sorted(comparison.outputs, key=lambda o: -o.ratio)
        return [
            [o.output, plain(o.rms, 2), plain(o.size), plain(o.floor, 2), o.unit] for o in worst
        ]
    order = sorted(
        diagnosis.outputs, key=lambda o: (not o.judged, -o.before / max(o.floor, 1e-300))
    )
    rows = []
    for o in order:
        left = (o.before, o.after) if diagnosis.findings else (o.before,)
        numbers = [plain(x, 2) for x in (*left, o.attainable, o.floor)]
        rows.append([o.output, *numbers, o.unit if o.judged else f"{o.unit}, set aside"])
    return rows


def open_loop_part(simulated: Sequence[OpenLoop]) -> dict[str, Any]:
    """Return horizons and rows of the simulated robot's position errors, or why there are none."""
    if not simulated:
        return {}
    first, last = simulated[0], simulated[-1]
    rows = []
    for k, (joint, unit) in enumerate(zip(first.joints, first.units, strict=True)):
        cells = [
            {
                "error": " → ".join(told(one.error[k, h]) for one in simulated if not one.reason),
                "moved": told(first.moved[k, h]),
            }
            for h in range(len(first.horizons))
        ]
        rows.append({"joint": joint, "unit": unit, "cells": cells})
    return {
        "reason": last.reason,
        "horizons": [f"{horizon:g} s" for horizon in first.horizons],
        "rows": rows,
        "both": len(simulated) > 1,
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


def log_name(label: str) -> str:
    """Return the name of a log without its folders."""
    path, mark, part = label.partition("#")
    return Path(path).name + mark + part


def output_rows(comparison: Comparison) -> list[list[str]]:
    """Return the table of errors per output."""
    return [
        [
            o.output,
            f"{plain(o.rms)} {o.unit}",
            plain(o.floor, 2),
            plain(o.ratio, 2),
            plain(o.size),
            plain(o.acceleration, 2),
            plain(o.correlation_time, 2),
            plain(o.frequency, 2),
        ]
        for o in comparison.outputs
    ]


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


def step_rows(diagnosis: Diagnosis) -> list[dict[str, Any]]:
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
            value, interval = with_interval(estimate.value, estimate.low, estimate.high)
            unit = "" if estimate.unit == "1" else estimate.unit
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


def ranking_rows(rows: Sequence[Ranked]) -> list[dict[str, Any]]:
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


def quality_rows(qualities: Sequence[LogQuality]) -> list[dict[str, Any]]:
    """Return clock and findings of every log."""
    return [
        {
            "label": log_name(quality.label),
            "rows": quality.rows,
            "duration": plain(quality.duration),
            "rate": plain(quality.rate, 4),
            "jitter": f"{100.0 * quality.jitter:.2f}",
            "gap": plain(1e3 * quality.longest_gap),
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
    ]
