"""Many tied causes: by how many nats does each follow-up tell the true one from its rivals?

    python -m benchmarks.experiments.ties --seed 40 --cases 0:120 --seconds 110
    python -m benchmarks.experiments.ties --seed 40 --cases 0:120 --duration 2

Machines and sensors are those of the corpus, up to four joints on a fixed base. A large cause
seldom ties, and any lively run decides it. So each machine gets four first runs that are poor as in
life (2 to 4 s; slow, holding, one joint, or of a fifth to all of the usual stroke), and in each up
to two causes of the list, so small that along this run the closest rival, refitted, leaves 2 nats
in white noise, while the cause is worth 60 or more beside no cause at all. Everything is drawn by
the seed. The run is recorded, and the rivals within 3 nats of the true cause tie. Four follow-ups
are recorded, with the sensors' noise and rounding: the runs that the advice in words asks for, and
one run along a random, a D-optimal and a designed motion within the same limits. Then
every tied cause is fitted to both runs. The evidence of the true one minus that of its best rival
is what counts. *Resolved*: the names kept, all within 3 nats of the best, hold the truth,
and for every other name kept the best motion of the same length for the two alone, designed for the
true values, is expected to bring less than 3 nats.

With `--duration` all follow-ups last so long: the planned ones, and each run that the words ask for
(8 s at most). The ties of a seed are the same for every length.

Where a cause can do all that the true one does, no motion speaks against it; `wbc experiment` says
so, and these ties are counted apart. Results are kept in the folder, one file per machine: a run
that was stopped goes on where it was.
"""

from __future__ import annotations

import argparse
import json
import platform
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest

from benchmarks.corpus.case import Case
from benchmarks.corpus.draw import draw_case
from benchmarks.corpus.excitation import Excitation
from benchmarks.corpus.flaws import Flaw
from benchmarks.corpus.record import record_cases
from benchmarks.corpus.trial import logs_of, robot_of
from benchmarks.experiments.follow_up import (
    ARMS,
    DURATION,
    WORDS,
    attainable,
    noise_of,
    planned_runs,
)
from benchmarks.experiments.making import candidates, names
from wbc.arrays import FloatArray
from wbc.design.experiment import Cause, Designed, Rivals
from wbc.errors import DesignError, WbcError
from wbc.files import write_text
from wbc.identification.choice.certainty import TIED
from wbc.identification.choice.evidence import weigh
from wbc.identification.choice.trials import Trials
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.measurement import Log
from wbc.robot import Effect, Robot

Result = dict[str, Any]
_FIXED = ("pendulum", "arm2", "arm3", "arm4")
_WORDS = 8.0  # [s] of a run that the words ask for
_RUNS = {
    "speeds": "viscous_friction quadratic_drag",  # several speeds
    "sweep": "coulomb_friction stribeck_friction torque_ripple",  # slowly both ways
    "slow": "load_friction transmission_efficiency",  # lift and lower slowly
    "holds": "torque_constant payload_mass center_of_mass joint_spring torque_offset "
    "position_offset gravity_direction",  # still in many poses
    "shake": "rotor_inertia actuation_delay",  # fast with small strokes
    "fast": "supply_sag current_limit",  # several joints accelerate at once
    "stops": "joint_compliance",  # stop abruptly
    "multisine": "backlash thermal_drift",  # swing the load; one loaded motion for long
}
_RUN_FOR = {effect: kind for kind, effects in _RUNS.items() for effect in effects.split()}
"""Which run the `experiment` of each listed effect describes."""


def main() -> None:
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--folder", type=Path, default=Path("out/ties"))
    parser.add_argument("--seed", type=int, default=40)
    parser.add_argument("--cases", default="0:40", help="FIRST:END")
    parser.add_argument("--duration", type=float, default=DURATION, help="of a follow-up [s]")
    parser.add_argument("--show", action="store_true", help="report what is there, try nothing")
    parser.add_argument("--seconds", type=float, default=np.inf, help="stop after this CPU time")
    options = parser.parse_args()
    print(f"python {platform.python_version()}, numpy {version('numpy')}, {platform.machine()}")
    first, end = map(int, options.cases.split(":"))
    length = "" if options.duration == DURATION else f"_{options.duration:g}s"
    folder, results = options.folder / f"seed{options.seed}{length}", []
    for number in range(first, end):
        file = folder / f"{number:04d}.json"
        if not file.exists():
            if options.show:
                continue
            if time.process_time() > options.seconds:
                break
            case = draw_case(number, options.seed)
            write_text(file, json.dumps(judged(case, options.seed, options.duration)))
        results.append(json.loads(file.read_text("utf-8")))
    print(report(results))


