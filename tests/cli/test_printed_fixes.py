"""Ways out that a message prints with an option, a command or a line of TOML are walked."""

import json
import re
import shlex
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from tests.cli.conftest import LEG, Excited
from tests.conftest import Told
from wbc.cli import main
from wbc.effects import CoulombFriction
from wbc.errors import LogError
from wbc.measurement import load_log, save_log

ROOT = Path(__file__).resolve().parents[2]
SHORT = {
    "LEG": " ".join(LEG),
    "DIAGNOSE": " ".join([*LEG, "--add coulomb_friction --quiet"]),
    "PLAN": "experiment planar_leg_fixed --rounds 1 --duration 2 --speed 3 --span 0.5",
    "KNEE": "--between rotor_inertia@knee",
    "TWO": "--between coulomb_friction@hip viscous_friction@hip",
    "STUDY": "design planar_leg_fixed --sweep reduction=10:20:3",
}
# Words of the message as they stand in the sources; a command that ends with it; the command that
# the message asks for.
FIXES = [
    tuple(line.split("\t"))
    for line in Path(__file__).with_name("printed_fixes.tsv").read_text("utf-8").splitlines()
]
_MODEL = f'name = "leg"\nmodel = "{(ROOT / "robots/planar_leg/planar_leg.urdf").as_posix()}"\n'
_LOCK = "lock = ['base_x', 'base_z', 'base_pitch']\n"
_GEARS = """
[gears."*"]
gear_ratio = { value = 20.0, unit = "1", source = "data sheet" }
rotor_inertia = { value = 6.67e-5, unit = "kg m^2", source = "data sheet" }
"""
_FOUND = {"effect": "coulomb_friction", "where": "hip", "parameters": {"level": 0.7}}
_RIVAL = {"effect": "viscous_friction", "where": "hip", "parameters": {"coefficient": 0.4}}
_RANKED = {
    "added": [["viscous_friction", "hip"]],
    "removed": [["coulomb_friction", "hip"]],
    "standing": "not distinguishable",
    "effects": [_RIVAL],
}
FILES = {
    "columns_wrong.toml": "columns = 1",
    "columns_right.toml": 'columns."hip.position" = "q1"',
    "unnamed.toml": 'columns."hip.position" = "x9"',
    "entry_wrong.toml": 'columns."hip.position" = 1',
    "entry_right.toml": 'columns."hip.position" = { from = "q1", unit = "rad" }',
    "rows_wrong.toml": "rows = 1",
    "rows_right.toml": 'rows.split = "part"',
    "time_wrong.toml": "time = 1",
    "time_right.toml": 'time.from = "t"',
    "twice.toml": '[columns]\n"hip.position" = "q1"\n[columns]\n',
    "geared.toml": _MODEL + _LOCK + _GEARS,
    "wrong.toml": _MODEL + "gears = 1\n" + _LOCK,
    "bare.toml": _MODEL + _LOCK,
    "loose.toml": _MODEL + _GEARS,
    "list.json": [],
    "lacks.json": {"effects": [{"effect": "coulomb_friction"}]},
    "other.json": {"robot": "leg"},
    "none.json": {"verdict": "none", "effects": []},
    "alone.json": {"verdict": "named", "effects": [_FOUND], "ranking": []},
    "found.json": {"verdict": "ambiguous", "effects": [_FOUND], "ranking": [_RANKED]},
}


@pytest.fixture(autouse=True)
def _room(excited_log: Excited, here: Path) -> None:
    """Fill the working folder."""
    Path("folder").mkdir()
    for name, content in FILES.items():
        Path(name).write_text(content if isinstance(content, str) else json.dumps(content))
    log = excited_log((CoulombFriction("hip", 0.7),), duration=2.0)
    text = save_log(log, "run.csv").read_text()
    for name, old, new in (
        ("clockless.csv", "time", "row"),
        ("q1.csv", "hip.position", "q1"),
        ("x9.csv", "hip.position", "x9"),
        ("t.csv", "time", "t"),
        ("leg_2026-03-01.csv", "time", "time"),
    ):
        Path(name).write_text(text.replace(old, new, 1))
    columns, first = {"time": log.time, **log.columns}, log.time < log.time[len(log) // 2]
    pq.write_table(pa.table({**columns, "time": log.time.astype(int)}), "floored.parquet")
    pq.write_table(pa.table({**columns, "part": np.where(first, "a", "b")}), "runs.parquet")


def words_of(command: str) -> list[str]:
    """Return the words of a command, with those of SHORT written out."""
    return shlex.split(" ".join(SHORT.get(word, word) for word in command.split()))


@pytest.mark.parametrize(("words", "refused", "asked"), FIXES, ids=[f[0] for f in FIXES])
def test_what_a_message_asks_for_is_accepted(
    words: str, refused: str, asked: str, told: Told
) -> None:
    *before, refused = refused.split(" ; ")
    for command in before:
        told(*words_of(command))
    said = told(*words_of(refused), code=2)
    assert said.startswith("wbc: ")  # and nothing before it on the standard output
    assert re.search(".*".join(re.escape(part) for part in words.split("{}")), said), said
    assert main(words_of(asked)) != 2


def test_more_is_printed_where_a_line_says_so(told: Told) -> None:
    short = told("check", "q1.csv", *words_of("LEG --quiet"), code=1)
    assert short.endswith("Why: the same command without --quiet.")
    assert "no position of hip" in told("check", "q1.csv", *words_of("LEG"), code=1)
    Path("extra.csv").write_text(
        Path("run.csv").read_text().replace("\n", ",1.5\n").replace(",1.5", ",odd", 1)
    )
    short = told("check", "extra.csv", *words_of("LEG --quiet"))
    assert "(printed without --quiet)" in short
    assert "columns that were not read: odd" in told("check", "extra.csv", *words_of("LEG"))


def test_a_column_that_was_not_read_is_read_with_a_map() -> None:
    with pytest.raises(LogError, match=r"Column 'q1' was not read"):
        load_log("q1.csv").column("hip.position")
    assert load_log("q1.csv", columns="columns_right.toml").column("hip.position").size


def test_all_rows_of_a_study_are_where_the_table_says(told: Told) -> None:
    study = "design planar_leg_fixed --sweep reduction=10:20:40 --json d.json --out d.parquet"
    shown = told(*study.split())
    found = re.search(r"of (\d+) rows, evenly spread; --json and --out hold all", shown)
    assert found, shown
    assert pq.read_table("d.parquet").num_rows >= int(found[1])
