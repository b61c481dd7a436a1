"""Every command of `wbc` and every option, as tables that need nothing of the library."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from math import inf
from typing import Any

_RAW = argparse.RawDescriptionHelpFormatter
_LOG = "CSV, Parquet, NPZ, MCAP or bag"
_ROBOT = "shipped robot, robot.toml or fitted.toml"
BUDGET = 240.0
"""Time [s] of a diagnosis with all that is printed of it, unless --budget says another. To print
and simulate the answer takes 40 s of it for a recorded six-axis arm (AIRBOT)."""


def _option(metavar: str | None, text: str, **more: Any) -> dict[str, Any]:
    return {"metavar": metavar, "help": text, **more}


def _several(metavar: str, text: str) -> dict[str, Any]:
    """Return an option that may be given more than once."""
    return _option(metavar, text, action="append", default=[])


def _number(metavar: str | None, text: str, default: float | None = None) -> dict[str, Any]:
    """Return an option that takes a number, a whole one where the default is."""
    kind = int if isinstance(default, int) else float
    return _option(metavar, text, type=kind, default=default)


def _flag(text: str) -> dict[str, Any]:
    return {"action": "store_true", "help": text}


def _choice(text: str, *names: str, **more: Any) -> dict[str, Any]:
    """Return an option of a few names, the first of them where it is left out."""
    return {"choices": names, "default": names[0], "help": text, **more}


OPTIONS: dict[str, dict[str, Any]] = {
    # The name of an argument, then a slash and a word where commands mean different things by it.
    "logs": _option(
        "LOG", f"{_LOG}; LOG@ROBOT for other drives or loads, LOG@MAP.toml for a map", nargs="+"
    ),
    "logs/plain": _option("LOG", _LOG, nargs="+"),
    "logs/any": _option("LOG", _LOG, nargs="*"),
    "run_file": _option("RUN", "a recording or log"),
    "robot": _option("ROBOT", _ROBOT),
    "robot/model": _option("MODEL", "URDF, MJCF, robot.toml or shipped robot"),
    "what": {"choices": ("robots", "effects", "gearboxes")},
    "--robot": _option("NAME", _ROBOT, required=True),
    "--lossless": _flag("take the robot with perfect gears"),
    "--columns": _option("MAP.toml", "map of column names, units, sides of the gear"),
    "--quiet": _flag("print the answer alone"),
    "--verbose": _flag("print all of the detail"),
    "--fix": _option("MAP.toml", "write a column map that corrects wrong columns"),
    "--json": _option("FILE", "the result for programs ('-' prints it)"),
    "--report": _option("FILE.html", "the result as a page for the browser"),
    "--save": _option("FILE.toml", "write the robot with what was found"),
    # compare, diagnose
    "--add": _option("auto|NAME,...", "effects to consider (default auto: all)", default="auto"),
    "--budget": _number(
        "SECONDS",
        f"answer within this time with the best so far (default {BUDGET:.0f}; inf for no limit; "
        "Ctrl-C answers at once)",
        BUDGET,
    ),
    "--discover": _flag("propose formulas for what no effect explains (--save writes them, too)"),
    "--fail-on-drift": _flag("exit code 4 if a machine drifts"),
    # many jobs
    "--workers": _number("N", "processes; -1 for all cores", 1),
    "--out/designs": _option("FILE.parquet", "table of all designs", default="designs.parquet"),
    "--out/path": _option("FILE.csv", "set points", default="trajectory.csv"),
    "--out/folder": _option("DIR", "where to write (default here)", dest="folder", default="."),
    # init
    "--base": _choice("how the base of a model file is held", "fixed", "free_flyer"),
    "--rate/log": _number("HZ", "rows per second of logs without a clock"),
    # pictures
    "--ghost": _option("FITTED", "a model to show beside the measurement"),
    "--html": _option("FILE.html", "write the page"),
    "--figures": _option("DIR", "write figures (PNG)", nargs="?", const="out"),
    "--theme": _choice("colours of pictures (default light)", "light", "dark"),
    # a contact of a robot
    "--contact": _option("NAME", "or a frame; default: the first contact"),
    "--pose": _option("NAME|J=V,...", "a named pose or joint positions [rad, m]"),
    "--axes": _option(None, "world axes (default xz)", default="xz"),
    "--load": _number("N", "force to hold [N]; default: the robot's weight"),
    "--to/format": _choice("format of the file", "mujoco", "mjcf", required=True),
    "--file": _option("FILE", "to write; default: the robot's name"),
    # design
    "--sweep": _several(
        "NAME=LOW:HIGH[:COUNT[:log]]", "what varies, or NAME=V,V,...; give it once per parameter"
    ),
    "--gearbox": _option("NAME,...|all", "gearboxes of the catalogue (`wbc list gearboxes`)"),
    "--seed": _number(None, "of the search (default 0)", 0),
    "--objective": _several(
        "COLUMN:max|min",
        "goals of the front; default lift:max (holding_torque:min without torque limits)"
        " and impact_mitigation:max (backward_inertia:min on a fixed base)",
    ),
    # experiment
    "--between": _option("CAUSE", "causes, or found.json of a diagnosis", nargs="+", required=True),
    "--duration": _number("S", "[s], default 10", 10.0),
    "--rate": _number("HZ", "rows per second, default 100", 100.0),
    "--noise": _number("NM", "of the measured rotor torque [N m]; default: 1 %% of its limit"),
    "--band": _number("HZ", "of torques that the diagnosis will keep"),
    "--span": _number("RAD", "furthest from the usual pose", inf),
    "--speed": _number("X", "limit of joint speeds [rad/s]", inf),
    "--acceleration": _number("X", "limit [rad/s^2]", inf),
    "--rounds": _number("N", "changes tried (default 2400)", 2400),
}
"""What argparse is told of each argument, by its name."""


@dataclass(frozen=True)
class Subcommand:
    """What a command is for and which options it has.

    Attributes:
        help: one line in the list of commands.
        options: names in `OPTIONS`, in the order of the help.
        epilog: printed below the help.
    """

    help: str
    options: str
    epilog: str


_LOGS = "logs --robot --lossless --columns --quiet --verbose --fix"
_SITE = "--contact --pose --axes --load"

COMMANDS: dict[str, Subcommand] = {
    "init": Subcommand(
        "a first robot.toml for a model, and a column map for logs",
        "robot/model logs/any --base --rate/log --columns --out/folder",
        """example: wbc init my_leg.urdf run1.csv run2.csv --out leg

