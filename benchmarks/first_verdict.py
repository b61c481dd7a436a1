"""From files as published to a verdict in five commands: what a new user sees and waits for.

Four recorded robots. Of two of them there is a model and files with the columns of others; the
other two have a description. Every command is printed with its exit code, its time and the sentence
of its answer.

    python -m benchmarks.first_verdict ../shared/data --only kuka
"""

from __future__ import annotations

import argparse
import re
import shlex
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from resource import RLIMIT_CPU, RUSAGE_CHILDREN, getrusage, setrlimit
from tempfile import TemporaryDirectory
from time import perf_counter

from rich.console import Console

from benchmarks.recorded import finish

LIMIT = 300
"""Seconds of processor time that a command may take: other work does not count."""
_KUKA, _SO101 = "kuka_lwr4", "so101_sage"
_MOTIONS = ("chirp_sweep", "friction_gravity", "large_amplitude", "multisine")


@dataclass(frozen=True)
class Case:
    """A recorded robot.

    Attributes:
        logs: files of the outside data.
        model: URDF; empty where the robot is described.
        robot: its description, where there is one.
        columns: its column map, where there is one.
        known: gains that init guesses, and those that the maker states: init asks to replace them.
    """

    logs: tuple[str, ...]
    model: str = ""
    robot: str = ""
    columns: str = ""
    known: tuple[tuple[str, str], ...] = ()


CASES = {
    "kuka": Case((f"{_KUKA}/lwr1.npz", f"{_KUKA}/lwr3.npz"), f"{_KUKA}/kuka_lwr4.urdf"),
    "so101": Case(
        tuple(
            f"{_SO101}/{motion}.state_motor.csv.gz+{_SO101}/{motion}.control.csv.gz"
            for motion in _MOTIONS
        ),
        f"{_SO101}/so101.urdf",
        known=(("20.0", "17.8"), ("0.5", "0.0")),
    ),
    "airbot": Case(
        tuple(f"airbot_play/{run}.parquet" for run in ("chirp", "trapezoidal")),
        robot="airbot_play/robot.toml",
    ),
    "tmotor": Case(
        tuple(f"tmotor_ak80/{run}.parquet" for run in ("sysid_1", "sysid_2", "opposing_2")),
        robot="tmotor_ak80/robot.toml",
        columns="tmotor_ak80/current.toml",
    ),
}


def commands(case: Case, data: Path) -> list[list[str]]:
    """Return the five commands of a case; files are written where they run."""
    logs = ["+".join(str(data / part) for part in log.split("+")) for log in case.logs]
    robot, columns = ("robot.toml", "columns.toml")
    if case.robot:
        robot = str(data / case.robot)
        columns = str(data / case.columns) if case.columns else ""
    read = [*logs, "--robot", robot, *(["--columns", columns] if columns else [])]
    save = ["--save", "fitted.toml"]
    fitted = ["fitted.toml" if word == robot else word for word in read]
    if case.model:
        start = [["look", *logs], ["init", str(data / case.model), *logs]]
        return [*start, ["check", *read], ["compare", *read], ["diagnose", *read, *save]]
    after = [["compare", *read], ["diagnose", *read, *save], ["compare", *fitted]]
    return [["look", *logs], ["check", *read], *after]


def told(name: str, case: Case, data: Path, console: Console) -> list[dict[str, object]]:
    """Run the commands of a case, print and return what each says."""
    steps = []
    walls = []
    with TemporaryDirectory() as folder:
        for words in commands(case, data):
            quiet = [] if words[0] in ("look", "init") else ["--quiet"]
            start, used = perf_counter(), getrusage(RUSAGE_CHILDREN).ru_utime
            code, said = _run([*words, *quiet], folder)
            walls.append(wall := perf_counter() - start)
            cpu = getrusage(RUSAGE_CHILDREN).ru_utime - used
            shown = shlex.join(["wbc", *(w.replace(f"{data}/", "") for w in words)])
            console.print(f"[bold]{name}[/]: {shown}", soft_wrap=True)
            console.print(f"  exit code {code}, {wall:.1f} s ({cpu:.1f} s of CPU): {said}\n")
            steps.append({"command": shown, "code": code, "wall": wall, "cpu": cpu, "said": said})
            if words[0] == "init" and case.known:
                path = Path(folder) / "robot.toml"
                text = path.read_text(encoding="utf-8")
                for guess, number in case.known:
                    pattern = rf'= {guess}, (unit = "[^"]+", source = )"guess[^"]*"'
                    text = re.sub(pattern, rf'= {number}, \1"its maker"', text)
                path.write_text(text, encoding="utf-8")
    console.print(f"{name}: {len(walls)} commands, the longest of {max(walls):.0f} s\n")
    return steps


def _run(words: Sequence[str], folder: str) -> tuple[int, str]:
    """Return the exit code of a command, and what it says first."""
    run = "from wbc.cli import main; import sys; sys.exit(main(sys.argv[1:]))"
    done = subprocess.run(
        [sys.executable, "-c", run, *words],
        cwd=folder,
        preexec_fn=lambda: setrlimit(RLIMIT_CPU, (LIMIT, LIMIT)),
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode < 0:
        return done.returncode, f"ended after {LIMIT} s of processor time"
    return done.returncode, " ".join((done.stdout + done.stderr).split())[:600]


def main() -> None:
    """Run the cases that the command line names."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("--only", nargs="+", choices=CASES, default=list(CASES))
    parser.add_argument("--json", metavar="FILE")
    options = parser.parse_args()
    console = Console()
    data = options.data.resolve()
    results = {name: told(name, CASES[name], data, console) for name in options.only}
    finish(console, results, options.json)


if __name__ == "__main__":
    main()
