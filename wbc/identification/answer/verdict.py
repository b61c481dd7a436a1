"""What a search amounts to, and what to record next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import permutations

import numpy as np

from wbc.identification.answer.diagnosis import Finding, Verdict
from wbc.identification.answer.remainder import Remainder
from wbc.identification.answer.words import joined, only_noise
from wbc.identification.choice.weighing.certainty import CERTAIN, EVEN, Support
from wbc.identification.choice.weighing.hypothesis import Hypothesis
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.records.noise.noise_floor import NoiseFloor
from wbc.robot import Effect

# Share of the mean square error of one output that is no small part: 0.25 to 0.9 give the same
# verdicts on 60 generated logs in which something stays unexplained.
_SUBSTANTIAL = 0.5
_ASKED = 2  # experiments for what is left, the worst output first
_MOTIONS = 3  # motions at a place to tell rivals apart: of the cause, then of the likeliest rivals
_SEVERAL = 2  # names that are likely and not certain, beside certain ones: something else is there
_DISAGREEMENT = 4.0  # repeated runs differ by so many times what their sensors' noise explains


def verdict_of(
    problem: EstimationProblem,
    first: Hypothesis,
    final: Hypothesis,
    support: Sequence[Support],
    more: bool,
) -> Verdict:
    """Return the verdict.

    Several names that are likely and not certain, beside a certain one, are a sign of a cause that
    is not in the list: each takes a part of it.

    Args:
        problem: the logs.
        first: the robot as given.
        final: what was found.
        support: of its causes, in their order.
        more: whether something is left that nothing found explains.
    """
    if more:
        certain = any(s.group_probability >= CERTAIN for s in support)
        return "partial" if certain and _substantial(first, final) else "unknown"
    if not final.effects:
        return "none" if problem.floor.excess < _DISAGREEMENT else "not_repeatable"
    likely = [s for s in support if s.group_probability >= EVEN]
    if not likely:
        return "unknown"
    certain = any(s.group_probability >= CERTAIN for s in likely)
    pairs = zip(final.effects, support, strict=True)
    open_names = {e.name for e, s in pairs if EVEN <= s.group_probability < CERTAIN}
    if certain and len(open_names) >= _SEVERAL:
        return "partial"
    return "named" if certain and not any(s.group > s.odds for s in likely) else "ambiguous"


def _substantial(first: Hypothesis, final: Hypothesis) -> bool:
    """Whether the causes found explain a substantial part of what was missing at some output."""
    before = np.maximum(first.outputs - 1.0, 1e-300)
    share = 1.0 - np.maximum(final.outputs - 1.0, 0.0) / before
    return bool(np.any((share > _SUBSTANTIAL) & (before > 1.0)))


def explained_share(first: Hypothesis, final: Hypothesis) -> float:
    """Return the share of the mean square error above the floor that was taken away."""
    before = max(first.error - 1.0, 1e-300)
    return float(np.clip(1.0 - max(final.error - 1.0, 0.0) / before, 0.0, 1.0))


NOTHING_MOVES = (
    "Nothing moves in these logs, and at rest every effect looks like another. Move each "
    "joint back and forth through its range, slowly and fast, loaded and unloaded."
)
"""What to record next where no joint moves."""


def next_experiment(
    verdict: Verdict,
    findings: Sequence[Finding],
    left: Sequence[Remainder],
    floor: NoiseFloor,
    classes: Mapping[str, type[Effect]],
    silent: Sequence[str] = (),
) -> str:
    """Return what to record next, in words.

    Args:
        verdict: of the diagnosis.
        findings: the effects found.
        left: what they leave.
        floor: the noise floor.
        classes: the candidates by name.
        silent: joints whose drives report only noise.
    """
    if verdict == "none":
        return "Nothing is missing on these logs; record faster or loaded motions to look further."
    if verdict == "not_repeatable":
        return (
            "Runs that should repeat one another do not: check what changed between them "
            "(temperature, mounting, payload, supply) and record one motion several times."
        )
    if verdict in ("unknown", "partial"):
        other = [one for one in left if one.output not in silent]
        known = [_of_what_is_left(other, floor)] if other or not silent else []
        return " ".join([*_of_noise(silent), *known])
    texts = _to_tell_apart(findings, classes)
    return " ".join(texts or dict.fromkeys(finding.effect.experiment for finding in findings))


def _to_tell_apart(findings: Sequence[Finding], classes: Mapping[str, type[Effect]]) -> list[str]:
    """Return the motions that tell rivals apart, each once, and what no motion tells."""
    places: dict[tuple[str, ...], dict[str, None]] = {}
    impossible: dict[str, None] = {}
    for finding in findings:
        if not finding.alternatives:
            continue
        names = dict.fromkeys(a.effect for a in finding.alternatives)
        kinds = [type(finding.effect), *(classes[name] for name in names if name in classes)]
        motions = dict.fromkeys(_motion(kind) for kind in kinds)
        places.setdefault(tuple(motions)[:_MOTIONS], {})[finding.effect.where] = None
        impossible |= dict.fromkeys(_what_no_run_tells(finding, classes))
    if not places:
        return []
    asked = [f"At {joined(list(at))}: {'; '.join(motions)}." for motions, at in places.items()]
    return ["Record more motions.", *asked, *impossible]


def _motion(kind: type[Effect]) -> str:
    """Return the motion that shows an effect, without what it shows: the logs will tell that."""
    motion = kind.experiment.partition(": ")[0].rstrip(".")
    return motion[:1].lower() + motion[1:]


def _of_noise(silent: Sequence[str]) -> list[str]:
    """Return what to do about drives that report only noise."""
    if not silent:
        return []
    it, joints = ("it", "this joint") if len(silent) == 1 else ("them", "these joints")
    return [
        f"{only_noise(silent)}, so these logs say nothing about {joints}. Move {it} faster or with "
        "a known weight. If the reported torque stays noise, correct its column, its unit or the "
        "torque constant."
    ]


def _of_what_is_left(left: Sequence[Remainder], floor: NoiseFloor) -> str:
    worst = sorted(left, key=lambda one: -one.floors)
    asked = list(dict.fromkeys(one.experiment for one in worst if one.experiment))[:_ASKED]
    texts = [f"{text[:1].upper()}{text[1:]}." for text in asked]
    if not floor.repeats:
        texts.append("Repeat one run exactly: that shows how much of what is left is noise.")
    if not asked:
        texts.append("Move one joint at a time, slowly and fast, through the same positions.")
    return " ".join(texts)


def _what_no_run_tells(finding: Finding, classes: Mapping[str, type[Effect]]) -> list[str]:
    """Return a sentence for every two of the rivals that no experiment on a robot separates."""
    names = dict.fromkeys([finding.effect.name, *(a.effect for a in finding.alternatives)])
    rivals = [classes[name] for name in names if name in classes]
    pairs = permutations(rivals, 2)
    return [
        one.search.inseparable[other.name]
        for one, other in pairs
        if other.name in one.search.inseparable
    ]
