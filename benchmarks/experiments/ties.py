"""Many tied causes: by how many nats does each follow-up tell the true one from its rivals?

    python -m benchmarks.experiments.ties --seed 40 --cases 0:200

Machines and sensors are those of the corpus, up to four joints on a fixed base, with one cause of
its list. A large cause seldom ties, and any lively run decides it. So each is made so small that
along a poor first run of 4 s its closest rival, refitted, leaves 2 nats of it in white noise, while
it is worth 60 or more beside no cause at all. That run is recorded, and the rivals within 3 nats of
the true cause tie. The same four follow-ups as in `benchmarks.experiments` are recorded, with the
sensors' noise and rounding, and every tied cause is fitted to both runs. The evidence of the true
one minus that of its best rival is what counts. *Decided*: more than 3 nats, so that a diagnosis
names the true cause alone; *misled*: less than -3.

Rivals that do all that the true cause does are left out: no motion speaks against them. Results are
kept in the folder: a run that was stopped goes on where it was.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.corpus.case import Case
from benchmarks.corpus.draw import LISTED, draw_case
from benchmarks.corpus.excitation import Excitation, reference
from benchmarks.corpus.experiments import RUN_FOR
from benchmarks.corpus.flaws import Flaw
from benchmarks.corpus.record import record_cases
from benchmarks.corpus.trial import logs_of, robot_of
from benchmarks.experiments.follow_up import ARMS, DESIGNED, WORDS, planned_runs
from benchmarks.experiments.judge import paired, share
from wbc.design.experiment import Cause, Predictions, Rivals, require_predictable, typical_values
from wbc.effects import effect_class
from wbc.errors import DesignError, WbcError
from wbc.files import write_text
from wbc.identification.choice.weighing.evidence import weigh
from wbc.identification.choice.weighing.odds import TIED
from wbc.identification.choice.weighing.trials import Trials
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.measurement import Log
from wbc.robot import Effect, Motion, Robot

Result = dict[str, Any]
_FIXED = ("pendulum", "arm2", "arm3", "arm4")
_STARTS = ("slow", "one_joint", "holds", "multisine")
_RATE = 50.0  # [Hz] at which rivals are looked for
_LEFT = 2.0  # [nats] that the closest rival leaves of the cause along the first run
_FELT = 60.0  # [nats] of a cause that is plain to see: its name, place and number cost 10
_SMALLER = 0.3  # of the square of a typical size, that a cause may be larger
_ALIKE = 1e-4  # of a cause's squared torque: what another one leaves of it when it is the same
_MOST = 3  # rivals, as many as `wbc experiment` takes beside what was found
_TELLABLE = 3.0  # [nats] said of a planned motion: where none says more, there is none


def main() -> None:
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--folder", type=Path, default=Path("out/ties"))
    parser.add_argument("--seed", type=int, default=40)
    parser.add_argument("--cases", default="0:40", help="FIRST:END")
    parser.add_argument("--seconds", type=float, default=np.inf, help="stop after this CPU time")
    options = parser.parse_args()
    first, end = map(int, options.cases.split(":"))
    folder, results = options.folder / f"seed{options.seed}", []
    for number in range(first, end):
        file = folder / f"{number:04d}.json"
        if not file.exists():
            if time.process_time() > options.seconds:
                break
            write_text(file, json.dumps(judged(draw_case(number, options.seed))))
        results.append(json.loads(file.read_text("utf-8")))
    print(report(results))


def judged(case: Case) -> Result:
    """Return by how many nats each follow-up tells the true cause from those that tie."""
    if case.machine.family not in _FIXED:
        return {"tied": False}
    random, robot = np.random.default_rng([case.number, 21]), robot_of(case)
    start = Excitation(str(random.choice(_STARTS)), case.number, 4.0, case.number)
    try:
        truth, rivals = small_and_close(case, robot, start, random)
        case = replace(case, flaws=(Flaw(truth.name, truth.where, truth.values),))
        logs = logs_of(record_cases([(case, (start,))])[0])
        causes = tied((truth, *rivals), robot, logs)
        if len(causes) < 2:
            return {"tied": False}
        runs, said = planned_runs(case, robot, causes)
    except WbcError as reason:
        return {"tied": False, "reason": str(reason)}
    arms: dict[str, tuple[Excitation, ...]] = {WORDS: _words(case, causes), **runs}
    recorded = record_cases([(case, follow) for follow in arms.values()])
    return {
        "tied": True,
        "family": case.machine.family,
        "causes": ["@".join(cause[0].key) for cause in causes],
        "runs": len(arms[WORDS]),
        "said": {
            name: [one.odds[0, k] for k in range(1, len(causes))] for name, one in said.items()
        },
        "nats": {
            name: margins(robot, [*logs, *logs_of(more)], causes)
            for name, more in zip(arms, recorded, strict=True)
        },
    }


def small_and_close(
    case: Case, robot: Robot, run: Excitation, random: np.random.Generator
) -> tuple[Effect, list[Effect]]:
    """Return a cause of the size at which others tie along a run, and those others.

    Drawn among the effects of typical size that would still be seen.

    Raises:
        DesignError: nothing comes close to any cause where it can be seen.
    """
    every = _every(robot)
    noise = np.asarray(case.torque_noise / np.abs(case.machine.ratio))
    rivals = Rivals(robot, tuple((effect,) for effect in every), noise)
    time = np.arange(0.0, run.duration, 1.0 / _RATE)
    spline = reference(case.machine, run)
    q, v, a = (spline(time, k) for k in range(3))
    found, scale = rivals.predictions(Motion(q, v, a, time)), case.sensors.rate / _RATE
    felt = scale * np.array([found.signal(i) for i in range(len(every))])
    left = scale * _left(found, noise, len(every))
    left[left <= _ALIKE * felt[:, None]] = np.inf
    least = left.min(axis=1)
    seen = (_FELT * least < _LEFT * felt) & (least > _SMALLER * _LEFT)
    for i in random.permutation(np.flatnonzero(seen))[:1]:
        order = np.argsort(left[i])[:_MOST]
        truth = _resized(every[i], robot, float(np.sqrt(_LEFT / least[i])))
        return truth, [every[j] for j in order if left[i, j] < 1.5 * least[i]]
    raise DesignError("nothing comes close to any cause that can be seen.")


def _left(found: Predictions, noise: np.ndarray, count: int) -> np.ndarray:
    """Return (i, j) half the square that cause j, refitted, leaves of cause i [nats]."""
    nothing = found.torque(())
    torques = [((found.expected_torque(i) - nothing) / noise).ravel() for i in range(count)]
    added, left = np.stack(torques, axis=1), np.full((count, count), np.inf)
    for j in range(count):
        basis = np.linalg.qr(found.sensitivity(j))[0]
        apart = added - added[:, [j]]
        left[:, j] = 0.5 * np.sum((apart - basis @ (basis.T @ apart)) ** 2, axis=0)
    np.fill_diagonal(left, np.inf)
    return left


def _every(robot: Robot) -> list[Effect]:
    """Return every listed effect whose torque a motion tells, at every place, of typical size."""
    found = []
    for name in LISTED:
        kind = effect_class(name)
        for where in kind.places(robot):
            effect = kind.at(where, typical_values(name, kind.null_values(robot, where)))
            try:
                require_predictable(effect, robot)
            except DesignError:
                break
            found.append(effect)
    return found


def _resized(effect: Effect, robot: Robot, ratio: float) -> Effect:
    null = effect.null_values(robot, effect.where)
    sizes = {p.name for p in effect.parameters if not p.shape and p.name in null}
    moved = {k: null[k] + ratio * (v - null[k]) for k, v in effect.values.items() if k in sizes}
    return effect.with_values({**effect.values, **moved})


def tied(effects: Sequence[Effect], robot: Robot, logs: Sequence[Log]) -> list[Cause]:
    """Return the first effect as fitted and those that the logs do not tell from it, if any."""
    trials = Trials(EstimationProblem.from_logs(robot, logs))
    true = trials.of(effects[:1])
    if true is None or not true.believable:
        return []
    others = [h for h in trials.all_of([(e,) for e in effects[1:]]) if h.believable]
    scores = weigh(trials.problem, [true, trials.nothing, *others])
    if scores[1] > scores[0] - TIED or max(scores) > scores[0] + TIED:
        return []
    kept = [h for h, score in zip(others, scores[2:], strict=True) if score > scores[0] - TIED]
    return [true.effects, *(h.effects for h in kept)]


def margins(robot: Robot, logs: Sequence[Log], causes: Sequence[Cause]) -> list[float]:
    """Return the evidence of the first cause beyond that of each rival [nats].

    1e9 where a rival, -1e9 where the first one is impossible or not believable.
    """
    trials = Trials(EstimationProblem.from_logs(robot, logs))
    tried = [h if h is not None and h.believable else None for h in map(trials.of, causes)]
    if tried[0] is None:
        return [-1e9] * (len(causes) - 1)
    scores = iter(weigh(trials.problem, [h for h in tried if h is not None]))
    own = next(scores)
    return [1e9 if h is None else float(own - next(scores)) for h in tried[1:]]


def _words(case: Case, causes: Sequence[Cause]) -> tuple[Excitation, ...]:
    """Return one run of 8 s of each kind that the causes' advice in words asks for."""
    kinds = dict.fromkeys(RUN_FOR[c[0].name] for c in causes if c[0].name in RUN_FOR)
    first = 1_000_000 + 100 * case.number
    return tuple(Excitation(kind, first + k, 8.0, first + k) for k, kind in enumerate(kinds))


