"""The verdict of a diagnosis in one sentence."""

from __future__ import annotations

from collections.abc import Sequence

from wbc.identification import Diagnosis, Finding
from wbc.identification.answer.verdict import CERTAIN


def verdict_sentence(diagnosis: Diagnosis) -> str:
    """Return what a diagnosis says, in one sentence with its numbers."""
    before, after = _floors(diagnosis.error.before), _floors(diagnosis.error.after)
    found = _sum_up(diagnosis.findings)
    opening = found[:1].upper() + found[1:]
    match diagnosis.verdict:
        case "none":
            return f"Nothing is missing: the robot explains these logs to {after} noise floors."
        case "named":
            return (
                f"{opening} {_verb(diagnosis.findings)} what was missing: the "
                f"held-out error falls from {before} to {after} noise floors."
            )
        case "ambiguous":
            return (
                f"{opening} would take the held-out error from {before} to "
                f"{after} noise floors, but these logs cannot tell {_rivals(diagnosis.findings)}."
            )
        case "partial":
            certain = _sum_up(certain_findings(diagnosis))
            share = 100.0 * diagnosis.explained
            return (
                f"{certain[:1].upper()}{certain[1:]} {_verb(certain_findings(diagnosis))} certain. "
                f"What was found explains {share:.0f} % of the squared error ({before} to {after} "
                "noise floors); what is left has a cause that no known effect explains."
            )
        case "unknown":
            added = f" with {found}" if found else ""
            return (
                f"Something is missing that no known effect explains: of {before} noise floors "
                f"{after} remain{added}."
            )
        case "not_repeatable":
            return (
                "Repeated runs disagree with one another by more than their noise, so nothing can "
                "be named from these logs."
            )


def certain_findings(diagnosis: Diagnosis) -> tuple[Finding, ...]:
    """Return the findings that are certain, each alone or with what it cannot be told from."""
    return tuple(f for f in diagnosis.findings if f.support.group_probability >= CERTAIN)


def spoken(name: str) -> str:
    """Return the name of an effect as words."""
    return name.replace("_", " ")


def _floors(error: float) -> str:
    digits = 0 if error >= 100.0 else 1 if error >= 10.0 else 2
    return f"{error:.{digits}f}"


def _sum_up(findings: Sequence[Finding]) -> str:
    places: dict[str, list[str]] = {}
    for finding in findings:
        where = finding.effect.where
        places.setdefault(finding.effect.name, []).append(where)
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
