"""Many experiments at once: a table, a failure, and the command."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from wbc.cli import main
from wbc.design.experiment import (
    Aim,
    ExperimentTask,
    MotionLimits,
    design_experiment,
    informing,
    plan_experiments,
    read_path,
)
from wbc.results import read_results

CAUSES = ("viscous_friction@knee", "coulomb_friction@knee", "payload_mass@shin")
SETTINGS = {"lossless": True, "duration": 1.0, "rounds": 1, "speed": 6.0, "span": 1.0}


def tasks() -> list[ExperimentTask]:
    """Two pairs on the leg, of which no motion tells the second apart, and another robot."""
    leg = [
        ExperimentTask("planar_leg_fixed", pair, **SETTINGS)  # type: ignore[arg-type]
        for pair in (CAUSES[:2], ("position_offset@hip", "gravity_direction@robot"))
    ]
    slide = ("viscous_friction@slide", "coulomb_friction@slide")
    return [*leg, ExperimentTask("emps", slide, noise=1.0, duration=1.0, rounds=1, span=0.1)]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The table of all tasks."""
    with pytest.MonkeyPatch.context() as quicker:
        quicker.setattr("wbc.design.experiment.task._RANDOM", 3)
        return plan_experiments(tasks(), tmp_path_factory.mktemp("plans") / "x.parquet")


def test_each_row_is_what_one_plan_gives_and_a_failure_stays_alone(whole: Path) -> None:
    rows = read_results(whole)
    assert [bool(text) for text in rows["failure"]] == [False, True, False]
    assert np.isnan(rows["log10_odds_designed"][1])
    assert rows["robot"] == ["planar_leg_fixed"] * 2 + ["emps"]
    task = tasks()[0]
    robot = task.loaded()
    rivals, limits = task.rivals(robot), MotionLimits.of(robot, 1.0, 6.0)
    classic = design_experiment(rivals, limits, 1.0, rounds=1, aim=Aim(informing.value))
    alone = design_experiment(rivals, limits, 1.0, rounds=1, starts=[classic.path])
    np.testing.assert_array_equal(read_path(rows["path"][0]).sine, alone.path.sine)
    assert rows["log10_odds_designed"][0] == pytest.approx(alone.worst / np.log(10.0))


def test_the_command_plans_every_pair(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("wbc.design.experiment.task._RANDOM", 3)  # quicker
    command = "experiment planar_leg_fixed --lossless --each --duration 1 --speed 6 --rounds 1"
    options = ["--out", "plans.parquet", "--json", "plans.json", "--between", *CAUSES]
    assert main([*command.split(), *options]) == 0
    shown = capsys.readouterr().out
    assert shown.count("friction@knee") == 4
    files = [f"plans_{k}.csv" for k in (1, 2, 3)]
    for file in files:
        assert file in shown.replace("\n", "")
        assert len(np.genfromtxt(file, delimiter=",", names=True)) == 101
    assert len(json.loads(Path("plans.json").read_text())["causes"]) == 3
    assert main([*command.split(), "--between", CAUSES[0]]) == 2
    assert "another cause" in capsys.readouterr().err
    assert main([*command.split(), "--out", "x.csv", "--between", *CAUSES]) == 2
    assert "end in .parquet" in capsys.readouterr().err
