"""Diagnose the corpus and print its scorecard.

    python -m benchmarks.corpus --folder out/corpus --jobs 2
    python -m benchmarks.corpus --folder out/corpus --half even --json scorecard.json

    python -m benchmarks.corpus --cases 0:130 --withhold-forces

Every case follows from the seed and its number. Results are kept one by one in the folder: a run
that was stopped goes on where it was. Numbers are learned on even cases, judged on odd ones. Cases
from 520 on hold a cause of the list beside one that is not in it.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable
from functools import partial
from pathlib import Path

from benchmarks.corpus.draw import COUNT, SEED, family_of
from benchmarks.corpus.report import line, report
from benchmarks.corpus.scorecard import score
from benchmarks.corpus.trial import Result, try_cases
from wbc.files import write_text
from wbc.parallel import run_jobs

_AT_ONCE = 26  # cases simulated side by side


def main() -> None:
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--folder", type=Path, default=Path("out/corpus"), help="of the results")
    parser.add_argument("--cases", default=f"0:{COUNT}", help="first:end")
    parser.add_argument("--half", choices=["even", "odd"], help="only these numbers")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument(
        "--withhold-forces",
        action="store_true",
        help="only the cases with feet on the ground, without their force sensors",
    )
    parser.add_argument("--family", help="only the cases of this family of machines")
    parser.add_argument("--jobs", type=int, default=1, help="processes on this computer")
    parser.add_argument("--json", type=Path, help="write the scorecard here")
    options = parser.parse_args()
    first, end = (int(part) for part in options.cases.split(":"))
    numbers = [n for n in range(first, end) if options.half in (None, ("even", "odd")[n % 2])]
    family = "biped" if options.withhold_forces else options.family
    if family:
        numbers = [n for n in numbers if family_of(n, options.seed) == family]
    name = f"seed{options.seed}" + ("-withheld" if options.withhold_forces else "")
    folder = options.folder / name
    missing = [n for n in numbers if not (folder / f"{n:04d}.json").exists()]
    for done, result in enumerate(_run(missing, folder, options), start=1):
        print(f"{done}/{len(missing)} {line(result)}", flush=True)
    results = [json.loads((folder / f"{n:04d}.json").read_text()) for n in numbers]
    print(report(results))
    if options.json:
        rows = [figure._asdict() for figure in score(results)]
        write_text(options.json, json.dumps(rows, indent=1))


def _run(missing: list[int], folder: Path, options: argparse.Namespace) -> Iterable[Result]:
    chunks = [missing[k : k + _AT_ONCE] for k in range(0, len(missing), _AT_ONCE)]
    work = partial(
        try_cases,
        folder=folder.resolve(),
        seed=options.seed,
        withheld=options.withhold_forces,
    )
    for results in run_jobs(work, chunks, options.jobs):
        yield from results


if __name__ == "__main__":
    main()
