"""What each effect is worth: paired differences on held-out data."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.arrays import FloatArray
from wbc.effects import EFFECTS
from wbc.errors import WbcError
from wbc.identification import Diagnosis
from wbc.identification.fit import refine
from wbc.identification.folds import block_means
from wbc.identification.problem import Problem
from wbc.robot import Effect
from wbc.view.report.sentence import spoken


@dataclass(frozen=True)
class Worth:
    """A model beside the one that was found.

    Attributes:
        model: in words.
        error: held-out root mean square in noise floors.
        difference: held-out mean square minus that of the model found [floors^2].
        deviation: standard error of the difference, blocks of a log taken as one observation.
        verdict: "worse" or "better" than the model found, or "not distinguishable"; empty for
            the model found itself.
    """

    model: str
    error: float
    difference: float
    deviation: float
    verdict: str


def worth_table(problem: Problem, diagnosis: Diagnosis) -> tuple[Worth, ...]:
    """Return the found model, the one without each effect, and the rivals, best first."""
    found = list(diagnosis.effects)
    # The parameters are fitted already; fitting again would compare with another model.
    as_found = refine(problem.robot, found, problem.records, problem.whitening, iterations=0)
    best = problem.held_out(as_found)
    rows = [Worth("all effects found" if found else "robot as given", _rms(best), 0.0, 0.0, "")]
    if not found:
        return tuple(rows)
    variants: list[tuple[str, list[Effect]]] = []
    if len(found) > 1:
        for k, effect in enumerate(found):
            rest = found[:k] + found[k + 1 :]
            variants.append((f"without {spoken(effect.name)} at {effect.where}", rest))
    variants.append(("robot as given", []))
    for k, finding in enumerate(diagnosis.findings):
        for name in finding.alternatives:
            rival = _rival(name, finding.effect, problem)
            if rival is not None:
                text = f"{spoken(name)} instead of {spoken(finding.effect.name)}"
                variants.append((text, [*found[:k], rival, *found[k + 1 :]]))
    for label, effects in variants:
        rows.append(_beside(problem, label, problem.held_out(problem.fit(effects)), best))
    return tuple(sorted(rows, key=lambda row: row.difference))


def _beside(problem: Problem, label: str, squares: FloatArray, best: FloatArray) -> Worth:
    differences = block_means((squares - best).mean(axis=1), problem.blocks)
    verdict = "not distinguishable"
    if problem.significant(squares, best):
        verdict = "worse"
    elif problem.significant(best, squares):
        verdict = "better"
    return Worth(
        label,
        _rms(squares),
        float(np.mean(squares - best)),
        float(np.std(differences, ddof=1) / np.sqrt(differences.size)),
        verdict,
    )


def _rival(name: str, effect: Effect, problem: Problem) -> Effect | None:
    """Return the effect that an alternative names, at a place where it can sit."""
    kind, _, place = name.partition(" at ")
    where = place or effect.where
    if kind not in EFFECTS:
        return None
    cls = EFFECTS[kind]
    if where not in cls.places(problem.robot):
        return None
    try:
        return cls.at(where, cls.null_values(problem.robot, where))
    except WbcError:
        return None


def _rms(squares: FloatArray) -> float:
    return float(np.sqrt(np.mean(squares)))
