"""From files as published to a verdict in four commands: what a new user sees and waits for.

Four recorded robots. Of two of them there is a model and files with the columns of others; the
other two have a description. Every command is printed with its exit code, its time and the sentence
of its answer; none may take more than five minutes of processor time.

    python -m benchmarks.first_verdict ../shared/data --only kuka
"""

from __future__ import annotations

import argparse
import re
import shlex
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from resource import RLIMIT_CPU, RUSAGE_CHILDREN, getrusage, setrlimit
from tempfile import TemporaryDirectory
from time import perf_counter

from rich.console import Console

from benchmarks.recorded import finish

LIMIT = 300
"""Seconds of processor time that a command may take: other work does not count."""
_MOTIONS = ("chirp_sweep", "friction_gravity", "large_amplitude", "multisine")
CASES = {
    "kuka": ("kuka_lwr4/kuka_lwr4.urdf", "", ("kuka_lwr4/lwr1.npz", "kuka_lwr4/lwr3.npz")),
    "so101": (
        "so101_sage/so101.urdf",
        "",
        tuple(
            "+".join(f"so101_sage/{m}.{k}.csv.gz" for k in ("state_motor", "control"))
            for m in _MOTIONS
        ),
    ),
    "airbot": (
        "airbot_play/robot.toml",
        "",
        tuple(f"airbot_play/{run}.parquet" for run in ("chirp", "trapezoidal")),
    ),
    "tmotor": (
        "tmotor_ak80/robot.toml",
        "tmotor_ak80/current.toml",
        tuple(f"tmotor_ak80/{run}.parquet" for run in ("sysid_1", "sysid_2", "opposing_2")),
    ),
}
"""Robot -> (model or description, column map, logs)."""
GAINS = (("20.0", "17.8"), ("0.5", "0.0"))
"""Gains that init guesses for the SO-101, and those that its maker states: init asks for them."""


def commands(name: str, data: Path) -> list[list[str]]:
    """Return the four commands of a robot; files are written where they run."""
    model, columns, paths = CASES[name]
    logs = ["+".join(str(data / part) for part in path.split("+")) for path in paths]
    described = model.endswith(".toml")
    robot = str(data / model) if described else "robot.toml"
    columns = str(data / columns) if columns else "" if described else "columns.toml"
    read = [*logs, "--robot", robot, *(["--columns", columns] if columns else [])]
    first = [] if described else [["init", str(data / model), *logs]]
    last = [["compare", *("fitted.toml" if word == robot else word for word in read)]]
    middle = [["check", *read], ["compare", *read], ["diagnose", *read, "--save", "fitted.toml"]]
    return [*first, *middle, *(last if described else [])]


def run(words: Sequence[str], folder: str) -> dict[str, object]:
    """Return exit code, times [s] and first sentence of a command."""
    start, used = perf_counter(), getrusage(RUSAGE_CHILDREN).ru_utime
    brief = [] if words[0] == "init" else ["--quiet"]
    done = subprocess.run(
        [sys.executable, "-m", "wbc", *words, *brief],
        cwd=folder,
        preexec_fn=lambda: setrlimit(RLIMIT_CPU, (LIMIT, LIMIT)),
        capture_output=True,
        text=True,
        check=False,
    )
    said = " ".join((done.stdout + done.stderr).split())[:600]
    cpu = getrusage(RUSAGE_CHILDREN).ru_utime - used
    return {"code": done.returncode, "wall": perf_counter() - start, "cpu": cpu, "said": said}


def main() -> None:
    """Run the cases that the command line names."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("--only", nargs="+", choices=CASES, default=list(CASES))
    parser.add_argument("--json", metavar="FILE")
    options = parser.parse_args()
    console, data, results = Console(), options.data.resolve(), {}
    for name in options.only:
        with TemporaryDirectory() as folder:
            for words in commands(name, data):
                step = run(words, folder)
                shown = shlex.join(["wbc", *(word.replace(f"{data}/", "") for word in words)])
                console.print(f"[bold]{name}[/]: {shown}", soft_wrap=True)
                console.print(
                    "  exit code {code}, {wall:.1f} s ({cpu:.1f} s of CPU): {said}\n".format(**step)
                )
                results.setdefault(name, []).append({"command": shown, **step})
                if (name, words[0]) == ("so101", "init"):
                    path = Path(folder) / "robot.toml"
                    text = path.read_text(encoding="utf-8")
                    for guess, number in GAINS:
                        pattern = rf'= {guess}, (unit = "[^"]+", source = )"guess[^"]*"'
                        text = re.sub(pattern, rf'= {number}, \1"its maker"', text)
                    path.write_text(text, encoding="utf-8")
    finish(console, results, options.json)


if __name__ == "__main__":
    main()