Writes robot.toml (for a model file) and columns.toml. What is guessed is marked
as a guess, with the reason: correct it, then run wbc check.""",
    ),
    "check": Subcommand(
        "what logs are good for, and which columns are wrong",
        f"{_LOGS} --json",
        "example: wbc check run*.csv --robot planar_leg_fixed --fix map.toml",
    ),
    "compare": Subcommand(
        "error of the model on logs: how much, and where",
        f"{_LOGS} --json --report",
        "example: wbc compare run*.csv --robot planar_leg_fixed --lossless",
    ),
    "diagnose": Subcommand(
        "which physical effect the model lacks; add it, save it",
        f"{_LOGS} --add --save --budget --discover --json --report",
        "example: wbc diagnose run*.csv --robot planar_leg_fixed --save fitted.toml",
    ),
    "identify": Subcommand(
        "all parameters at once: links, rotors, friction",
        f"{_LOGS} --json",
        """example: wbc identify run*.csv --robot planar_leg_fixed --json parameters.json

It says how large each number is; wbc diagnose says which are needed.""",
    ),
    "rollout": Subcommand(
        "a position servo fitted by simulating its runs",
        "logs --robot --lossless --columns --save --json",
        "example: wbc rollout light.csv heavy.csv@heavy.toml --robot servo.toml",
    ),
    "trend": Subcommand(
        "which machine changes over days, and how surely",
        "logs/plain --robot --lossless --columns --quiet --verbose --workers --fail-on-drift"
        " --figures --theme --json",
        "example: wbc trend fleet/*/*.csv --robot fitted.toml --figures",
    ),
    "play": Subcommand(
        "a recording in motion: one offline page",
        "run_file --robot --columns --ghost --html",
        """example: wbc play run.csv --robot planar_leg --ghost fitted.toml --html a.html

