"""`wbc check`: what a log is good for, before anything is computed from it."""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from dataclasses import replace

from rich.console import Console

from wbc.cli.inputs import read_logs, robot_from, write_fix
from wbc.cli.outputs import Outcome
from wbc.cli.printout import Part, Spoken, print_out, table
from wbc.measurement import LogFinding, LogQuality, check_logs, find_repeats
from wbc.measurement import read_logs as read_suspicious
from wbc.measurement.guess import guessed_numbers
from wbc.measurement.robot_checks import told_by_rows
from wbc.view.rows import clock_rows, joint_rows, short_label

_NUMBER = re.compile(r"(?<![\w.])(-?\d+(?:\.\d+)?(?:e[-+]?\d+)?)(?![\w])")

_LOGS = 4  # that tell whose columns are whose


def run(options: argparse.Namespace, console: Console) -> Outcome:
    """Print the quality of every log; exit code 1 if one of them would give wrong results."""
    robot = robot_from(options)
    logs = read_logs(options.logs, options.columns, robot, read_suspicious)
    qualities = check_logs(logs, robot)
    said = _remarks(qualities)
    guessed = guessed_numbers(options.robot)
    if guessed:
        said.append(
            f"still guesses of `wbc init` in {options.robot}, every answer rests on them: "
            + ", ".join(guessed)
        )
    told = told_by_rows(robot, logs[:_LOGS]) if robot is not None else {}
    if strange := [joint for joint, (own, _) in told.items() if own < 0.5]:
        said.append(
            f"warning: motion and torque of {', '.join(strange)} fit the columns of other joints "
            "better: compare the column map with the names that the maker of the file gives."
        )
    answer = [_answer(qualities, len(said), options.quiet)]
    parts = [Part("remarks", Spoken(text, 2)) for text in said]
    for group in find_repeats(logs):
        names = ", ".join(short_label(qualities[k].label) for k in group)
        parts.append(Part("repeats", f"repeats of one run: {names}"))
    parts += [Part("the joints", table(joint_rows(told)))] if told else []
    parts.append(Part("the clocks", table(clock_rows(qualities))))
    print_out(console, answer, parts, quiet=options.quiet, verbose=options.verbose)
    wrong = {f.text: f for q in qualities for f in q.findings if f.severity == "error"}
    write_fix(options, list(wrong.values()), console)
    content = {
        "logs": {
            quality.label: {
                "rows": quality.rows,
                "duration": quality.duration,
                "rate": quality.rate,
                "jitter": quality.jitter,
                "longest_gap": quality.longest_gap,
                "findings": [
                    {
                        "severity": finding.severity,
                        "kind": finding.kind,
                        "column": finding.column,
                        "text": finding.text,
                        "way_out": finding.way_out,
                        "mend": finding.mend,
                        "probability": finding.probability,
                    }
                    for finding in quality.findings
                ],
            }
            for quality in qualities
        }
    }
    return int(not all(quality.usable for quality in qualities)), content


def _remarks(qualities: Sequence[LogQuality]) -> list[str]:
    """Return every remark once, with the logs and columns that it is about."""
    alike: dict[tuple[str, ...], list[tuple[str, LogFinding]]] = {}
    for quality in qualities:
        for finding in quality.findings:
            said = (finding.text, finding.way_out)
            blank = [_NUMBER.sub("#", text.replace(finding.column or "*", "*")) for text in said]
            key = (finding.severity, finding.kind, *blank)
            alike.setdefault(key, []).append((short_label(quality.label), finding))
    return [_joined(group, len(qualities)) for group in alike.values()]


def _joined(group: Sequence[tuple[str, LogFinding]], logs: int) -> str:
    """Return one remark of findings that differ in logs, columns and numbers alone."""
    where = list(dict.fromkeys(label for label, _ in group))
    first = group[0][1]
    columns = list(dict.fromkeys(finding.column for _, finding in group))
    ways = []
    for line in first.way_out.splitlines():
        own = columns if first.column and first.column in line else columns[:1]
        ways += [line.replace(first.column, column) if own is columns else line for column in own]
    text = _in_ranges([finding.text for _, finding in group])
    said = replace(first, column=", ".join(columns), text=text, way_out="\n".join(ways))
    if logs == 1:
        return str(said)
    return f"{f'all {logs} logs' if len(where) == logs else ', '.join(where)}: {said}"


def _in_ranges(texts: Sequence[str]) -> str:
    """Return a text whose numbers run from the least to the most of those in several."""
    parts = [_NUMBER.split(text) for text in texts]
    ranges = [
        sorted(dict.fromkeys(each), key=float)
        for each in zip(*(p[1::2] for p in parts), strict=True)
    ]
    numbers = [each[0] if len(each) == 1 else f"{each[0]} to {each[-1]}" for each in ranges]
    return "".join(sum(zip(parts[0][::2], [*numbers, ""], strict=True), ()))


def _answer(qualities: Sequence[LogQuality], remarks: int, quiet: bool) -> str:
    """Return in a sentence whether the logs can be used."""
    wrong = [short_label(quality.label) for quality in qualities if not quality.usable]
    if wrong:
        why = " Why: the same command without --quiet." if quiet else ""
        return f"do not use yet: {', '.join(wrong)} would give wrong results.{why}"
    if remarks and quiet:
        many = "one remark" if remarks == 1 else f"{remarks} remarks"
        return f"these logs can be used, with {many} (printed without --quiet)."
    if remarks:
        return "these logs can be used, with the remarks below."
    return "nothing to complain about"
