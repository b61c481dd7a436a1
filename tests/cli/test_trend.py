"""Fleets: a machine that drifts is told from those that scatter; each is diagnosed."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

import wbc.identification.trend.fleet as fleet_module
import wbc.identification.trend.sessions as stored
from wbc import load_robot, save_robot
from wbc.cli import main
from wbc.effects import CoulombFriction
from wbc.errors import LogError, ResultsError
from wbc.identification import Diagnosis, diagnose
from wbc.identification.answer.diagnosis import Estimate
from wbc.identification.model.estimation_problem import EstimationProblem
from wbc.identification.trend import Run, Trend, diagnose_fleet, find_runs, follow, read_index
from wbc.identification.trend.sessions import Session, SessionResult
from wbc.identification.trend.trend import WRONG, Points, fit_lines, no_chance
from wbc.measurement import Log, save_log
from wbc.results import read_results
from wbc.robot import Effect, Robot

SLOPE, SCATTER, INTERVAL = 0.02, 0.01, 0.004
DAYS = np.array([0.0, 7.0, 14.0, 21.0, 28.0])


def fleet(random: np.random.Generator, machines: int, drifting: int) -> dict[str, Points]:
    """Machines at levels of their own that scatter by more than their intervals."""
    found = {}
    for k in range(machines):
        value = 0.5 + 0.1 * random.standard_normal() + SCATTER * random.standard_normal(DAYS.size)
        value += INTERVAL * random.standard_normal(DAYS.size)
        value += SLOPE / 7.0 * DAYS * (k < drifting)
        found[f"m{k:02}"] = Points(DAYS, value, np.full(DAYS.size, INTERVAL))
    return found


def test_chance_is_called_a_drift_as_rarely_as_it_says() -> None:
    random = np.random.default_rng(1)
    wrong, found, scatters = 0, 0, []
    for _ in range(40):
        lines, scatter = fit_lines(fleet(random, 20, 0))
        wrong += any(no_chance([line.chance for line in lines.values()]))
        scatters.append(scatter)
        lines, _ = fit_lines(fleet(random, 20, 2))
        sure = no_chance([line.chance for line in lines.values()])
        found += sum(sure[:2])
    # 40 families at 5 %: 2 expected, standard deviation 1.4.
    assert wrong <= 40 * WRONG + 3.0 * 1.4
    assert found > 0.95 * 80
    assert np.mean(scatters) == pytest.approx(SCATTER, rel=0.1)


def test_two_sessions_are_too_few_and_one_date_has_no_slope() -> None:
    lines, scatter = fit_lines(
        {
            "a": Points(np.array([0.0, 9.0]), np.array([1.0, 2.0]), np.array([0.1, 0.1])),
            "b": Points(np.array([3.0]), np.array([1.0]), np.array([0.0])),
        }
    )
    assert np.isnan(lines["a"].chance)
    assert np.isinf(lines["b"].deviation)
    assert scatter == 0.0
    assert no_chance([np.nan, np.nan]) == [False, False]


def test_machine_and_date_are_read_from_names(tmp_path: Path) -> None:
    many = find_runs(["fleet/arm1/2026-03-01.csv", "fleet/arm2/walk_20260308T0930.csv"])
    assert [run.machine for run in many] == ["arm1", "arm2"]
    assert many[1].date == datetime(2026, 3, 8, 9, 30)
    one = find_runs(["logs/arm1_2026-03-01.csv", "logs/arm2_2026-03-08.csv"])
    assert [run.machine for run in one] == ["arm1", "arm2"]
    days = find_runs(["2026-03-01/arm1.csv", "2026-03-08/arm1.csv"])
    assert [run.machine for run in days] == ["arm1", "arm1"]
    with pytest.raises(LogError, match="--index"):
        find_runs(["run1.csv"])
    (tmp_path / "runs.csv").write_text("log,machine,date\na.csv,arm,2026-03-01\n")
    (run,) = read_index(tmp_path / "runs.csv")
    assert run.path == str(tmp_path / "a.csv")
    (tmp_path / "runs.csv").write_text("log,machine,date\na.csv,arm,yesterday\n")
    with pytest.raises(LogError, match="line 2: 'yesterday'"):
        read_index(tmp_path / "runs.csv")
    (tmp_path / "runs.csv").write_text("log,date\na.csv,2026-03-01\n")
    with pytest.raises(LogError, match="lacks the column machine"):
        read_index(tmp_path / "runs.csv")


@pytest.fixture(scope="module")
def logs(excited_log: Callable[..., object], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three machines, four weeks; the dry friction at the hip of one grows."""
    folder = tmp_path_factory.mktemp("fleet")
    random = np.random.default_rng(5)
    for number, growth in enumerate((0.0, 0.06, 0.0)):
        for week in range(4):
            level = 0.5 + growth * week + 0.01 * random.standard_normal()
            log = excited_log((CoulombFriction("hip", level),), 10 * number + week, 4.0)
            save_log(log, folder / f"leg{number}" / f"2026-03-{1 + 7 * week:02}.npz")
    robot = load_robot("planar_leg_fixed").lossless()
    save_robot(robot.with_effects(CoulombFriction("hip", 0.5)), folder / "fitted.toml")
    return folder


