"""Every Python block of the README and the docs runs, one page after another in one namespace.

Blocks of shell hold our own commands and run, too. So do the indented commands of the pages that a
newcomer follows; those of the other pages are read as the command line reads them.

A block of text right below a block of Python is what the page says is printed. Words must be the
same, numbers within a tenth: libraries and processors round differently, and a page is no
regression test, but it must not promise what does not happen. A line `...` stands for lines
that the page leaves out.
"""

import code
import contextlib
import io
import re
import runpy
import shlex
import shutil
from pathlib import Path
from textwrap import dedent
from types import SimpleNamespace

import pytest

from wbc import load_robot
from wbc.cli import main
from wbc.cli.options import build_parser
from wbc.effects import CoulombFriction
from wbc.identification.readings import kinds as readings
from wbc.measurement import save_log
from wbc.sim.excitation import record_with

ROOT = Path(__file__).resolve().parents[2]
# These run line by line, as at the prompt.
PASTED = ("README.md", "docs/guide/tutorial.md", "docs/guide/tutorial-logs.md")
PAGES = [
    path
    for path in sorted((ROOT / "docs").rglob("*.md"))
    if "_build" not in path.parts and str(path.relative_to(ROOT)) not in PASTED
]
BLOCK = re.compile(
    r"^```(python|sh)\n(.*?)^```$(?:\n+^```text\n(.*?)^```$)?", re.MULTILINE | re.DOTALL
)
# Lines of an indented block that begin with our command; a backslash goes on in the next line.
COMMAND = re.compile(r"^ {4}(wbc (?:.*\\\n)*.*)$", re.MULTILINE)
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def assert_same_text(printed: str, promised: str) -> None:
    """Check that words are equal and numbers within a tenth (or 0.02 near zero)."""
    assert NUMBER.sub("#", printed).split() == NUMBER.sub("#", promised).split(), printed
    found = [float(x) for x in NUMBER.findall(printed)]
    expected = [float(x) for x in NUMBER.findall(promised)]
    assert found == pytest.approx(expected, rel=0.1, abs=0.02), printed


def assert_printed(printed: str, promised: str) -> None:
    """Check a text with lines left out: its pieces stand in what is printed, in this order."""
    pieces = re.split(r"^\.\.\.\n", promised, flags=re.MULTILINE)
    rows, at = printed.splitlines(), 0
    for number, piece in enumerate(pieces):
        first, count = NUMBER.sub("#", piece.split("\n", 1)[0]).split(), piece.count("\n")
        if number == len(pieces) - 1 and piece:
            assert_same_text("\n".join(rows[max(at, len(rows) - count) :]), piece)
        elif piece:
            starts = [at] if number == 0 else range(at, len(rows))
            found = [k for k in starts if NUMBER.sub("#", rows[k]).split() == first]
            assert found, f"{piece.splitlines()[0]!r} is not in:\n{printed}"
            at = found[0] + count
            assert_same_text("\n".join(rows[found[0] : at]), piece)


@pytest.mark.parametrize(
    ("promised", "holds"),
    [*((text, True) for text in ("a 1\n...\nc 3\n", "...\nb 2\n...\n", "a 1\nb 2\nc 3\n")),
     *((text, False) for text in ("a 1\n...\nc 9\n", "...\nb 9\n...\n", "c 3\n...\na 1\n...\n"))],
)  # fmt: skip
def test_pieces_of_a_text_stand_in_it_in_their_order(promised: str, holds: bool) -> None:
    with contextlib.nullcontext() if holds else pytest.raises(AssertionError):
        assert_printed("a 1\nb 2\nc 3\n", promised)


def run_commands(block: str) -> None:
    """Run `wbc ...` and `python -m sims...`, one per line, as a shell does in this folder."""
    for line in block.splitlines():
        words = []
        for word in shlex.split(line):
            words += sorted(map(str, Path().glob(word))) if "*" in word else [word]
        if words[:2] == ["python", "-m"]:
            runpy.run_module(words[2], run_name="__main__")
        else:
            assert words[0] == "wbc", line
            assert main(words[1:]) == 0, line


def commands_of(page: str) -> list[str]:
    """Return the indented commands of a page, without their comments and redirections."""
    found = COMMAND.findall((ROOT / page).read_text(encoding="utf-8"))
    return [re.split(r"\s+[#>]", line.replace("\\\n", " "))[0] for line in found]


@pytest.mark.parametrize(
    "page", [p for p in (*PASTED, *(str(q.relative_to(ROOT)) for q in PAGES)) if commands_of(p)]
)
def test_commands_of_a_page_are_commands_with_options_that_exist(page: str) -> None:
    parser = build_parser()
    for line in commands_of(page):
        parser.parse_args(shlex.split(line)[1:])  # exits where it does not know an option