def report(results: Sequence[Result]) -> str:
    """Return the shares decided and the quantiles of the nats, per follow-up."""
    ties = [r for r in results if r["tied"]]
    lines = [f"{len(ties)} of {len(results)} cases tie"]
    told = [r for r in ties if len(_tellable(r))]
    for title, group, kept in (
        ("all rivals", ties, lambda r: range(len(r["causes"]) - 1)),
        ("rivals that a planned motion tells", told, _tellable),
    ):
        lines += ["", f"{title}: {len(group)} ties"]
        least = {n: [min(r["nats"][n][k] for k in kept(r)) for r in group] for n in ARMS}
        for name in ARMS if group else ():
            nats = np.array(least[name])
            hits = [bool(n > TIED) for n in nats]
            tenth, half = np.quantile(nats, (0.1, 0.5), method="nearest")
            wrong = int(np.sum(nats < -TIED))
            beside = ""
            if name != DESIGNED:
                beside = paired([bool(n > TIED) for n in least[DESIGNED]], hits)
            lines.append(
                f"  {name:16s} decided {share(hits)}, misled {wrong}; "
                f"nats: tenth {tenth:5.1f}, median {half:5.1f}   {beside}"
            )
    runs = [r["runs"] for r in ties]
    lines += ["", f"words: {np.mean(runs):.1f} runs of 8 s on average"] if runs else []
    return "\n".join(lines)


def _tellable(result: Mapping[str, Any]) -> list[int]:
    """Return the rivals that some planned motion is said to tell from the true cause."""
    said = np.max(list(result["said"].values()), axis=0)
    return [k for k, nats in enumerate(said) if nats > _TELLABLE]


if __name__ == "__main__":
    main()
