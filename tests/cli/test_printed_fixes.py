"""Ways out that a message prints with an option, a command or a line of TOML are walked."""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from wbc.cli import main
from wbc.design.experiment import Rivals, parse_cause
from wbc.effects import CoulombFriction, load_robot
from wbc.errors import DesignError, LogError
from wbc.measurement import Log, load_log, save_log

ROOT = Path(__file__).resolve().parents[2]
LEG = "--robot planar_leg_fixed --lossless"
DIAGNOSE = f"{LEG} --add coulomb_friction --quiet"
PLAN = "experiment planar_leg_fixed --rounds 1 --duration 2 --speed 3 --span 0.5"
KNEE = "--between rotor_inertia@knee"
TWO = "--between coulomb_friction@hip viscous_friction@hip"
STUDY = "design planar_leg_fixed --sweep reduction=10:20:3"
# Words of the message as they stand in the sources; a command that ends with it; the command that
# the message asks for.
FIXES: list[tuple[str, str, str]] = [
    (
        "are for many machines: give --fleet too.",
        f"diagnose run.csv {DIAGNOSE} --out fleet.parquet",
        f"diagnose {DIAGNOSE} --fleet index.csv --out fleet.parquet",
    ),
    (
        "give logs or --fleet, not both.",
        f"diagnose run.csv {DIAGNOSE} --fleet index.csv --out fleet.parquet",
        f"diagnose {DIAGNOSE} --fleet index.csv --out fleet.parquet",
    ),
    (
        "Diagnose that machine without --fleet.",
        f"diagnose {DIAGNOSE} --fleet index.csv --out fleet.parquet --save a.toml",
        f"diagnose run.csv {DIAGNOSE} --save a.toml",
    ),
    ("--rounds must be at least 1.", f"{PLAN} {KNEE} --rounds 0", f"{PLAN} {KNEE} --rounds 1"),
    (
        "--{} '{}': the name must end in {}.",
        f"{PLAN} {KNEE} --out path.txt",
        f"{PLAN} {KNEE} --out path.csv",
    ),
    ("must be > 0 and finite; give --noise.", f"{PLAN} {KNEE} --noise 0", f"{PLAN} {KNEE}"),
    ("must be > 0; give --band.", f"{PLAN} {KNEE} --band 0", f"{PLAN} {KNEE} --band 20"),
    (
        "use EFFECT@PLACE or EFFECT@PLACE:PARAMETER=VALUE.",
        f"{PLAN} --between coulomb_friction",
        f"{PLAN} --between coulomb_friction@hip:level=0.5",
    ),
    (
        "is not PARAMETER=VALUE.",
        f"{PLAN} --between coulomb_friction@hip:level",
        f"{PLAN} --between coulomb_friction@hip:level=0.5",
    ),
    (
        "which a planned motion avoids. Leave it out of --between.",
        f"{PLAN} {KNEE} current_limit@knee",
        f"{PLAN} {KNEE}",
    ),
    (
        "does not tell its torque. Leave it out of --between.",
        f"{PLAN} {KNEE} backlash@knee",
        f"{PLAN} {KNEE}",
    ),
    ("--between '{}' cannot be read as JSON", f"{PLAN} --between no.json", f"{PLAN} {TWO}"),
    ("' is no diagnosis.", f"{PLAN} --between list.json", f"{PLAN} --between found.json"),
    ("an effect of the diagnosis lacks", f"{PLAN} --between lacks.json", f"{PLAN} {TWO}"),
    (
        "give what `wbc diagnose --json FILE` wrote.",
        f"{PLAN} --between other.json",
        f"{PLAN} --between found.json",
    ),
    ("there is nothing to tell apart. Name", f"{PLAN} --between none.json", f"{PLAN} {TWO}"),
    (
        "stands beside other causes. Give one diagnosis alone, or ",
        f"{PLAN} --between found.json coulomb_friction@knee",
        f"{PLAN} --between found.json",
    ),
    (
        "--{} '{}': the name must end in {}.",
        f"{PLAN} --each {TWO} --out plans.csv",
        f"{PLAN} --each {TWO} --out plans.parquet",
    ),
    (
        "needs another cause to be told from.",
        f"{PLAN} --each --between coulomb_friction@hip --out p.parquet",
        f"{PLAN} --each {TWO} --out p.parquet",
    ),
    ("holds no rival of what it found", f"{PLAN} --between alone.json", f"{PLAN} {TWO}"),
    (
        "wants a name that ends in",
        "export planar_leg --to mjcf --file a.txt",
        "export planar_leg --to mjcf --file a.xml",
    ),
    (
        "--figures are drawn in two axes",
        "metrics planar_leg --axes x --figures out",
        "metrics planar_leg --axes xz --figures out",
    ),
    (
        "--{} '{}': the name must end in {}.",
        f"check run.csv {LEG} --fix map.txt",
        f"check run.csv {LEG} --fix map.toml",
    ),
    (
        "is a folder; name a file in it.",
        f"check run.csv {LEG} --json folder",
        f"check run.csv {LEG} --json folder/checked.json",
    ),
    (
        "would overwrite {}; choose another.",
        f"check run.csv {LEG} --json run.csv",
        f"check run.csv {LEG} --json checked.json",
    ),
    (
        "lies outside the log, which runs from {} s to {} s.",
        "play run.csv --robot planar_leg_fixed --html a.html --at 99",
        "play run.csv --robot planar_leg_fixed --html a.html --at 1",
    ),
    ("name some of x, y, z, each once.", "metrics planar_leg --axes zz", "metrics planar_leg"),
    (
        "is not JOINT=VALUE [rad, m].",
        "metrics planar_leg --pose hip=x",
        "metrics planar_leg --pose hip=0.1",
    ),
    ("--{} '{}': the name must end in {}.", f"{STUDY} --out d.csv", f"{STUDY} --out d.parquet"),
    (
        "--instants must be at least 1.",
        f"{STUDY} --gait run.csv --instants 0",
        f"{STUDY} --gait run.csv --instants 1",
    ),
    (
        "leave --samples out.",
        f"{STUDY} --gait run.csv --instants 1 --samples 3",
        f"{STUDY} --gait run.csv --instants 1",
    ),
    (
        "give --sweep NAME=LOW:HIGH.",
        "design planar_leg_fixed --out d.parquet",
        f"{STUDY} --out d.parquet",
    ),
    (
        "Leave these out of --simulate.",
        f"{STUDY} --simulate standing",
        STUDY,
    ),
    ("--sweep '{}': {}.", "design planar_leg_fixed --sweep reduction=1:2:3:4", STUDY),
    ("--sweep '{}': {}; {}.", "design planar_leg_fixed --sweep reduction=a:b", STUDY),
    ("--efficiency '{}' cannot", f"{STUDY} --efficiency no.csv", f"{STUDY} --efficiency good.csv"),
    (
        "needs the columns load [N m], forward_efficiency",
        f"{STUDY} --efficiency index.csv",
        f"{STUDY} --efficiency good.csv",
    ),
    (
        "give every load >= 0 with every speed >= 0",
        f"{STUDY} --efficiency twice.csv",
        f"{STUDY} --efficiency good.csv",
    ),
    (
        "efficiencies lie in (0, 1]",
        f"{STUDY} --efficiency high.csv",
        f"{STUDY} --efficiency good.csv",
    ),
    (
        "is no table of results; choose another --out.",
        f"{STUDY} --out runs.parquet",
        f"{STUDY} --out d.parquet",
    ),
    (
        "Choose another --out, or delete it.",
        f"{STUDY} --out d0.parquet ; {STUDY} --seed 1 --samples 3 --out d0.parquet",
        f"{STUDY} --seed 1 --samples 3 --out d.parquet",
    ),
    (
        'a table is expected, such as columns."hip.position" = "q1".',
        f"check q1.csv {LEG} --columns columns_wrong.toml",
        f"check q1.csv {LEG} --columns columns_right.toml",
    ),
    (
        'such as { unit = "deg" }, or false',
        f"check q1.csv {LEG} --columns entry_wrong.toml",
        f"check q1.csv {LEG} --columns entry_right.toml",
    ),
    (
        'a table is expected, such as rows.split = "log".',
        f"check runs.parquet {LEG} --columns rows_wrong.toml",
        f"check runs.parquet {LEG} --columns rows_right.toml",
    ),
    (
        'a table is expected, such as time.from = "t".',
        f"check t.csv {LEG} --columns time_wrong.toml",
        f"check t.csv {LEG} --columns time_right.toml",
    ),
    (
        "the rows per second: --rate HZ.",
        "init planar_leg_fixed clockless.csv --out new",
        "init planar_leg_fixed clockless.csv --out new --rate 500",
    ),
    (
        "--rate HZ, or put it in place of 100",
        "init planar_leg_fixed floored.parquet --out new",
        "init planar_leg_fixed floored.parquet --out new --rate 500",
    ),
    (
        "stand above the first [heading]. Option --fix",
        f"check q1.csv {LEG} --columns twice.toml",
        f"check q1.csv {LEG} --columns columns_right.toml",
    ),
    (
        "--rate must be > 0.",
        "init planar_leg_fixed clockless.csv --out new --rate 0",
        "init planar_leg_fixed clockless.csv --out new --rate 500",
    ),
    (
        "in a column map (--columns MAP.toml).",
        f"compare x9.csv {LEG}",
        f"compare x9.csv {LEG} --columns unnamed.toml",
    ),
    (
        "one table per driven joint expected",
        "compare run.csv --robot wrong.toml",
        "compare run.csv --robot geared.toml",
    ),
    (
        "' has no gears, so no joint is driven",
        "compare run.csv --robot bare.toml",
        "compare run.csv --robot geared.toml",
    ),
    (
        "\n    lock = ",
        "compare run.csv --robot loose.toml",
        "compare run.csv --robot geared.toml",
    ),
    (
        "Give all of it again",
        f"diagnose {DIAGNOSE} --fleet two.csv --out f.parquet ; "
        f"diagnose {DIAGNOSE} --fleet index.csv --out f.parquet",
        f"diagnose {DIAGNOSE} --fleet two.csv --out f.parquet",
    ),
]
_MAPS = {
    "columns_wrong": "columns = 1",
    "columns_right": 'columns."hip.position" = "q1"',
    "unnamed": 'columns."hip.position" = "x9"',
    "entry_wrong": 'columns."hip.position" = 1',
    "entry_right": 'columns."hip.position" = { from = "q1", unit = "rad" }',
    "rows_wrong": "rows = 1",
    "rows_right": 'rows.split = "part"',
    "time_wrong": "time = 1",
    "time_right": 'time.from = "t"',
    "twice": '[columns]\n"hip.position" = "q1"\n[columns]\n',
}
_ROBOT = """
name = "leg"
model = "{model}"
{lock}
{gears}
"""
_GEARS = "".join(
    f"""
    [gears.{joint}]
    gear_ratio = {{ value = 20.0, unit = "1", source = "data sheet" }}
    rotor_inertia = {{ value = 6.67e-5, unit = "kg m^2", source = "data sheet" }}
    """
    for joint in ("hip", "knee")
)
_LOCK = "lock = ['base_x', 'base_z', 'base_pitch']"
_FOUND = {"effect": "coulomb_friction", "where": "hip", "parameters": {"level": 0.7}}
_RIVAL = {"effect": "viscous_friction", "where": "hip", "parameters": {"coefficient": 0.4}}


