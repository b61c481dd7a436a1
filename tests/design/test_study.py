"""Studies: sweeps, tables on disk and fronts."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from wbc.cli import main
from wbc.design import (
    Objective,
    Study,
    best_designs,
    describe_columns,
    pareto_front,
    parse_objective,
    parse_sweep,
    read_designs,
    run_study,
    sampled_designs,
)
from wbc.effects import load_robot
from wbc.errors import DesignError, WbcError
from wbc.metrics import sweep

LEG = load_robot("planar_leg")
POSE = tuple(LEG.pose("paper").tolist())


def study(*sweeps: str, **changes: object) -> Study:
    chosen = sweeps or ("reduction=6:160:12:log", "forward_efficiency=0.45:0.98:15")
    first = Study("planar_leg", tuple(map(parse_sweep, chosen)), "foot", POSE)
    return replace(first, **changes)  # type: ignore[arg-type]


def test_sweeps_are_read_as_they_are_written() -> None:
    assert parse_sweep("reduction=6:160").grid[[0, -1]].tolist() == [6.0, 160.0]
    np.testing.assert_allclose(parse_sweep("reduction=1:100:3:log").grid, [1.0, 10.0, 100.0])
    assert parse_sweep("reduction=5,10,50").grid.tolist() == [5.0, 10.0, 50.0]
    knee = parse_sweep("forward_efficiency.knee=0.5:0.9:5")
    assert (knee.column, knee.place, len(knee.grid)) == ("forward_efficiency.knee", "knee", 5)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("reduction", "use NAME=LOW:HIGH"),
        ("reduction=a:b", "could not convert"),
        ("reduction=9:3", "no range"),
        ("reduction=0:3:3:log", "above 0"),
        ("reduction=1:3:0", "at least 1"),
        ("reduction=1:2:3:4", "use NAME=LOW:HIGH"),
        ("ratio=1:3", "There are: reduction"),
        ("length=1:3", "name the link"),
        ("joint=1:3", "name the joint"),
        ("reduction=nan:3", "no range"),
    ],
)
def test_sweeps_that_cannot_be_are_named(text: str, message: str) -> None:
    with pytest.raises(DesignError, match=message):
        parse_sweep(text)


@pytest.mark.parametrize(
    ("sweep", "message"),
    [
        ("reduction.ankle=1:3", "hip, knee"),
        ("mass.foot=1:3", "There are"),
        ("joint.ankle=1:3", "There are"),
        ("reduction=0:3", "other than 0"),
        ("forward_efficiency=0.5:1.2", r"\(0, 1\]"),
        ("length.slide_x=1:3", "no length"),
    ],
)
def test_places_and_values_that_are_not_there_are_named(
    sweep: str, message: str, tmp_path: Path
) -> None:
    with pytest.raises(WbcError, match=message):
        run_study(study(sweep), tmp_path / "x.parquet")
    assert not list(tmp_path.glob("*.parquet"))


def test_the_table_holds_every_design_once_with_its_metrics(tmp_path: Path) -> None:
    chosen = study(
        "reduction=6,20",
        "forward_efficiency.knee=0.6:0.9:3",
        "mass.thigh=1,3",
        "joint.knee=0.9,1.2",
    )
    path = run_study(chosen, tmp_path / "x.parquet", chunk=5)
    table = read_designs(path)
    assert list(table) == list(describe_columns(chosen))
    assert table["design"].tolist() == list(range(24))
    assert len({tuple(table[p.column][i] for p in chosen.parameters) for i in range(24)}) == 24
    for i in (0, 7, 23):
        robot, q = chosen.designs(i, i + 1).robot_at(0)
        knee = robot.transmission.forward_efficiency[1]
        assert knee == table["forward_efficiency.knee"][i]
        assert robot.transmission.backward_efficiency[1] == pytest.approx(2.0 - 1.0 / knee)
        assert robot.transmission.forward_efficiency[0] == 0.8  # the hip keeps its own
        assert robot.transmission.backward_efficiency[0] == pytest.approx(0.75)
        assert robot.model.inertias[4].mass == pytest.approx(table["mass.thigh"][i])
        single = sweep(robot, q[None], "foot", [0, 1], axes="xz")
        assert table["lift"][i] == pytest.approx(single.lift[0])
        assert table["impact_mitigation"][i] == pytest.approx(single.impact_mitigation[0])
    field = pq.read_schema(path).field("lift")
    assert field.metadata == {b"unit": b"N"}


def test_any_number_of_workers_gives_the_same_bytes(tmp_path: Path) -> None:
    chosen = study(samples=300, seed=4)
    one = run_study(chosen, tmp_path / "one.parquet", chunk=37)
    two = run_study(chosen, tmp_path / "two.parquet", chunk=37, workers=2)
    assert one.read_bytes() == two.read_bytes()
    again = read_designs(run_study(replace(chosen, seed=5), tmp_path / "x.parquet", chunk=37))
    assert not np.array_equal(read_designs(one)["reduction"], again["reduction"])
    assert read_designs(one)["reduction"].min() >= 6.0


def test_the_command_writes_table_front_and_figures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    command = ["design", "planar_leg", "--sweep", "reduction=6:160:8:log"]
    command += ["--sweep", "forward_efficiency=0.5:0.98:6"]
    assert main([*command, "--figures", "out", "--json", "f.json"]) == 0
    assert "Pareto front" in capsys.readouterr().out
    found = json.loads(Path("f.json").read_text())
    assert found["designs"] == 48
    assert found["objectives"] == ["lift:max", "impact_mitigation:max"]
    # Of two gears the more efficient one is better in both: the front is that of one efficiency.
    assert {row["forward_efficiency"] for row in found["front"]} == {0.98}
    assert len(found["front"]) == 8
    assert {p.name for p in Path("out").iterdir()} == {
        "planar_leg_design_map.png",
        "planar_leg_design_front.png",
    }
    assert main([*command, "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["designs"] == 48


@pytest.mark.parametrize(
    ("sweep", "first"),
    [("forward_efficiency=0.6:0.9:3", "holding_torque:min"), ("torque_limit=1:3:3", "lift:max")],
)
def test_an_arm_without_torque_limits_is_not_judged_by_an_unlimited_lift(
    sweep: str, first: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    command = ["design", "staubli_tx40", "--contact", "link_6", "--json", "f.json"]
    command += ["--pose", "joint_2=0.5,joint_3=1.2", "--sweep", "reduction=20:160:4:log"]
    assert main([*command, "--sweep", sweep]) == 0
    found = json.loads(Path("f.json").read_text())
    assert found["objectives"] == [first, "backward_inertia:min"]
    column = first.split(":")[0]
    # A real choice: every design of the front has a finite value, and they differ.
    values = {row[column] for row in found["front"]}
    assert "unlimited" not in values
    assert len(values) > 1


@pytest.mark.parametrize(
    ("robot", "extra"),
    [
        ("solo12", ["--sweep", "reduction=5:20:5", "--sweep", "length.FL_LOWER_LEG=0.1:0.2:3"]),
        ("staubli_tx40", ["--sweep", "reduction=10:200:5", "--contact", "link_6"]),
    ],
)
def test_a_quadruped_and_an_arm(
    robot: str, extra: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    arm = ["--pose", "joint_2=0.4,joint_3=1.2"] if robot == "staubli_tx40" else []
    assert main(["design", robot, *extra, *arm, "--axes", "xyz", "--json", "f.json"]) == 0
    table = read_designs("designs.parquet")
    assert np.all(np.isfinite(table["backward_inertia"]))
    assert np.all(np.diff(table["backward_inertia"].reshape(5, -1)[:, 0]) > 0.0)


def brute(costs: np.ndarray) -> set[int]:
    """Return the rows that no other row beats, by comparing all pairs."""
    beaten = [np.any(np.all(costs <= row, axis=1) & np.any(costs < row, axis=1)) for row in costs]
    return set(np.flatnonzero(np.isfinite(costs).all(axis=1) & ~np.array(beaten)).tolist())


@pytest.mark.parametrize("columns", [1, 2, 3])
@pytest.mark.parametrize(("rows", "digits"), [(400, 9), (400, 1), (5000, 9)])
def test_the_front_is_that_of_all_pairs(columns: int, rows: int, digits: int) -> None:
    """With few digits rows are equal and tie; the most rows are more than a block."""
    random = np.random.default_rng(columns).normal(size=(rows, columns))
    random[::7] = 0.1 * random[::7] + 2.0 * (rows > 400)
    values = np.round(random, digits)
    table = {f"c{i}": values[:, i] for i in range(columns)}
    signs = np.array([1.0, -1.0, 1.0])[:columns]
    objectives = [Objective(f"c{i}", signs[i] < 0) for i in range(columns)]
    front = pareto_front(table, objectives)
    assert set(front.tolist()) == brute(values * signs)
    assert np.all(np.diff((values * signs)[front, 0]) >= 0.0)


def test_rows_without_a_number_never_count() -> None:
    table = {"a": np.array([1.0, np.nan, 3.0, np.inf]), "b": np.array([2.0, 9.0, np.nan, 0.0])}
    assert pareto_front(table, [Objective("a"), Objective("b")]).tolist() == [3, 0]
    nothing = {"a": np.array([np.nan])}
    assert pareto_front(nothing, [Objective("a")]).size == 0


def test_objectives_are_read_and_checked() -> None:
    assert parse_objective("a:min", ["a"]) == Objective("a", more=False)
    for text in ("b:max", "a", "a:best"):
        with pytest.raises(DesignError):
            parse_objective(text, ["a"])
    with pytest.raises(DesignError, match="at least one"):
        pareto_front({"a": np.ones(1)}, [])


OBJECTIVES = [Objective("lift"), Objective("inertia", more=False)]
ROWS = 3000


@pytest.fixture(scope="module")
def columns() -> dict[str, np.ndarray]:
    """Rows with a front of many designs, ties and places without a number."""
    random = np.random.default_rng(4)
    lift = random.normal(size=ROWS).round(2)
    return {
        "design": np.arange(ROWS, dtype=float),
        "lift": np.where(random.random(ROWS) < 0.05, np.nan, lift),
        "inertia": (lift + 0.1 * random.normal(size=ROWS)).round(2),
    }


@pytest.mark.parametrize("piece", [7, 100, 10_000])
def test_the_front_of_pieces_is_the_front_of_the_whole(
    columns: dict[str, np.ndarray], piece: int, tmp_path: Path
) -> None:
    path = tmp_path / "designs.parquet"
    pq.write_table(pa.table(columns), path, row_group_size=piece)
    front = pareto_front(columns, OBJECTIVES)
    assert len(front) > 10
    best = best_designs(path, OBJECTIVES)
    assert list(best) == list(columns)
    for name, values in columns.items():
        np.testing.assert_array_equal(best[name], values[front])


def test_a_picture_gets_whole_designs_evenly_spread(
    columns: dict[str, np.ndarray], tmp_path: Path
) -> None:
    table = tmp_path / "designs.parquet"
    pq.write_table(pa.table(columns), table, row_group_size=1200)
    assert len(sampled_designs(table, ROWS)["design"]) == ROWS
    assert sampled_designs(table, 100)["design"].tolist() == list(range(0, ROWS, 30))
