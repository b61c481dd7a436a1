"""What to do after a diagnosis: in words, and as whole commands that run as printed."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from wbc.identification.answer.diagnosis.diagnosis import Diagnosis

COMMAND = "    "
"""Begins every line of advice that is a command to copy."""
_USE = "Use the corrected model."
_RECORD = "Change neither the robot nor its model yet."
_DOUBTED = (
    "Use the corrected model: it predicts best. Change nothing on the robot by a doubtful name."
)
_SAVED = "fitted.toml"
_NEW_LOG = "new.csv"
_NEW_RUNS = ("new1.csv", "new2.csv")


@dataclass(frozen=True)
class Commands:
    """Command lines that go on from a diagnosis.

    Attributes:
        robot: the robot as it was given, a name or a file.
        saved: file of the corrected robot.
        save: repeats the diagnosis and writes `saved`; empty where it is written.
        use: shows what the corrected robot leaves on the same logs; empty where one command
            cannot.
        again: repeats the diagnosis with one more log, `new.csv`.
        anew: diagnoses new logs alone.
    """

    robot: str
    saved: str
    save: str
    use: str
    again: str
    anew: str

    @classmethod
    def of(
        cls,
        logs: Sequence[str],
        robot: str,
        *,
        saved: str | None = None,
        lossless: bool = False,
        columns: str | None = None,
        add: str = "auto",
    ) -> Commands:
        """Return the commands for what `wbc diagnose` was given.

        Args:
            logs: files, as the command line takes them.
            robot: name or file.
            saved: file in which the corrected robot is; None if in none.
            lossless: the robot was taken with perfect gears.
            columns: column map.
            add: effects to consider.
        """
        mapped = ["--columns", columns] if columns else []
        given = ["--robot", robot, *(["--lossless"] if lossless else []), *mapped]
        chosen = [] if add == "auto" else ["--add", add]
        target = saved or _SAVED
        # The losses of logs of other machines would come back beside a robot that has its own.
        alone = not (lossless and any("@" in log for log in logs))
        diagnose = ["wbc", "diagnose", *logs]
        return cls(
            robot=robot,
            saved=target,
            save="" if saved else shlex.join([*diagnose, *given, *chosen, "--save", target]),
            # Perfect gears would take the losses found out again: no --lossless here.
            use=shlex.join(["wbc", "compare", *logs, "--robot", target, *mapped]) if alone else "",
            again=shlex.join([*diagnose, _NEW_LOG, *given, *chosen]),
            anew=shlex.join(["wbc", "diagnose", *_NEW_RUNS, *given, *chosen]),
        )


def what_to_do(diagnosis: Diagnosis, commands: Commands | None = None) -> str:
    """Return what to do now; lines that begin with four spaces are commands to copy.

    Args:
        diagnosis: the answer.
        commands: how to go on from it on the command line; in Python when left out.
    """
    match diagnosis.verdict:
        case "named":
            return f"{_USE} {_use(commands)}"
        case "partial":
            more = f"To find the rest: {_lowered(diagnosis.next_experiment)}"
            return f"{_USE} {_use(commands)}\n{more}{_again(commands)}"
        case "none":
            return (
                "Neither the robot nor its model needs a change. Faster or loaded motions would "
                "show more."
            )
        case "not_repeatable":
            return f"Look at the robot first. {diagnosis.next_experiment}{_anew(commands)}"
        case _ if diagnosis.findings:
            more = f"To find out more: {_lowered(diagnosis.next_experiment)}"
            return f"{_DOUBTED} {_use(commands)}\n{more}{_again(commands)}"
        case _:
            return f"{_RECORD} {diagnosis.next_experiment}{_again(commands)}"


def _use(commands: Commands | None) -> str:
    if commands is None:
        save = f'from wbc import save_robot; save_robot(found.robot, "{_SAVED}")'
        return f"Save it (`found` is this diagnosis):\n{COMMAND}{save}"
    then = f"Then use {commands.saved} in place of {commands.robot}."
    shown = [f"{COMMAND}{line}" for line in (commands.save, commands.use) if line]
    if commands.save:
        look = " and see what it leaves" if commands.use else ""
        start = f"Save it{look}:"
    else:
        look = ". See what it leaves:" if commands.use else "."
        start = f"It is in {commands.saved}{look}"
    return "\n".join([start, *shown, then])


def _again(commands: Commands | None) -> str:
    """Return how to ask again with what was recorded."""
    if commands is None:
        return " Then diagnose all logs together."
    again = f"Then give all logs together (with the name of the new log for {_NEW_LOG}):"
    return f"\n{again}\n{COMMAND}{commands.again}"


def _anew(commands: Commands | None) -> str:
    """Return how to ask about runs that repeat one another, without those that do not."""
    if commands is None:
        return " Then diagnose the new runs alone."
    alone = f"Then diagnose the new runs alone (with their names for {' and '.join(_NEW_RUNS)}):"
    return f"\n{alone}\n{COMMAND}{commands.anew}"


def _lowered(text: str) -> str:
    return text[:1].lower() + text[1:]