Without --html the page opens in the browser.""",
    ),
    "metrics": Subcommand(
        "inertia, force capability, impacts and holding of a contact",
        f"robot {_SITE} --figures --theme --json",
        "example: wbc metrics planar_leg --pose hip=-0.5236,knee=1.0472 --figures out",
    ),
    "design": Subcommand(
        "sweep gears and pose: maps and the best compromises",
        f"robot --sweep --gearbox {_SITE} --objective --out/designs --figures --theme --json",
        """parameters: reduction, forward_efficiency, backward_efficiency, rotor_inertia,
rotor_friction, torque_limit, joint.JOINT;
a gear parameter takes .JOINT for one gear alone.

example: wbc design planar_leg --sweep reduction=6:160:40:log
  --sweep forward_efficiency=0.5:0.98:40 --figures out""",
    ),
    "experiment": Subcommand(
        "a motion that tells rival causes apart, and its expected odds",
        "robot --lossless --between --duration --rate --noise --band --span --speed --acceleration"
        " --rounds --seed --out/path --figures --theme --json",
        """A cause is EFFECT@PLACE or EFFECT@PLACE:PARAMETER=VALUE,...; `wbc list effects`
names them, + joins several. found.json is what `wbc diagnose --json` wrote: the
causes are what it found and what it could not tell from that. One cause alone:
the motion that shrinks its intervals.

example: wbc experiment planar_leg_fixed --lossless --speed 6 --span 1
  --between rotor_inertia@knee payload_mass@shin --out trajectory.csv""",
    ),
    "export": Subcommand(
        "a robot for MuJoCo with its losses",
        "robot --to/format --file --json",
        "example: wbc export fitted.toml --to mujoco --file fitted.xml",
    ),
    "list": Subcommand(
        "the robots, the physical effects and the gearboxes there are",
        "what --json",
        "example: wbc list effects",
    ),
}
"""The commands by name, in the order of the help."""

MODULES = {
    "logs": ("init", "check", "play"),
    "models": ("compare", "diagnose", "identify", "rollout", "trend"),
    "robots": ("metrics", "export", "list"),
    "design": ("design", "experiment"),
}
"""Module of `wbc.cli` -> its commands, each a function run_COMMAND."""

_EPILOG = """\
example: wbc diagnose run*.csv --robot planar_leg_fixed --save fitted.toml
exit codes: 0 done, 1 unknown, not repeatable or unusable, 2 bad input,
4 drifts (--fail-on-drift), 130 interrupted"""


class _Version(argparse.Action):
    """Prints the version; it is looked up only when asked for."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from importlib.metadata import version

        print(f"wbc {version('wbc')}")
        parser.exit()


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of the whole command line."""
    parser = argparse.ArgumentParser(
        prog="wbc",
        description="Compare a robot model with logs, learn which physics is missing, see it.",
        epilog=_EPILOG,
        formatter_class=_RAW,
        add_help=False,
    )
    parser.add_argument("-h", "--help", action="help", help=argparse.SUPPRESS)  # who reads it knows
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version and exit")
    commands = parser.add_subparsers(
        dest="command", required=True, metavar="COMMAND", help="its options: wbc COMMAND --help"
    )
    for name, command in COMMANDS.items():
        own = commands.add_parser(
            name, help=command.help, epilog=command.epilog, formatter_class=_RAW
        )
        own.set_defaults(parser=own)
        depth = own.add_mutually_exclusive_group() if "--quiet" in command.options else own
        for key in command.options.split():
            to = depth if key in ("--quiet", "--verbose") else own
            to.add_argument(key.partition("/")[0], **OPTIONS[key])
    return parser
