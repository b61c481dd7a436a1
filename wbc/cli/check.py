"""`wbc check`: what a log is good for, before anything is computed from it."""

from __future__ import annotations

import argparse
from typing import Any

from rich.console import Console

from wbc.cli.inputs import add_log_options, logs_from, robot_from, table_console, write_json
from wbc.cli.outputs import require_outputs
from wbc.measurement import check_logs


def add_to(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "check",
        help="rate, jitter, gaps, saturation, wraps, stuck sensors of logs",
        epilog="example: wbc check run*.csv --robot planar_leg_fixed",
    )
    add_log_options(parser)
    parser.add_argument("--json", metavar="FILE", help="the same for machines ('-' prints it)")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace, console: Console) -> int:
    """Print the quality of every log; exit code 1 if one of them would give wrong results."""
    require_outputs(options)
    robot = robot_from(options)
    qualities = check_logs(logs_from(options, robot), robot)
    shown = table_console(options, console)
    for quality in qualities:
        shown.print(str(quality), soft_wrap=True)
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
                    }
                    for finding in quality.findings
                ],
            }
            for quality in qualities
        },
        console,
    )
    return 0 if all(quality.usable for quality in qualities) else 1
