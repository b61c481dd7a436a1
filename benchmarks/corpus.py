"""Scorecard of the diagnosis on generated logs with known truth.

    python -m benchmarks.corpus --count 500 --seed 7

The logs come from the closed-form plant of tests/recover, which shares no code with the library:
0 to 3 effects of random size and place, some outside the list, four, two or one run, three levels
of excitation, ordinary and tripled sensor noise.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter

import numpy as np

from benchmarks.corpus_cases import Case, make_cases
from tests.recover.plant import REFLECTED, simulate
from wbc.effects import load_robot
from wbc.identification import Diagnosis, diagnose
from wbc.measurement import Log

# Effect -> parameter whose true value follows from the size that was put in.
MEASURED = {
    "viscous_friction": ("coefficient", lambda s: s),
    "coulomb_friction": ("level", lambda s: s),
    "quadratic_drag": ("coefficient", lambda s: s),
    "transmission_efficiency": ("forward_efficiency", lambda s: s),
    "rotor_inertia": ("reflected_inertia", lambda s: REFLECTED + s),
    "payload_mass": ("mass", lambda s: s),
    "center_of_mass": ("z", lambda s: -s),
    "joint_spring": ("stiffness", lambda s: s),
    "torque_ripple": ("amplitude", lambda s: s),
    "torque_constant": ("factor", lambda s: s),
    "torque_offset": ("offset", lambda s: s),
    "actuation_delay": ("delay", lambda s: s),
    "position_offset": ("offset", lambda s: s),
    "backlash": ("width", lambda s: s),
    "joint_compliance": ("stiffness", lambda s: s),
}
AT_ONCE = 60  # cases simulated side by side
FLOORS = 5.0  # above which something outside the list should be called unknown


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--all", action="store_true", help="print every case, not only misses")
    options = parser.parse_args()
    tally: Counter[str] = Counter()
    sizes: list[int] = []
    spent: list[float] = []
    cases = make_cases(options.count, options.seed)
    for first in range(0, len(cases), AT_ONCE):
        chunk = cases[first : first + AT_ONCE]
        for case, logs in zip(chunk, _recorded(chunk), strict=True):
            start = time.perf_counter()
            robot = load_robot("planar_leg_fixed").lossless()
            diagnosis = diagnose(robot, logs)
            spent.append(time.perf_counter() - start)
            good = _score(case, diagnosis, tally, sizes)
            if options.all or not good:
                print(_line(case, diagnosis, good), flush=True)
    _report(tally, sizes, spent)


def _recorded(cases: list[Case]) -> list[list[Log]]:
    tables = simulate([lane for case in cases for lane in case.lanes], 10.0)
    result, first = [], 0
    for case in cases:
        logs = []
        for table in tables[first : first + len(case.lanes)]:
            rows = int(case.duration * 500)
            columns = {name: values[:rows] for name, values in table.items()}
            logs.append(Log(columns.pop("time"), columns))
        first += len(case.lanes)
        result.append(logs)
    return result


def _score(case: Case, diagnosis: Diagnosis, tally: Counter[str], sizes: list[int]) -> bool:
    """Count what this case adds to the scorecard; return whether nothing was missed."""
    truth = {name for name, _ in case.truth}
    named = {effect.name for effect in diagnosis.effects}
    rivals = {a.split(" at ")[0] for f in diagnosis.findings for a in f.alternatives}
    if case.unknown:
        large = diagnosis.error.before >= FLOORS
        tally["outside, large"] += large
        tally["outside, large, unknown"] += large and diagnosis.verdict == "unknown"
        return diagnosis.verdict == "unknown" or not large
    if not truth:
        tally["nothing"] += 1
        tally["nothing, false alarm"] += diagnosis.verdict != "none"
        return diagnosis.verdict == "none"
    covered = truth <= named | rivals and diagnosis.verdict in ("named", "ambiguous")
    if len(truth) == 1:
        tally["one"] += 1
        tally["one, in set"] += covered
        sizes.append(len(named | rivals))
        if len(named | rivals) == 1:
            tally["one, set of one"] += 1
            tally["one, set of one, right"] += named == truth
    elif len(truth) == 2:
        tally["two"] += 1
        tally["two, both found"] += covered
    places = {(e.name, e.where) for e in diagnosis.effects}
    tally["with effects"] += 1
    tally["with effects, all and only the truth, in place"] += places == set(case.truth)
    for finding in diagnosis.findings:
        key = (finding.effect.name, finding.effect.where)
        if places == set(case.truth) and key[0] in MEASURED:
            parameter, true_value = MEASURED[key[0]]
            estimate = finding.parameters[parameter]
            tally["intervals"] += 1
            value = true_value(case.values[key])
            tally["intervals, hit"] += estimate.low <= value <= estimate.high
    return covered


def _line(case: Case, diagnosis: Diagnosis, good: bool) -> str:
    found = ", ".join(
        f"{f.effect.name}@{f.effect.where}"
        + (f" or {'/'.join(f.alternatives)}" * bool(f.alternatives))
        for f in diagnosis.findings
    )
    return (
        f"{'  ' if good else '! '}{case.label:60s} {diagnosis.verdict:10s} "
        f"{diagnosis.error.before:7.1f} ->{diagnosis.error.after:6.2f}  {found}"
    )


def _report(tally: Counter[str], sizes: list[int], spent: list[float]) -> None:
    rows = [
        ("truth in the named set", "one, in set", "one", ">= 98 %"),
        ("first name right, set of one", "one, set of one, right", "one, set of one", ">= 95 %"),
        ("false alarm", "nothing, false alarm", "nothing", "<= 2 %"),
        (
            "outside called unknown, >= 5 floors",
            "outside, large, unknown",
            "outside, large",
            ">= 90 %",
        ),
        ("two effects both found", "two, both found", "two", ">= 85 %"),
        (
            "all and only the truth, in place",
            "with effects, all and only the truth, in place",
            "with effects",
            "",
        ),
        ("90 % intervals cover", "intervals, hit", "intervals", "85-95 %"),
    ]
    print(f"\n{'':42s}{'share':>8s}{'of':>6s}   target")
    for label, part, whole, target in rows:
        share = 100.0 * tally[part] / max(tally[whole], 1)
        print(f"{label:42s}{share:7.1f}%{tally[whole]:6d}   {target}")
    print(f"{'mean set size':42s}{np.mean(sizes or [0]):8.2f}{len(sizes):6d}   <= 1.5")
    print(f"{'seconds per case (median, max)':42s}{np.median(spent):8.2f}{np.max(spent):6.1f}")


if __name__ == "__main__":
    main()