@pytest.fixture(scope="module")
def trend(logs: Path) -> Trend:
    paths = sorted(logs.glob("leg*/*.npz"))
    return follow(str(logs / "fitted.toml"), find_runs(paths))


def test_the_machine_that_drifts_is_named_with_its_change(trend: Trend) -> None:
    assert trend.to_json()["drifting"] == ["leg1"]
    friction = next(d for d in trend.drifting if d.quantity[0] == "coulomb_friction")
    assert friction.change == pytest.approx(0.18, abs=0.04)
    assert friction.name == "level of Coulomb friction at hip"
    assert trend.sentence.startswith("leg1 drifts (12 sessions of 3 machines).")
    first = trend.sessions[0].values[("coulomb_friction", "hip", "level")]
    assert first.low < first.value < first.high
    assert 0.45 < first.value < 0.55


def test_the_command_writes_table_plot_and_json_and_fails_on_drift(
    logs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    paths = [str(path) for path in sorted(logs.glob("leg1/*.npz"))]
    broken = tmp_path / "leg0" / "2026-04-01.npz"
    broken.parent.mkdir()
    broken.write_bytes(b"nothing")
    files = ["--json", str(tmp_path / "t.json"), "--png", str(tmp_path / "t.png")]
    robot = ["--robot", str(logs / "fitted.toml")]
    assert main(["trend", *paths, str(broken), *robot, "--fail-on-drift", *files]) == 4
    shown = capsys.readouterr().out
    assert "leg1 drifts" in shown
    assert "not measured: leg0 2026-04-01" in shown
    assert "no sure drift" in shown
    assert "stays" not in shown  # a change that may be chance is no promise of none
    assert len(shown.splitlines()) < 60
    content = json.loads((tmp_path / "t.json").read_text())
    assert content["drifting"] == ["leg1"]
    assert len(content["failures"]) == 1
    assert (tmp_path / "t.png").stat().st_size > 20_000


def test_any_error_of_one_session_is_a_row_of_it_alone(
    logs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    broken = EstimationProblem.from_logs

    def break_one(robot: Robot, given: Sequence[Log]) -> EstimationProblem:
        if "2026-03-08" in given[0].source.path:
            raise ZeroDivisionError("no samples")
        return broken(robot, given)

    monkeypatch.setattr(EstimationProblem, "from_logs", break_one)
    followed = follow(str(logs / "fitted.toml"), find_runs(sorted(logs.glob("leg1/*.npz"))))
    failures = [session.failure for session in followed.sessions]
    assert failures == ["", "ZeroDivisionError: no samples", "", ""]


def counted(session: Session) -> SessionResult:
    """Return the size of the first log; stands in for a measurement that takes its time."""
    size = float(Path(session.paths[0]).stat().st_size)
    values = {("", "hip", "rms error"): Estimate(size, "N m", size - 1.0, size + 1.0)}
    return SessionResult(session.machine, session.date, session.paths, values)


def test_a_table_grows_by_the_sessions_that_are_new_or_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Night after night the same command; what was measured once is not measured again."""
    monkeypatch.setattr(stored, "measure_session", counted)
    for number in range(12):
        log = tmp_path / f"leg{number % 3}" / f"2026-03-{1 + number // 3:02}.npz"
        log.parent.mkdir(exist_ok=True)
        log.write_bytes(bytes(100 + number))
    runs, path = find_runs(sorted(tmp_path.glob("leg*/*.npz"))), tmp_path / "grows.parquet"
    done: list[list[int]] = []

    def night(given: Sequence[Run], out: Path = path) -> Trend:
        done.append([])
        return follow(
            "planar_leg_fixed", given, out=out, watch=lambda count, total: done[-1].append(count)
        )

    night([run for run in runs if run.date.day < 3])  # two days of three machines
    night(runs[:-1])  # new days come between the rows that are there
    last = night(runs)
    assert done == [list(range(7)), list(range(6, 12)), [11, 12]]
    assert last.to_json() == night(runs, tmp_path / "whole.parquet").to_json()
    assert path.read_bytes() == (tmp_path / "whole.parquet").read_bytes()
    Path(runs[3].path).write_bytes(bytes(7))
    assert night(runs).sessions[3].values["", "hip", "rms error"].value == 7.0
    assert done[-1] == [11, 12]
    assert night(runs).sessions[3].values["", "hip", "rms error"].value == 7.0
    assert done[-1] == [12]


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
