"""`wbc check`: what a log is good for, before anything is computed from it."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from wbc.cli.shared.inputs import (
    add_log_options,
    read_logs,
    robot_from,
    table_console,
    write_fix,
    write_json,
)
from wbc.cli.shared.outputs import require_outputs
from wbc.cli.shared.printout import Part, Spoken, print_out
from wbc.measurement import LogQuality, check_logs, find_repeats
from wbc.measurement import read_logs as read_suspicious
from wbc.measurement.guessing.robot_guess import guessed_numbers


def add_to(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "check",
        help="what logs are good for, and which columns are wrong",
        epilog="example: wbc check run*.csv --robot planar_leg_fixed --fix map.toml",
    )
    add_log_options(parser)
    parser.add_argument("--json", metavar="FILE", help="the result for programs ('-' prints it)")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace, console: Console) -> int:
    """Print the quality of every log; exit code 1 if one of them would give wrong results."""
    require_outputs(options)
    robot = robot_from(options)
    logs = read_logs(options.logs, options.columns, robot, read_suspicious)
    qualities = check_logs(logs, robot)
    shown = table_console(options, console)
    said = _remarks(qualities)
    guessed = guessed_numbers(options.robot)
    if guessed:
        said.append(
            f"still guesses of `wbc init` in {options.robot}, every answer rests on them: "
            + ", ".join(guessed)
        )
    answer = [_answer(qualities, len(said), options.quiet)]
    parts = [Part("remarks", Spoken(text, 2)) for text in said]
    for group in find_repeats(logs):
        names = ", ".join(_short(qualities[k]) for k in group)
        parts.append(Part("repeats", f"repeats of one run: {names}"))
    parts.append(Part("the clocks", _clock_table(qualities)))
    print_out(shown, answer, parts, quiet=options.quiet, verbose=options.verbose)
    wrong = {f.text: f for q in qualities for f in q.findings if f.severity == "error"}
    write_fix(options, list(wrong.values()), shown)
    write_json(
        options.json,
        {
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
        },
        console,
    )
    return 0 if all(quality.usable for quality in qualities) else 1


def _remarks(qualities: Sequence[LogQuality]) -> list[str]:
    """Return every remark once, with the logs that it is about."""
    about: dict[str, list[str]] = {}
    for quality in qualities:
        for finding in quality.findings:
            about.setdefault(str(finding), []).append(_short(quality))
    if len(qualities) == 1:
        return list(about)
    everywhere = f"all {len(qualities)} logs"
    return [
        f"{everywhere if len(logs) == len(qualities) else ', '.join(logs)}: {text}"
        for text, logs in about.items()
    ]


def _answer(qualities: Sequence[LogQuality], remarks: int, quiet: bool) -> str:
    """Return in a sentence whether the logs can be used."""
    wrong = [_short(quality) for quality in qualities if not quality.usable]
    if wrong:
        why = " Why: the same command without --quiet." if quiet else ""
        return f"do not use yet: {', '.join(wrong)} would give wrong results.{why}"
    if remarks and quiet:
        many = "one remark" if remarks == 1 else f"{remarks} remarks"
        return f"these logs can be used, with {many} (printed without --quiet)."
    if remarks:
        return "these logs can be used, with the remarks below."
    return "nothing to complain about"


def _short(quality: LogQuality) -> str:
    """Return the name of a log without its folders."""
    path, mark, part = quality.label.partition("#")
    return Path(path).name + mark + part


def _clock_table(qualities: Sequence[LogQuality]) -> Table:
    """Return length and clock of every log."""
    table = Table("log", "rows", "[s]", "[Hz]", "jitter", "longest gap", box=None)
    table.columns[0].overflow = "fold"
    for column in table.columns[1:]:
        column.justify = "right"
    for q in qualities:
        table.add_row(
            _short(q),
            str(q.rows),
            f"{q.duration:.3f}",
            f"{q.rate:.1f}",
            f"{100.0 * q.jitter:.1f} %",
            f"{1e3 * q.longest_gap:.1f} ms",
        )
    return table