def judged(case: Case, seed: int, duration: float = DURATION) -> Result:
    """Return what every tie of a machine came to, after follow-ups of a length [s]."""
    if case.machine.family not in _FIXED:
        return {"made": 0, "ties": []}
    robot = robot_of(case)
    made = candidates(case, robot, np.random.default_rng([seed, case.number, 21]))
    hidden = [Flaw(one.truth.name, one.truth.where, one.truth.values) for one in made]
    cases = [replace(case, flaws=(flaw,)) for flaw in hidden]
    first = record_cases([(c, (one.run,)) for c, one in zip(cases, made, strict=True)])
    ties: list[Result] = []
    open_ends: list[_Open] = []
    for one, own, tables in zip(made, cases, first, strict=True):
        logs = logs_of(tables)
        causes, covariances = tied((one.truth, *one.rivals), robot, logs)
        if len(causes) < 2:
            continue
        rivals = Rivals(robot, causes, noise_of(own), covariances=covariances)
        tie: Result = {
            "family": case.machine.family,
            "run": one.run.kind,
            "causes": names([cause[0] for cause in causes]),
        }
        ties.append(tie)
        try:
            runs, said = planned_runs(own, rivals, duration)
        except DesignError as reason:
            tie["unplanned"] = str(reason)
            continue
        true = [(one.truth,), *causes[1:]]
        arms: dict[str, tuple[Excitation, ...]] = {WORDS: _words(case, causes, duration), **runs}
        tie["runs"] = len(arms[WORDS])
        open_ends.append(_Open(tie, own, logs, causes, true, said, arms))
    recorded = iter(record_cases([(o.case, runs) for o in open_ends for runs in o.arms.values()]))
    for one in open_ends:
        more = {name: logs_of(next(recorded)) for name in one.arms}
        one.tie["nats"] = {
            name: margins(robot, [*one.logs, *logs], one.causes) for name, logs in more.items()
        }
        # What the best motion brings against each rival that some follow-up leaves.
        left = {k for nats in one.tie["nats"].values() for k in kept(nats)[1]}
        one.tie["attainable"] = {
            str(k): attainable(one.case, robot, one.true[0], one.true[k + 1], one.said)
            for k in sorted(left)
        }
    return {"made": len(made), "ties": ties}


@dataclass(frozen=True, eq=False)
class _Open:
    """A tie whose follow-ups are still to be recorded; the true cause comes first."""

    tie: Result
    case: Case
    logs: list[Log]
    causes: tuple[Cause, ...]  # as fitted
    true: list[Cause]
    said: dict[str, Designed]
    arms: dict[str, tuple[Excitation, ...]]


def tied(
    effects: Sequence[Effect], robot: Robot, logs: Sequence[Log]
) -> tuple[tuple[Cause, ...], tuple[FloatArray, ...]]:
    """Return the first effect as fitted and those that the logs do not tell from it, if any.

    With the covariance of the values of each, as a diagnosis gives it.
    """
    try:
        trials = Trials(EstimationProblem.from_logs(robot, logs))
    except WbcError:  # too poor a run for any diagnosis: nothing ties
        return (), ()
    true = trials.of(effects[:1])
    if true is None or not true.believable:
        return (), ()
    others = [h for h in trials.all_of([(e,) for e in effects[1:]]) if h.believable]
    scores = weigh(trials.problem, [true, trials.nothing, *others])
    if scores[1] > scores[0] - TIED or max(scores) > scores[0] + TIED:
        return (), ()
    kept = [h for h, score in zip(others, scores[2:], strict=True) if score > scores[0] - TIED]
    every = [true, *kept]
    open_parts = []
    for fit in map(trials.fit, every):
        scales = [parameter.scale for _, parameter in fit.parameters]
        deviations = trials.problem.deviations(fit) * scales
        open_parts.append(deviations.T @ deviations)
    return tuple(h.effects for h in every), tuple(open_parts)


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


def _words(case: Case, causes: Sequence[Cause], duration: float) -> tuple[Excitation, ...]:
    """Return one run of each kind that the causes' advice in words asks for, of 8 s at most."""
    kinds = dict.fromkeys(_RUN_FOR[cause[0].name] for cause in causes)
    first = 1_000_000 + 100 * case.number
    length = min(duration, _WORDS)
    return tuple(Excitation(kind, first + k, length, first + k) for k, kind in enumerate(kinds))


def kept(nats: Sequence[float]) -> tuple[bool, tuple[int, ...]]:
    """Return whether a diagnosis keeps the true cause, and the rivals that it keeps.

    It keeps what lies within `TIED` nats of the best.

    Args:
        nats: evidence of the true cause beyond that of each rival.
    """
    best = max(0.0, *(-n for n in nats))
    rivals = tuple(k for k, n in enumerate(nats) if -n > best - TIED)
    return best < TIED, rivals


def settled(nats: Sequence[float], attainable: Mapping[str, float]) -> bool:
    """Whether the names kept hold the truth, and no motion speaks against the others kept.

    Args:
        nats: evidence of the true cause beyond that of each rival.
        attainable: number of a rival -> nats that the best motion for the two is expected to bring.
    """
    true, rivals = kept(nats)
    return true and all(attainable[str(k)] < TIED for k in rivals)


def share(hits: Sequence[bool]) -> str:
    """Return a share with its 90 % interval (Wilson)."""
    if not hits:
        return "no case"
    test = binomtest(int(np.sum(hits)), len(hits))
    low, high = test.proportion_ci(0.9, method="wilson")
    return f"{100 * np.mean(hits):4.0f} % ({100 * low:3.0f} to {100 * high:3.0f}) of {len(hits)}"


def report(results: Sequence[Result]) -> str:
    """Return the shares resolved, per follow-up."""
    ties = [tie for result in results for tie in result["ties"]]
    planned = [tie for tie in ties if "nats" in tie]
    machines = sum(bool(result["ties"]) for result in results)
    lines = [
        f"{len(ties)} ties on {machines} of {len(results)} machines, from "
        f"{sum(r['made'] for r in results)} small causes; for {len(ties) - len(planned)} the "
        "command says that no motion tells the causes apart"
    ]
    lines += ["", f"resolved, of the {len(planned)} for which a motion is planned"]
    solved = {
        name: [settled(tie["nats"][name], tie["attainable"]) for tie in planned] for name in ARMS
    }
    for name in ARMS if planned else ():
        lost = sum(not kept(tie["nats"][name])[0] for tie in planned)
        lines.append(f"  {name:16s} {share(solved[name])}, truth lost {lost}")
    runs = [tie["runs"] for tie in planned]
    lines += ["", f"words: {np.mean(runs):.1f} runs on average"] if runs else []
    return "\n".join(lines)


if __name__ == "__main__":
    main()