@pytest.mark.usefixtures("here")
def test_the_commands_of_the_readme_lead_from_files_to_an_answer(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A leg with column names of its own; its owner has not looked up the rotors yet."""
    shutil.copy(ROOT / "robots" / "planar_leg" / "planar_leg.urdf", "my_robot.urdf")
    leg = load_robot("planar_leg_fixed").lossless()
    names = {".position": "_angle", ".velocity": "_speed", ".rotor_torque": "_torque"}
    for k, log in enumerate(record_with(leg, [CoulombFriction("hip", 0.5)], duration=3.0)):
        torques = {c: 20.0 * log.column(c) for c in log.names if c.endswith("rotor_torque")}
        text = save_log(log.with_columns(torques), f"run{k}.csv").read_text()
        for ours, theirs in names.items():
            text = text.replace(ours, theirs)
        Path(f"run{k}.csv").write_text(text)
    after_demo, init, check, diagnose, play = commands_of("README.md")
    assert "out/run*.csv" in after_demo  # what `make demo` leaves; the test of the demo names it
    run_commands(init)
    robot = Path("robot.toml").read_text()
    assert robot.count("guess: not in the model file") == 4
    ratio = 'gear_ratio = { value = 20.0, unit = "1", source = "data sheet" }'
    robot = re.sub(r"gear_ratio = .*", ratio, robot)
    Path("robot.toml").write_text(robot.replace("{ value = 0.0,", "{ value = 6.66667e-5,"))
    run_commands(check)
    assert "these logs can be used" in capsys.readouterr().out
    run_commands(diagnose)
    answer = " ".join(capsys.readouterr().out.split())
    assert "Coulomb friction of 0.5 N m at hip" in answer
    asked = "Look up gears.hip.rotor_inertia, gears.knee.rotor_inertia in robot.toml"
    assert answer.count(asked) == 1
    run_commands(play)
    assert load_robot("fitted.toml").effects[0].key == ("coulomb_friction", "hip")
    for page in ("report.html", "run1.html"):
        assert Path(page).stat().st_size > 100_000


def reduced(line: str) -> str:
    """Return a command with one round, two values of a sweep, and no open loop beside an error."""
    line = re.sub(r"--rounds \d+", "--rounds 1", line)
    line = f"{line} --quiet" if line.startswith("wbc compare") else line
    return re.sub(r"(=[^ :]+:[^ :]+):\d+", r"\1:2", line)


@pytest.mark.usefixtures("here")
def test_the_commands_for_a_quadruped_and_an_arm_run_in_small(monkeypatch) -> None:
    for name, count in (("_RANDOM", 3), ("_DRAWN", 6)):  # motions that are drawn at random
        monkeypatch.setattr(f"wbc.design.experiment.search.{name}", count)
    commands = commands_of("docs/guide/gearbox-design.md")
    commands += [c for c in commands_of("docs/diagnosis/deciding-experiment.md") if "link_4" in c]
    for line in commands:
        run_commands(reduced(line))
    assert len(commands) == 7
    assert len(list(Path("out").glob("*.png"))) >= 5


def test_the_reading_that_the_page_shows_runs_in_its_module() -> None:
    page = (ROOT / "docs/guide/extend.md").read_text(encoding="utf-8")
    block = page[page.index("    def _kilograms") : page.index("Name it in the function")]
    namespace = dict(vars(readings))
    exec(compile(dedent(block), "extend.md", "exec"), namespace)
    rows = SimpleNamespace(torques=["hip.motor_torque", "knee.motor_torque"])
    both, hip, knee = namespace["_kilograms"](rows)
    assert both.text == "hip.motor_torque and knee.motor_torque hold kgf cm"
    assert set(both.mend["columns"]) == {*hip.mend["columns"], *knee.mend["columns"]}


@pytest.mark.parametrize("page", PAGES, ids=[str(p.relative_to(ROOT)) for p in PAGES])
@pytest.mark.usefixtures("here")
def test_blocks_of_a_page_run_and_print_what_it_shows(page, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    namespace: dict[str, object] = {"__name__": "page"}
    for language, block, promised in BLOCK.findall(page.read_text(encoding="utf-8")):
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            if language == "sh":
                run_commands(block)
            else:
                exec(compile(block, str(page), "exec", dont_inherit=True), namespace)
        if promised:
            assert_printed(printed.getvalue(), promised)


@pytest.mark.parametrize("page", PASTED)
@pytest.mark.usefixtures("here")
def test_blocks_pasted_into_the_prompt_print_what_the_page_shows(page, monkeypatch):
    """The prompt ends a block at an empty line and echoes every value that is not assigned."""
    monkeypatch.setattr("sys.ps1", ">>> ", raising=False)
    prompt = code.InteractiveConsole({"__name__": "__console__"})
    for _, block, promised in BLOCK.findall((ROOT / page).read_text(encoding="utf-8")):
        printed, complaints = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(complaints):
            more = [prompt.push(line) for line in [*block.splitlines(), ""]][-1]
        assert not more, f"the block is not finished by an empty line:\n{block}"
        assert "Error" not in complaints.getvalue(), complaints.getvalue()
        assert_same_text(printed.getvalue(), promised)
    if page == "docs/guide/tutorial-logs.md":
        for line in commands_of(page):
            run_commands(reduced(line))
