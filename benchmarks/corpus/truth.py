"""What may rightly be said about a case: who can stand for whom, what is below the floor.

Decided by the plant's own signatures. A candidate can stand for a cause where it reproduces the
cause's signature after everything else that is in the robot is projected out: cosine above 0.995,
or what it leaves is too little to be told from noise on these logs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from benchmarks.corpus.case import Case
from benchmarks.corpus.draw import LATER, LISTED, largest
from benchmarks.corpus.flaws import DRAWING, Flaw
from benchmarks.corpus.recipes import Typical
from benchmarks.corpus.signature import Signatures
from benchmarks.corpus.spans import Span, places_of, spans_of
from benchmarks.corpus.unlisted import NAMES as UNLISTED

COSINE = 0.995
# Of what has more parameters. Not 1: signatures follow the true motion, while a shifted centre of
# mass equals a wrong encoder zero along the reported one, which is off by that zero.
EXACT = 0.9995
TELLABLE = 9.0  # chi-square of what must be left to tell two causes apart
_PARAMETERS = {
    "joint_spring": 2,
    "torque_ripple": 2,
    "stribeck_friction": 1,
    "directional_viscous_friction": 2,
    "load_presliding": 2,
    "load_stribeck_friction": 1,
    "thermal_viscous_friction": 1,
    "voltage_scaling": 2,
    DRAWING: 10,
}


@dataclass(frozen=True)
class Cause:
    """One effect that is in the robot, at all its places.

    Attributes:
        effect: name.
        where: places that feel it.
        size: rms at the output that feels it most [floors].
        felt: whether these logs show it at all.
        stand_ins: names of effects that do as well on these logs with no more parameters.
        equals: names of effects with more parameters whose torque is the same on these logs.
    """

    effect: str
    where: tuple[str, ...]
    size: float
    felt: bool
    stand_ins: tuple[str, ...]
    equals: tuple[str, ...] = ()


@dataclass(frozen=True)
class Truth:
    """What a diagnosis of a case is held against.

    Attributes:
        causes: what is hidden.
        merged: (causes, name): one effect that can stand for two.
        unexplained: size that no two listed effects explain [floors]; of unlisted causes.
    """

    causes: tuple[Cause, ...]
    merged: tuple[tuple[tuple[str, ...], str], ...]
    unexplained: float


def truth_of(case: Case, withheld: bool = False) -> Truth:
    """Return what may rightly be said about a case.

    Args:
        case: with its causes.
        withheld: whether its contact forces are not in the logs.
    """
    signatures = Signatures(case.machine, case.excitations, case.sensors, withheld)
    typical = Typical.of(case.machine, signatures)
    groups = {name: [f for f in case.flaws if f.effect == name] for name in case.causes}
    if not groups:
        return Truth((), (), 0.0)
    carried = {name: case.machine.links[k].name for name, k, _ in case.machine.contacts}
    wrong = {carried.get(flaw.where, flaw.where) for flaw in case.flaws}
    candidates = _candidates(signatures, typical, wrong)
    if case.unlisted and len(groups) == 1:
        name = case.causes[0]
        signal = signatures.of(groups[name])
        cause = _cause(name, groups[name], largest(signal), True, ())
        return Truth((cause,), (), _unexplained(signal, candidates))
    own = {name: signatures.of(flaws) for name, flaws in groups.items()}
    runs = len(case.excitations) / len(signatures.motions)
    causes, unexplained = [], 0.0
    for name, flaws in groups.items():
        left, rest = _alone(own, (name,))
        if name in UNLISTED:
            unexplained = _unexplained(left.reshape(own[name].shape), candidates)
            causes.append(_cause(name, flaws, largest(own[name]), True, ()))
            continue
        felt = largest(own[name]) >= 1.0 and runs * float(left @ left) > TELLABLE
        shown = [f for f in flaws if largest(signatures.of([f])) >= 1.0]
        if name == "backlash":  # its signature is simulated, not drawn here
            felt, shown = True, flaws
        names = _stand_ins(candidates, (name,), _order(name, flaws), left, rest, runs)
        if name == "load_friction":  # the pair of efficiencies 1 - c and 1 / (1 + c), exactly
            names.add("transmission_efficiency")
        alike = _stand_ins(candidates, (name,), None, left, rest, runs) - names
        cause = _cause(name, shown or flaws, largest(own[name]), felt, tuple(sorted(names)))
        causes.append(replace(cause, equals=tuple(sorted(alike))))
    merged = [
        (pair, name)
        for pair in combinations([name for name in groups if name not in UNLISTED], 2)
        for name in sorted(_stand_ins(candidates, pair, 2, *_alone(own, pair), runs))
    ]
    return Truth(tuple(causes), tuple(merged), unexplained)


def _alone(
    own: Mapping[str, np.ndarray], names: Sequence[str]
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return what `names` add beyond all other causes, and the signatures of those."""
    rest = [signal.ravel() for name, signal in own.items() if name not in names]
    return _without(np.sum([own[name].ravel() for name in names], axis=0), rest), rest


