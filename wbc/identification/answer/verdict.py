"""What a search amounts to, and what to record next."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations

from wbc.effects import EFFECTS
from wbc.identification.answer.diagnosis import Finding, Verdict
from wbc.identification.choice.hypothesis import Model
from wbc.identification.choice.unexplained import unexplained
from wbc.identification.model.problem import Problem

_DISAGREEMENT = 4.0  # repeated runs differ by so many times what their sensors' noise explains


def judge(
    problem: Problem, before: float, final: Model, alternatives: Sequence[Sequence[str]]
) -> Verdict:
    """Return the verdict from held-out errors (mean squares in floors)."""
    if unexplained(problem, before, final):
        return "unknown"
    if not final.effects:
        return "none" if problem.floor.excess < _DISAGREEMENT else "not_repeatable"
    return "ambiguous" if any(alternatives) else "named"


def next_experiment(verdict: Verdict, findings: Sequence[Finding], nothing_moves: bool) -> str:
    """Return what to record next, in words."""
    if nothing_moves:
        return (
            "Nothing moves in these logs, and at rest every effect looks like another. Move each "
            "joint back and forth through its range, slowly and fast, loaded and unloaded."
        )
    if verdict == "none":
        return "Nothing is missing on these logs; record faster or loaded motions to look further."
    if verdict == "not_repeatable":
        return (
            "Runs that should repeat one another do not: check what changed between them "
            "(temperature, mounting, payload, supply) and record one motion several times."
        )
    if verdict == "unknown":
        return (
            "No known effect explains what is left. Repeat one run exactly, then move one joint "
            "at a time slowly and fast through the same positions."
        )
    texts = []
    for finding in findings:
        if finding.alternatives:
            rivals = [EFFECTS[name].experiment for name in finding.alternatives if name in EFFECTS]
            texts.append(
                f"To tell {finding.effect.name} from {', '.join(finding.alternatives)} at "
                f"{finding.effect.where}: " + " ".join([finding.effect.experiment, *rivals])
            )
            texts += _what_no_run_tells(finding)
    if texts:
        return " ".join(dict.fromkeys(texts))
    return " ".join(dict.fromkeys(f"{f.effect.experiment}" for f in findings))


def _what_no_run_tells(finding: Finding) -> list[str]:
    """Return a sentence for every two of the rivals that no experiment on a robot separates."""
    names = [finding.effect.name, *finding.alternatives]
    rivals = [EFFECTS[name] for name in names if name in EFFECTS]
    pairs = permutations(rivals, 2)
    return [one.inseparable[other.name] for one, other in pairs if other.name in one.inseparable]
