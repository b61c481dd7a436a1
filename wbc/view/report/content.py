"""Everything a report says, as plain data for its template."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from wbc.identification import Comparison, Diagnosis, Finding, Ranked
from wbc.identification.answer.sentence import spoken, verdict_sentence
from wbc.measurement import LogQuality
from wbc.view.report.numbers import plain, with_interval

_STRONG = 0.1
_MOST_DEPENDENCES = 10


def headline(comparison: Comparison, diagnosis: Diagnosis | None) -> dict[str, str]:
    """Return verdict, sentence and the line below it."""
    if diagnosis is None:
        worst = max(comparison.outputs, key=lambda output: output.ratio)
        text = (
            f"The model misses these logs by {plain(comparison.error)} noise floors; worst at "
            f"{worst.output}, {plain(worst.ratio)} floors."
        )
        return {"verdict": "compared", "sentence": text}
    return {"verdict": diagnosis.verdict, "sentence": verdict_sentence(diagnosis)}


def output_rows(comparison: Comparison) -> list[list[str]]:
    """Return the table of errors per output."""
    return [
        [
            o.output,
            f"{plain(o.rms)} {o.unit}",
            plain(o.floor),
            plain(o.ratio),
            plain(o.size),
            plain(o.acceleration),
            plain(o.rollout),
            plain(o.correlation_time),
            plain(o.frequency),
        ]
        for o in comparison.outputs
    ]


def dependence_rows(comparison: Comparison) -> list[dict[str, Any]]:
    """Return what the residual depends on most: output, variable and share of its variance."""
    strong = [b for b in comparison.where if b.share > _STRONG][:_MOST_DEPENDENCES]
    return [
        {"output": b.output, "variable": f"{b.variable} [{b.unit}]", "share": round(100 * b.share)}
        for b in strong
    ]


def step_rows(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Return the staircase: label and error of each step."""
    return [
        {
            "label": f"+ {spoken(step.added)} at {step.where}" if step.added else "as given",
            "error": step.error,
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
                unit += f" (drawn {plain(estimate.drawn)})"
            parameters.append(
                {"name": spoken(name), "value": value, "interval": interval, "unit": unit}
            )
        cards.append(
            {
                "effect": spoken(finding.effect.name),
                "where": finding.effect.where,
                "explanation": finding.effect.explanation,
                "parameters": parameters,
                "warnings": [spoken(warning) for warning in finding.warnings],
                "alternatives": [spoken(name) for name in finding.rivals],
            }
        )
    return cards


def ranking_rows(rows: Sequence[Ranked]) -> list[dict[str, Any]]:
    """Return the ranked table: model, error, paired difference, standing."""
    table = []
    for row in rows:
        sign = "+" if row.difference > 0.0 else ""
        paired = f"{sign}{plain(row.difference)} ± {plain(row.deviation, 2)}"
        table.append(
            {
                "model": row.text,
                "error": plain(row.error),
                "difference": "" if row.standing == "found" else paired,
                "standing": row.standing,
            }
        )
    return table


def quality_rows(qualities: Sequence[LogQuality]) -> list[dict[str, Any]]:
    """Return clock and findings of every log."""
    return [
        {
            "label": quality.label.rsplit("/", 1)[-1],
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
