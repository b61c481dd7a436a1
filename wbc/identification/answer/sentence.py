"""What a diagnosis says, in a sentence that a person would say, and what to do now."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from wbc.identification.answer.diagnosis import Diagnosis, Finding, OutputLevel

CERTAIN = 0.95
"""Probability from which on a cause is certain."""


def verdict_sentence(diagnosis: Diagnosis) -> str:
    """Return what a diagnosis says, in one or two sentences with its numbers."""
    found = _sum_up(diagnosis.findings)
    opening = found[:1].upper() + found[1:]
    match diagnosis.verdict:
        case "none":
            floors = _digits(diagnosis.error.after)
            return f"Nothing is missing: the robot explains these logs to {floors} noise floors."
        case "named":
            verb = _verb(diagnosis.findings)
            return f"{opening} {verb} what was missing: {_progress(diagnosis)}."
        case "ambiguous":
            rivals = _rivals(diagnosis.findings)
            return (
                f"{opening} would explain these logs: {_progress(diagnosis)}. But these logs "
                f"cannot tell {rivals}."
            )
        case "partial":
            certain = certain_findings(diagnosis)
            sure = _sum_up(certain)
            return (
                f"{sure[:1].upper()}{sure[1:]} {_verb(certain)} missing, that is certain: "
                f"{_progress(diagnosis)}. More is missing that no known effect explains."
            )
        case "unknown":
            added = f", even with {found}" if found else ""
            return (
                "Something is missing that no known effect explains: "
                f"{_progress(diagnosis)}{added}."
            )
        case "not_repeatable":
            return (
                "Repeated runs disagree with one another by more than their noise, so nothing can "
                "be named from these logs."
            )


def what_to_do(diagnosis: Diagnosis, saved: str = "fitted.toml") -> str:
    """Return what to do now.

    Args:
        diagnosis: the answer.
        saved: name of the file in which the robot with the effects found is, or would be.
    """
    use = f"write the robot with --save {saved} and name it with --robot {saved}"
    match diagnosis.verdict:
        case "named":
            return f"{use[:1].upper()}{use[1:]}."
        case "partial":
            return f"{use[:1].upper()}{use[1:]}. {diagnosis.next_experiment}"
        case _:
            return diagnosis.next_experiment


def certain_findings(diagnosis: Diagnosis) -> tuple[Finding, ...]:
    """Return the findings that are certain, each alone or with what it cannot be told from."""
    return tuple(f for f in diagnosis.findings if f.support.group_probability >= CERTAIN)


def spoken(name: str) -> str:
    """Return the name of an effect as words."""
    return name.replace("_", " ")


def _progress(diagnosis: Diagnosis) -> str:
    """Return how far the error falls at the output that missed most beside its sensors."""
    worst = max(diagnosis.outputs, key=_floors, default=None)
    if worst is None:
        return f"{_digits(diagnosis.error.after)} noise floors are left"
    before, after = _digits(worst.before), _digits(worst.after)
    share = 100.0 * diagnosis.explained
    return (
        f"{share:.0f} % of the squared error is explained, {before} -> {after} {worst.unit} at "
        f"{worst.output}"
    )


def _floors(output: OutputLevel) -> float:
    return output.before / max(output.sensors, 1e-300)


def _digits(value: float) -> str:
    return f"{value:.0f}" if value >= 100.0 else f"{value:.3g}"


def _sum_up(findings: Sequence[Finding]) -> str:
    places: dict[str, list[str]] = {}
    for finding in findings:
        places.setdefault(finding.effect.name, []).append(finding.effect.where)
    parts = [f"{spoken(name)} at {_joined(at)}" for name, at in places.items()]
    return _joined(parts)


def _verb(findings: Sequence[Finding]) -> str:
    return "is" if len({finding.effect.name for finding in findings}) == 1 else "are"


def _rivals(findings: Sequence[Finding]) -> str:
    parts = [
        f"{spoken(finding.effect.name)} from {_joined([spoken(a) for a in finding.rivals])}"
        for finding in findings
        if finding.alternatives
    ]
    return "; ".join(dict.fromkeys(parts))


def _joined(parts: Sequence[str]) -> str:
    if len(parts) < 2:
        return "".join(parts)
    return ", ".join(parts[:-1]) + " and " + parts[-1]
