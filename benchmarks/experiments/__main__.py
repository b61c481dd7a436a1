"""Does one designed run resolve a tied diagnosis, where the advice in words resolves 90 %?

    python -m benchmarks.experiments --seed 23 --cases 0:156
    python -m benchmarks.experiments --seed 23 --cases 22,28,63

Every case of the corpus with a fixed base is diagnosed; where it ties, four follow-ups are
recorded on the same machine and diagnosed together with the first logs: the runs that the advice
in words asks for (one of 8 s per kind), and one run of 10 s along a random, a D-optimal and a
designed motion within the same limits. Results are kept in the folder: a run that was stopped goes
on where it was.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from benchmarks.corpus.case import Case
from benchmarks.corpus.draw import SEED, draw_case
from benchmarks.corpus.record import record_cases
from benchmarks.corpus.trial import logs_of, robot_of, tried
from benchmarks.corpus.verdicts import judge_result
from benchmarks.experiments.follow_up import ARMS, DESIGNED, WORDS, follow_ups
from benchmarks.experiments.judge import Result, paired, resolved, share, single
from wbc.files import write_text
from wbc.identification import Diagnosis
from wbc.measurement import Log

_AT_ONCE = 8  # cases simulated side by side
_FIXED = ("pendulum", "arm2", "arm3", "arm4", "arm6")


def main() -> None:
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--folder", type=Path, default=Path("out/experiments"))
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--cases", default="0:40", help="FIRST:END or N,N,...")
    options = parser.parse_args()
    if ":" in options.cases:
        first, end = map(int, options.cases.split(":"))
        numbers = list(range(first, end))
    else:
        numbers = [int(n) for n in options.cases.split(",")]
    folder = options.folder / f"seed{options.seed}"
    left = [n for n in numbers if not _file(folder, n).exists()]
    for k in range(0, len(left), _AT_ONCE):
        _try(left[k : k + _AT_ONCE], folder, options.seed)
    print(report([json.loads(_file(folder, n).read_text("utf-8")) for n in numbers]))


def _try(numbers: Sequence[int], folder: Path, seed: int) -> None:
    """Diagnose cases, plan and record what follows where they tie, and keep the results."""
    drawn = [draw_case(n, seed) for n in numbers]
    cases = [c for c in drawn if c.machine.family in _FIXED and c.flaws and not c.unlisted]
    for case in drawn:
        if case not in cases:
            _keep(folder, case, {"tied": False})
    tables = record_cases([(case, case.excitations) for case in cases])
    for case, recorded in zip(cases, tables, strict=True):
        logs = logs_of(recorded)
        first, diagnosis = tried(case, logs)
        if diagnosis is None or diagnosis.verdict != "ambiguous":
            _keep(folder, case, {"tied": False})
        else:
            _keep(folder, case, _followed(case, logs, first, diagnosis))


def _followed(case: Case, logs: list[Log], first: Result, diagnosis: Diagnosis) -> Result:
    arms, reason = follow_ups(case, robot_of(case), diagnosis)
    recorded = record_cases([(case, runs) for runs in arms.values()])
    after = {}
    for (name, runs), more in zip(arms.items(), recorded, strict=True):
        longer = replace(case, excitations=(*case.excitations, *runs))
        after[name] = tried(longer, [*logs, *logs_of(more)])[0]
    return {"tied": True, "first": first, "after": after, "unplanned": reason}


def _file(folder: Path, number: int) -> Path:
    return folder / f"{number:04d}.json"


def _keep(folder: Path, case: Case, result: Result) -> None:
    write_text(_file(folder, case.number), json.dumps(result))
    if result["tied"]:
        print(_line(case.number, result), flush=True)


def _after(result: Result, name: str) -> Result:
    """Return the diagnosis after a follow-up; the first one where there is nothing to run."""
    return dict(result["after"].get(name, result["first"]))


def _line(number: int, result: Result) -> str:
    marks = {name: "+" if resolved(_after(result, name)) else "-" for name in ARMS}
    seen = " ".join(f"{marks[name]} {name}" for name in ARMS)
    found = "; ".join(
        f"{e['effect']}@{e['where']} or {'/'.join(e['alternatives'])}"
        for e in result["first"]["found"]
        if e["alternatives"]
    )
    reason = f" ({result['unplanned'][:40]}...)" if result["unplanned"] else ""
    return f"{number:4d} {result['first']['label'][:40]:40s} {seen}  was {found}{reason}"


def report(results: Sequence[Result]) -> str:
    """Return the shares that each follow-up resolves, with 90 % intervals."""
    tied = [r for r in results if r["tied"]]
    groups = {
        "all": tied,
        "one cause": [r for r in tied if len(r["first"]["causes"]) == 1],
        "where a motion can be planned": [r for r in tied if not r["unplanned"]],
        "names more than is right": [r for r in tied if not resolved(r["first"])],
    }
    planned = groups["where a motion can be planned"]
    lines = [
        f"{len(tied)} of {len(results)} cases tie, the base fixed; for {len(tied) - len(planned)} "
        "no motion can be planned, and the first answer stands"
    ]
    asked = [(f"resolved: {title}", group, resolved) for title, group in groups.items()]
    asked.append(("one name left, where a motion can be planned", planned, single))
    for title, group, question in asked:
        lines += ["", title]
        hits = {name: [question(_after(r, name)) for r in group] for name in ARMS}
        for name in ARMS:
            beside = "" if name == DESIGNED else f"   {paired(hits[DESIGNED], hits[name])}"
            lines.append(f"  {name:16s} {share(hits[name])}{beside}")
    runs = [len(r["after"][WORDS]["runs"]) - len(r["first"]["runs"]) for r in tied]
    if runs:
        mean = sum(runs) / len(runs)
        lines += ["", f"the advice in words asks for {mean:.1f} runs of 8 s on average"]
    lost = [r for r in tied if not judge_result(_after(r, DESIGNED)).covered]
    lines += [f"truth lost after the designed run: {len(lost)} of {len(tied)}"]
    return "\n".join(lines)


if __name__ == "__main__":
    main()
