"""The catalogue of gearboxes."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wbc.cli import main
from wbc.design import (
    Study,
    choose_gearboxes,
    parse_sweep,
    read_gearboxes,
)
from wbc.effects import load_robot
from wbc.errors import DesignError

LEG = load_robot("planar_leg")
POSE = LEG.pose("paper")


def study(*sweeps: str, **changes: object) -> Study:
    first = Study("planar_leg", tuple(map(parse_sweep, sweeps or ["reduction=9"])), "foot",
                  tuple(POSE.tolist()))  # fmt: skip
    return replace(first, **changes)  # type: ignore[arg-type]


def chosen(names: str) -> Study:
    return study(parameters=(), gearboxes=choose_gearboxes(names, read_gearboxes()))


def test_every_row_has_a_source_and_plausible_numbers() -> None:
    boxes = read_gearboxes().values()
    assert {box.kind.split(" (")[0] for box in boxes} >= {
        "direct drive", "planetary", "cycloidal", "strain wave",
    }  # fmt: skip
    for box in boxes:
        assert len(box.source) > 10
        for value in (box.forward_efficiency, box.backward_efficiency):
            assert value is None or 0.0 < value <= 1.0
        assert box.gear_inertia is None or box.gear_inertia < 1e-3  # kg m^2, not kg cm^2


def test_a_gearbox_sets_what_it_knows_and_nothing_else() -> None:
    gears = LEG.transmission
    robot, _ = chosen("bilateral_drive").designs(0, 1).robot_at(0)
    np.testing.assert_array_equal(robot.transmission.gear_ratio, gears.gear_ratio)
    np.testing.assert_array_equal(robot.transmission.rotor_inertia, gears.rotor_inertia)
    assert robot.transmission.forward_efficiency.tolist() == [0.89, 0.89]
    assert robot.transmission.backward_efficiency.tolist() == [0.853, 0.853]
    robot, _ = chosen("sp100_mc_10").designs(0, 1).robot_at(0)
    assert robot.transmission.gear_ratio.tolist() == [10.0, 10.0]
    np.testing.assert_allclose(robot.transmission.rotor_inertia, gears.rotor_inertia + 2.07e-4)
    np.testing.assert_allclose(robot.transmission.backward_efficiency, 2.0 - 1.0 / 0.985)


def test_what_a_gearbox_leaves_out_may_be_swept() -> None:
    both = replace(chosen("cqdd,bilateral_drive"), parameters=(
        parse_sweep("forward_efficiency=0.8,0.9"),))  # fmt: skip
    found = both.designs(0, both.size).gears
    assert found["forward_efficiency"][:, 0].tolist() == [0.8, 0.9, 0.8, 0.9]
    backward = found["backward_efficiency"][:, 0]
    np.testing.assert_allclose(backward[:2], [0.75, 2.0 - 1.0 / 0.9])
    np.testing.assert_allclose(backward[2:], 0.853)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name,kind\na,b", "needs the columns"),
        ("{head}\na,b,x,,,,c", "not a number"),
        ("{head}\na,b,nan,,,,c", "line 2: reduction: 'nan' is no finite number"),
        ("{head}\na,b,9,,,,", "the source"),
        ("{head}\na,b,9,,,,c\na,b,9,,,,c", "twice"),
    ],
)
def test_catalogues_that_cannot_be_trusted_are_named(
    text: str, message: str, tmp_path: Path
) -> None:
    head = "name,kind,reduction,forward_efficiency,backward_efficiency,gear_inertia,source"
    path = tmp_path / "own.csv"
    path.write_text(text.format(head=head))
    with pytest.raises(DesignError, match=message):
        read_gearboxes(path)
    with pytest.raises(DesignError, match="hd20_low"):
        choose_gearboxes("hd30", read_gearboxes())


def test_the_command_compares_gearboxes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["design", "planar_leg", "--gearbox", "all", "--json", "f.json"]) == 0
    shown = capsys.readouterr().out
    assert "direct_drive" in shown
    assert "sp100_mc_10: no source gives backward_efficiency" in shown
    found = json.loads(Path("f.json").read_text())
    assert all(box["source"] for box in found["gearboxes"])
    assert found["designs"] == len(found["gearboxes"])
    assert main(["list", "gearboxes"]) == 0
    assert "Matsuki" in capsys.readouterr().out
    assert main(["design", "planar_leg"]) == 2
    assert "varies at least one" in capsys.readouterr().err
