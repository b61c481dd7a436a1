"""A machine that drifts is told from those that scatter."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

from tests.moved import swing
from wbc import load_robot, save_robot
from wbc.effects import CoulombFriction
from wbc.errors import LogError
from wbc.identification.trend import Trend, find_runs, follow, read_index
from wbc.identification.trend.trend import WRONG, Points, fit_lines, no_chance
from wbc.measurement import save_log

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
    with pytest.raises(LogError, match="read_index"):
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
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three machines, four weeks; the dry friction at the hip of one grows."""
    folder = tmp_path_factory.mktemp("fleet")
    random, robot = np.random.default_rng(5), load_robot("planar_leg_fixed").lossless()
    for number, growth in enumerate((0.0, 0.06, 0.0)):
        for week in range(4):
            level = 0.5 + growth * week + 0.01 * random.standard_normal()
            real = robot.with_effect(CoulombFriction("hip", level))
            log = swing(real, 10 * number + week, seconds=4.0)
            save_log(log, folder / f"leg{number}" / f"2026-03-{1 + 7 * week:02}.npz")
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