def _write_logs(log: Log) -> None:
    text = save_log(log, "run.csv").read_text(encoding="utf-8")
    Path("clockless.csv").write_text(text.replace("time", "row", 1), encoding="utf-8")
    for name in ("q1", "x9"):
        Path(f"{name}.csv").write_text(text.replace("hip.position", name), encoding="utf-8")
    floored = log.time.astype(int)
    table = pa.table({"time": floored, **log.columns})
    pq.write_table(table, "floored.parquet")
    Path("t.csv").write_text(re.sub("^time", "t", text), encoding="utf-8")
    half = ["a"] * (len(log) // 2) + ["b"] * (len(log) - len(log) // 2)
    pq.write_table(pa.table({"time": log.time, **log.columns, "part": half}), "runs.parquet")
    Path("index.csv").write_text("log,machine,date\nrun.csv,leg,2026-03-01\n", encoding="utf-8")
    two = "log,machine,date\nrun.csv,leg,2026-03-01\nrun.csv,other,2026-03-02\n"
    Path("two.csv").write_text(two, encoding="utf-8")


def _write_robots() -> None:
    model = (ROOT / "robots" / "planar_leg" / "planar_leg.urdf").as_posix()
    for name, lock, gears in (
        ("geared", _LOCK, _GEARS),
        ("wrong", f"gears = 1\n{_LOCK}", ""),
        ("bare", _LOCK, ""),
        ("loose", "", _GEARS),
    ):
        text = _ROBOT.format(model=model, lock=lock, gears=gears)
        Path(f"{name}.toml").write_text(text, encoding="utf-8")


def _write_tables() -> None:
    for name, text in _MAPS.items():
        Path(f"{name}.toml").write_text(f"{text}\n", encoding="utf-8")
    head = "load,forward_efficiency,backward_efficiency\n"
    for name, rows in (
        ("good", "0,0.8,0.7\n10,0.9,0.8\n"),
        ("twice", "0,0.8,0.7\n0,0.9,0.8\n"),
        ("high", "0,0.8,1.7\n10,0.9,0.8\n"),
    ):
        Path(f"{name}.csv").write_text(head + rows, encoding="utf-8")
    ranked = {
        "added": [["viscous_friction", "hip"]],
        "removed": [["coulomb_friction", "hip"]],
        "standing": "not distinguishable",
        "effects": [_RIVAL],
    }
    for name, content in (
        ("list", []),
        ("lacks", {"effects": [{"effect": "coulomb_friction"}]}),
        ("other", {"robot": "leg"}),
        ("none", {"verdict": "none", "effects": []}),
        ("alone", {"verdict": "named", "effects": [_FOUND], "ranking": []}),
        ("found", {"verdict": "ambiguous", "effects": [_FOUND], "ranking": [ranked]}),
    ):
        Path(f"{name}.json").write_text(json.dumps(content), encoding="utf-8")


@pytest.fixture
def room(excited_log: Callable[..., Log], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    _write_logs(excited_log((CoulombFriction("hip", 0.7),), duration=2.0))
    _write_robots()
    _write_tables()
    Path("folder").mkdir()
    return tmp_path


@pytest.mark.parametrize(("words", "refused", "asked"), FIXES, ids=[f[0] for f in FIXES])
def test_what_a_message_asks_for_is_accepted(
    words: str, refused: str, asked: str, room: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    *before, refused = refused.split(" ; ")
    assert [main(shlex.split(command)) for command in before] == [0] * len(before)
    assert main(shlex.split(refused)) == 2
    said = capsys.readouterr().err
    pattern = ".*".join(re.escape(part) for part in words.split("{}"))
    assert re.search(pattern, said, re.DOTALL), said
    assert main(shlex.split(asked)) != 2, capsys.readouterr().err


def test_more_is_printed_where_a_line_says_so(
    room: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(shlex.split(f"check q1.csv {LEG} --quiet")) == 1
    short = capsys.readouterr().out
    assert " ".join(short.split()).endswith("Why: the same command without --quiet.")
    assert main(shlex.split(f"check q1.csv {LEG}")) == 1
    assert "no position of hip" in " ".join(capsys.readouterr().out.split())
    Path("extra.csv").write_text(
        Path("run.csv").read_text().replace("\n", ",1.5\n").replace(",1.5", ",odd", 1)
    )
    assert main(shlex.split(f"check extra.csv {LEG} --quiet")) == 0
    assert "(printed without --quiet)" in " ".join(capsys.readouterr().out.split())
    assert main(shlex.split(f"check extra.csv {LEG}")) == 0
    assert "columns that were not read: odd" in " ".join(capsys.readouterr().out.split())


def test_a_column_that_was_not_read_is_read_with_a_map(room: Path) -> None:
    with pytest.raises(LogError, match=r"Column 'q1' was not read"):
        load_log("q1.csv").column("hip.position")
    assert load_log("q1.csv", columns="columns_right.toml").column("hip.position").size


def test_an_experiment_without_a_cause_wants_one() -> None:
    robot = load_robot("planar_leg_fixed")
    noise = np.full(2, 0.1)
    with pytest.raises(DesignError, match="give --between"):
        Rivals(robot, (), noise)
    assert Rivals(robot, (parse_cause("coulomb_friction@hip", robot),), noise).causes


def test_all_rows_of_a_study_are_where_the_table_says(
    room: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study = "design planar_leg_fixed --sweep reduction=10:20:40 --json d.json --out d.parquet"
    assert main(shlex.split(study)) == 0
    shown = capsys.readouterr().out
    found = re.search(r"of (\d+) rows, evenly spread; --json and --out hold all", shown)
    assert found, shown
    assert pq.read_table("d.parquet").num_rows >= int(found[1])


def test_a_robot_whose_base_moves_is_held_by_one_line(room: Path) -> None:
    text = Path("loose.toml").read_text(encoding="utf-8")
    free, held = Path("free.toml"), Path("held.toml")
    free.write_text(f'base = "free_flyer"\n{text}', encoding="utf-8")
    held.write_text(f'base = "fixed"\n{text}', encoding="utf-8")
    assert load_robot(free).model.nv == load_robot(held).model.nv + 6