def _stand_ins(
    candidates: Sequence[tuple[str, str, np.ndarray]],
    names: Sequence[str],
    order: int | None,
    signal: np.ndarray,
    rest: Sequence[np.ndarray],
    runs: float,
) -> set[str]:
    """Return the effects that reproduce a signal with at most `order` parameters.

    With None they may have any number, and must be the same.
    """
    cosine = EXACT if order is None else COSINE
    return {
        effect
        for effect, _, columns in candidates
        if effect not in names
        and (order is None or columns.shape[1] <= order)
        and _stands(signal, columns, rest, runs, cosine)
    }


def _cause(
    name: str, flaws: Sequence[Flaw], size: float, felt: bool, stand_ins: tuple[str, ...]
) -> Cause:
    return Cause(name, tuple(flaw.where for flaw in flaws), size, felt, stand_ins)


def _order(name: str, flaws: Sequence[Flaw]) -> int:
    """Return how many numbers this cause has: none that stands for it may have more."""
    if name in ("center_of_mass", "gravity_direction"):
        return sum(value != 0.0 for value in flaws[0].values.values())
    return len(flaws) * _PARAMETERS.get(name, 1)


def _candidates(
    signatures: Signatures, typical: Typical, wrong: set[str]
) -> list[tuple[str, str, np.ndarray]]:
    """Return (effect, place, columns) of every shape of every effect, alone and in all gears.

    Drawings are tried where something is wrong: elsewhere they would stand for a body's cause only
    where the body's own does.
    """
    known: dict[int, np.ndarray] = {}

    def columns(span: Span) -> np.ndarray:
        stacked = []
        for flaw in span:
            key = id(flaw)
            if key not in known:
                signal = signatures.of([flaw]).ravel()
                known[key] = signal / max(float(np.linalg.norm(signal)), 1e-12)
                kept.append(flaw)
            stacked.append(known[key])
        return np.stack(stacked, axis=1)

    kept: list[Flaw] = []  # so that identities stay unique
    found = []
    for effect in (*LISTED, *LATER, DRAWING):
        places = places_of(effect, typical)
        if effect == DRAWING:
            places = tuple(place for place in places if place in wrong)
        first = []
        for where in places:
            spans = [columns(span) for span in spans_of(effect, where, typical)]
            found += [(effect, where, span) for span in spans]
            first += spans[:1]
        if places == typical.machine.driven and len(first) > 1:
            found.append((effect, "all", np.concatenate(first, axis=1)))
    return found


def _without(signal: np.ndarray, rest: Sequence[np.ndarray]) -> np.ndarray:
    """Return the signal with its projections on `rest` taken out."""
    if not rest:
        return signal
    basis = np.stack(rest, axis=1)
    return signal - basis @ np.linalg.lstsq(basis, signal, rcond=None)[0]


def _stands(
    signal: np.ndarray,
    columns: np.ndarray,
    rest: Sequence[np.ndarray],
    runs: float,
    cosine: float,
) -> bool:
    total = float(signal @ signal)
    if total == 0.0:
        return False
    basis = np.concatenate([columns, *[r[:, None] for r in rest]], axis=1)
    left = signal - basis @ np.linalg.lstsq(basis, signal, rcond=1e-9)[0]
    remains = float(left @ left)
    return remains < (1.0 - cosine**2) * total or runs * remains < TELLABLE


def _unexplained(signal: np.ndarray, candidates: Sequence[tuple[str, str, np.ndarray]]) -> float:
    """Return the largest rms that the best two listed effects leave of a signature."""
    flat, basis = signal.ravel(), np.zeros((signal.size, 0))
    left = flat
    for _ in range(2):
        best = min(candidates, key=lambda c: float(np.sum(_without(left, list(c[2].T)) ** 2)))
        basis = np.concatenate([basis, best[2]], axis=1)
        left = flat - basis @ np.linalg.lstsq(basis, flat, rcond=1e-9)[0]
    return largest(left.reshape(signal.shape))
