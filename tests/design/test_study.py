"""Studies: sweeps, the catalogue of gearboxes, tables on disk and fronts."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from tests.conftest import Told
from tests.metrics.one_design import robot_at
from wbc import design, load_robot
from wbc.errors import DesignError, WbcError
from wbc.metrics import Designs, design_metrics

LEG = load_robot("planar_leg")
POSE = tuple(LEG.pose("paper").tolist())


def study(*sweeps: str, **changes: object) -> design.Study:
    chosen = sweeps or ("reduction=6:160:12:log", "forward_efficiency=0.45:0.98:15")
    first = design.Study("planar_leg", tuple(map(design.parse_sweep, chosen)), "foot", POSE)
    return replace(first, **changes)  # type: ignore[arg-type]


def geared(names: str) -> design.Study:
    return study(parameters=(), gearboxes=design.choose_gearboxes(names, design.read_gearboxes()))


def test_sweeps_are_read_as_they_are_written() -> None:
    assert design.parse_sweep("reduction=6:160").values[::8] == (6.0, 160.0)
    np.testing.assert_allclose(
        design.parse_sweep("reduction=1:100:3:log").values, [1.0, 10.0, 100.0]
    )
    assert design.parse_sweep("reduction=5,10,50").values == (5.0, 10.0, 50.0)
    knee = design.parse_sweep("forward_efficiency.knee=0.5:0.9:5")
    assert (knee.column, knee.place, len(knee.values)) == ("forward_efficiency.knee", "knee", 5)


@pytest.mark.parametrize(
    ("sweep", "message"),
    [
        ("reduction=9:3", "no range"),
        ("reduction=0:3:3:log", "above 0"),
        ("reduction=1:3:0", "at least 1"),
        ("ratio=1:3", "There are: reduction"),
        ("joint=1:3", "name the joint"),
        ("reduction=nan:3", "no range"),
        # of this robot
        ("reduction.ankle=1:3", "hip, knee"),
        ("mass.thigh=1:3", "There are: reduction"),
        ("joint.ankle=1:3", "There are"),
        ("reduction=0:3", "other than 0"),
        ("forward_efficiency=0.5:1.2", r"\(0, 1\]"),
    ],
)
def test_sweeps_that_cannot_be_are_named(sweep: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(WbcError, match=message):
        design.run_study(study(sweep), tmp_path / "x.parquet")
    assert not list(tmp_path.glob("*.parquet"))


def test_the_table_holds_every_design_once_with_its_metrics(tmp_path: Path) -> None:
    gears = "reduction=6,20", "forward_efficiency.knee=0.6:0.9:3"
    chosen = study(*gears, "torque_limit=1,3", "joint.knee=0.9,1.2")
    path = tmp_path / "x.parquet"
    table = design.run_study(chosen, path)
    read = pq.read_table(path)
    np.testing.assert_equal({name: read[name].to_numpy() for name in read.column_names}, table)
    assert list(table) == list(design.describe_columns(chosen))
    assert table["design"].tolist() == list(range(24))
    assert len({tuple(table[p.column][i] for p in chosen.parameters) for i in range(24)}) == 24
    for i in (0, 7, 23):
        robot, q = robot_at(chosen.designs(i, i + 1), 0)
        knee, gears = table["forward_efficiency.knee"][i], robot.transmission
        assert gears.forward_efficiency.tolist() == [0.8, knee]  # the hip keeps its own
        assert gears.backward_efficiency == pytest.approx([0.75, 2.0 - 1.0 / knee])
        assert gears.torque_limit.tolist() == [table["torque_limit"][i]] * 2
        single = design_metrics(Designs.of(robot, q), "foot", [0, 1], "xz")
        assert table["lift"][i] == pytest.approx(single.lift[0])
        assert table["impact_mitigation"][i] == pytest.approx(single.impact_mitigation[0])
    field = pq.read_schema(path).field("lift")
    assert field.metadata == {b"unit": b"N"}


def test_a_table_is_the_same_however_many_designs_are_evaluated_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = design.run_study(study(), tmp_path / "one.parquet")
    monkeypatch.setattr("wbc.design.study._CHUNK", 37)
    np.testing.assert_equal(design.run_study(study(), tmp_path / "two.parquet"), whole)
    one, two = ((tmp_path / name).read_bytes() for name in ("one.parquet", "two.parquet"))
    assert one == two


UNLIMITED = ("forward_efficiency=0.6:0.9:3", "holding_torque:min")
LIMITED = ("torque_limit=1:3:3", "lift:max")


@pytest.mark.parametrize(("sweep", "first"), [UNLIMITED, LIMITED])
@pytest.mark.usefixtures("here")
def test_an_arm_without_torque_limits_is_not_judged_by_an_unlimited_lift(
    sweep: str, first: str, told: Told
) -> None:
    command = "design staubli_tx40 --contact link_6 --pose joint_2=0.5,joint_3=1.2 --json -"
    command += f" --sweep reduction=20:160:4:log --sweep {sweep}"
    found = json.loads(told(*command.split()))
    assert found["objectives"] == [first, "backward_inertia:min"]
    # A real choice: every design of the front has a finite value, and they differ.
    values = {row[first.split(":")[0]] for row in found["front"]}
    assert "unlimited" not in values
    assert len(values) > 1


def brute(costs: np.ndarray) -> set[int]:
    """Return the rows that no other row beats, by comparing all pairs."""
    finite = np.isfinite(costs).all(axis=1)
    rows = costs[finite]
    beaten = [np.any(np.all(rows <= row, axis=1) & np.any(rows < row, axis=1)) for row in costs]
    return set(np.flatnonzero(finite & ~np.array(beaten)).tolist())


CLOUDS = [(columns, 400, digits) for columns in (1, 2, 3) for digits in (9, 1)]


@pytest.mark.parametrize(("columns", "rows", "digits"), [*CLOUDS, (2, 5000, 9)])
def test_the_front_is_that_of_all_pairs(columns: int, rows: int, digits: int) -> None:
    """With few digits rows are equal and tie; the most rows are more than a block."""
    random = np.random.default_rng(columns).normal(size=(rows, columns))
    random[::7] = 0.1 * random[::7] + 2.0 * (rows > 400)
    values = np.round(random, digits)
    values[3::50, 0] = np.nan  # rows that never count
    table = {f"c{i}": values[:, i] for i in range(columns)}
    signs = np.array([1.0, -1.0, 1.0])[:columns]
    objectives = [design.Objective(f"c{i}", signs[i] < 0) for i in range(columns)]
    front = design.pareto_front(table, objectives)
    assert set(front.tolist()) == brute(values * signs)
    assert np.all(np.diff((values * signs)[front, 0]) >= 0.0)


def test_objectives_are_read_and_checked() -> None:
    assert design.parse_objective("a:min", ["a"]) == design.Objective("a", more=False)
    for text in ("b:max", "a", "a:best"):
        with pytest.raises(DesignError):
            design.parse_objective(text, ["a"])
    with pytest.raises(DesignError, match="at least one"):
        design.pareto_front({"a": np.ones(1)}, [])
    infinite = {"a": np.array([1.0, 3.0, np.inf]), "b": np.array([2.0, np.nan, 0.0])}
    assert design.pareto_front(infinite, [*map(design.Objective, "ab")]).tolist() == [2, 0]


def test_every_row_has_a_source_and_plausible_numbers() -> None:
    boxes = design.read_gearboxes().values()
    rows = Path(design.__file__).with_name("gearboxes.csv").read_text().splitlines()
    assert len(boxes) == len(rows) - 1  # no name stands twice
    kinds = {"direct drive", "planetary", "cycloidal", "strain wave"}
    assert {box.kind.split(" (")[0] for box in boxes} >= kinds
    for box in boxes:
        assert len(box.source) > 10
        for value in (box.forward_efficiency, box.backward_efficiency):
            assert value is None or 0.0 < value <= 1.0
        assert box.gear_inertia is None or box.gear_inertia < 1e-3  # kg m^2, not kg cm^2


def test_a_gearbox_sets_what_it_knows_and_nothing_else() -> None:
    gears = LEG.transmission
    chosen = (
        robot_at(geared(name).designs(0, 1), 0)[0] for name in ("bilateral_drive", "sp100_mc_10")
    )
    drive, planetary = (robot.transmission for robot in chosen)
    np.testing.assert_array_equal(drive.gear_ratio, gears.gear_ratio)
    np.testing.assert_array_equal(drive.rotor_inertia, gears.rotor_inertia)
    assert drive.forward_efficiency.tolist() == [0.89, 0.89]
    assert drive.backward_efficiency.tolist() == [0.853, 0.853]
    assert planetary.gear_ratio.tolist() == [10.0, 10.0]
    np.testing.assert_allclose(planetary.rotor_inertia, gears.rotor_inertia + 2.07e-4)
    np.testing.assert_allclose(planetary.backward_efficiency, 2.0 - 1.0 / 0.985)


def test_what_a_gearbox_leaves_out_may_be_swept() -> None:
    swept = (design.parse_sweep("forward_efficiency=0.8,0.9"),)
    both = replace(geared("cqdd,bilateral_drive"), parameters=swept)
    found = both.designs(0, both.size).gears
    assert found["forward_efficiency"][:, 0].tolist() == [0.8, 0.9, 0.8, 0.9]
    backward = found["backward_efficiency"][:, 0]
    np.testing.assert_allclose(backward[:2], [0.75, 2.0 - 1.0 / 0.9])
    np.testing.assert_allclose(backward[2:], 0.853)


def test_an_unknown_gearbox_is_named() -> None:
    with pytest.raises(DesignError, match="hd20_low"):
        design.choose_gearboxes("hd30", design.read_gearboxes())


@pytest.mark.usefixtures("here")
def test_the_command_compares_gearboxes_by_their_front(told: Told) -> None:
    found = json.loads(told(*["design", "planar_leg", "--gearbox", "all", "--json", "-"]))
    assert all(box["source"] for box in found["gearboxes"])
    assert found["designs"] == len(found["gearboxes"])
    assert found["objectives"] == ["lift:max", "impact_mitigation:max"]
    assert "Matsuki" in told("list", "gearboxes")


def test_a_front_without_designs_says_why(tmp_path: Path, told: Told) -> None:
    """A straight leg: infinite force, infinite inertia."""
    for robot, pose, judged in (
        ("planar_leg_fixed", "knee=0", False),
        ("planar_leg", "paper", True),
    ):
        options = f"--pose {pose} --sweep reduction=20:100:3 --out {tmp_path}/{robot}.parquet"
        said = told("design", robot, *options.split())
        assert ("No design can be judged" in said) != judged
