"""A fleet is diagnosed machine by machine: a row each, also for one that fails or was killed."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

import wbc.identification.trend.fleet as fleet_module
from wbc.cli import main
from wbc.effects import CoulombFriction
from wbc.errors import ResultsError
from wbc.identification import Diagnosis, diagnose
from wbc.identification.trend import diagnose_fleet, read_index
from wbc.measurement import Log, save_log
from wbc.results import read_results
from wbc.robot import Effect, Robot

ADD = ("coulomb_friction", "viscous_friction")
ROBOT = {"robot": "planar_leg_fixed", "lossless": True, "candidates": ADD}


@pytest.fixture(scope="module")
def index(excited_log: Callable[..., Log], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three machines: one rubs at the hip, one at the knee, one log is no log."""
    folder = tmp_path_factory.mktemp("fleet")
    lines = ["log,machine,date"]
    for number, joint in enumerate(("hip", "knee")):
        log = excited_log((CoulombFriction(joint, 0.5),), number, 3.0)
        save_log(log, folder / f"leg{number}.npz")
        lines.append(f"leg{number}.npz,leg{number},2026-03-01")
    (folder / "leg2.npz").write_bytes(b"nothing")
    lines.append("leg2.npz,leg2,2026-03-01")
    (folder / "runs.csv").write_text("\n".join(lines))
    return folder / "runs.csv"


def test_the_command_writes_a_row_per_machine(
    index: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, told = tmp_path / "fleet.parquet", tmp_path / "fleet.json"
    words = ["diagnose", "--fleet", str(index), "--out", str(out), "--json", str(told)]
    robot = ["--robot", "planar_leg_fixed", "--lossless", "--add", ",".join(ADD)]
    assert main([*words, *robot]) == 1  # leg2 has no answer
    shown = capsys.readouterr().out
    assert "3 log sets: 2 named, 1 not diagnosed." in shown
    assert "not diagnosed: leg2" in shown
    table = read_results(out)
    assert table["machine"] == ["leg0", "leg1", "leg2"]
    assert table["verdict"] == ["named", "named", ""]
    assert table["causes"][0].startswith("coulomb_friction at hip, probability 1.00")
    assert table["causes"][1].startswith("coulomb_friction at knee, probability 1.00")
    assert table["before.hip"][0] == pytest.approx(0.5, rel=0.2)  # [N m], the friction
    assert table["after.hip"][0] < 0.05
    assert table["before.hip"][2] != table["before.hip"][2]  # NaN: nothing is known
    assert json.loads(table["diagnosis"][0])["effects"][0]["where"] == ["hip"]
    assert json.loads(told.read_text())["verdicts"] == {"named": 2}


def test_a_killed_run_goes_on_and_any_error_is_a_row(
    index: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = []

    def broken(robot: Robot, logs: Sequence[Log], classes: Sequence[type[Effect]]) -> Diagnosis:
        calls.append(logs[0].source.path)
        if "leg1" in logs[0].source.path:
            raise FloatingPointError("not ours")
        return diagnose(robot, logs, classes)

    def stop(done: int, total: int) -> None:
        if done == 2:
            raise KeyboardInterrupt

    monkeypatch.setattr(fleet_module, "diagnose", broken)
    runs, killed = read_index(index), tmp_path / "killed.parquet"
    with pytest.raises(KeyboardInterrupt):
        diagnose_fleet(runs=runs, out=killed, watch=stop, **ROBOT)  # type: ignore[arg-type]
    assert not killed.exists()
    seen: list[int] = []
    fleet = diagnose_fleet(
        runs=runs,
        out=killed,
        watch=lambda done, total: seen.append(done),
        **ROBOT,  # type: ignore[arg-type]
    )
    assert seen == [2, 3]
    assert len(calls) == 2  # each machine once; the log of leg2 cannot be read
    assert [machine.verdict for machine in fleet.machines] == ["named", "", ""]
    assert fleet.machines[1].failure == "FloatingPointError: not ours"
    whole = diagnose_fleet(runs=runs, out=tmp_path / "whole.parquet", **ROBOT)  # type: ignore[arg-type]
    assert whole.path.read_bytes() == killed.read_bytes()
    with pytest.raises(ResultsError, match="other work"):
        diagnose_fleet("planar_leg_fixed", runs, killed)
