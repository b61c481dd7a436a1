"""A machine that drifts is told from those that scatter."""

import json
from pathlib import Path

import numpy as np
import pytest

from sims.fleet import record_fleet
from tests.conftest import Told
from wbc import load_robot, save_robot
from wbc.effects import CoulombFriction
from wbc.errors import IdentificationError, LogError
from wbc.identification.trend import WRONG, Session, count_sure, find_sessions, fit_lines, follow

SLOPE, SCATTER, INTERVAL = 0.02, 0.01, 0.004
DAYS = np.array([0.0, 7.0, 14.0, 21.0, 28.0])


def judged(random: np.random.Generator, drifting: int) -> tuple[list[str], list[float]]:
    """Return which of 20 machines surely drift that scatter by more than their intervals."""
    points = {}
    for k in range(20):
        value = 0.5 + 0.1 * random.standard_normal() + SLOPE / 7.0 * DAYS * (k < drifting)
        value += np.hypot(SCATTER, INTERVAL) * random.standard_normal(DAYS.size)
        points[f"m{k:02}"] = np.array([DAYS, value, np.full(DAYS.size, INTERVAL)])
    lines = fit_lines(points)
    names = sorted(lines, key=lambda name: lines[name][2])
    sure = count_sure([lines[name][2] for name in names])
    return names[:sure], [line[1] for line in lines.values()]


def test_chance_is_called_a_drift_as_rarely_as_it_says() -> None:
    random, wrong, found, deviations = np.random.default_rng(1), 0, 0, []
    for _ in range(40):
        named, own = judged(random, 0)
        wrong, deviations = wrong + bool(named), deviations + own
        found += sum(name in ("m00", "m01") for name in judged(random, 2)[0])
    # 40 families at 5 %: 2 expected, standard deviation 1.4.
    assert wrong <= 40 * WRONG + 3.0 * 1.4
    assert found > 0.95 * 80
    expected = np.hypot(SCATTER, INTERVAL) / np.sqrt(np.sum((DAYS - DAYS.mean()) ** 2))
    assert np.mean(deviations) == pytest.approx(expected, rel=0.1)


def test_two_sessions_are_too_few() -> None:
    lines = fit_lines({"a": np.array([[0.0, 9.0], [1.0, 2.0], [0.1, 0.1]])})
    assert lines["a"][0] == pytest.approx(1.0 / 9.0)
    assert np.isnan(lines["a"][2])
    assert count_sure([np.nan, np.nan]) == 0
    # A number that is zero throughout, without an interval, changes by nothing.
    nothing = fit_lines({"a": np.array([DAYS, 0.0 * DAYS, 0.0 * DAYS])})
    assert nothing["a"][0] == 0.0
    assert nothing["a"][2] == pytest.approx(1.0)


def test_machine_and_date_are_read_from_names() -> None:
    many = find_sessions(["fleet/arm2/walk_20260308T0930.csv", "fleet/arm1/2026-03-01.csv"])
    assert [session.machine for session in many] == ["arm1", "arm2"]
    assert many[1].date == "2026-03-08T09:30:00"
    one = find_sessions(["logs/arm1_2026-03-01.csv", "logs/arm2_2026-03-08.csv"])
    assert [session.machine for session in one] == ["arm1", "arm2"]
    (both,) = find_sessions(["2026-03-01/arm1.csv", "2026-03-01/arm1.npz"])
    assert (both.machine, both.logs) == ("arm1", ("2026-03-01/arm1.csv", "2026-03-01/arm1.npz"))
    for name in ("run1.csv", "2026-02-31.csv"):
        with pytest.raises(LogError, match=f"'{name}': no date"):
            find_sessions([name])


def test_the_machine_that_drifts_is_named_and_what_fails_is_a_session(
    tmp_path: Path, told: Told
) -> None:
    logs = record_fleet(tmp_path, 2.5)
    broken = tmp_path / "leg_1" / "2026-04-01.npz"
    broken.write_bytes(b"nothing")
    leg = load_robot("planar_leg_fixed").lossless().with_effect(CoulombFriction("hip", 0.3))
    robot = save_robot(leg, tmp_path / "fitted.toml")
    files = ["--json", tmp_path / "trend.json", "--figures", tmp_path]
    said = told("trend", *logs, broken, "--robot", robot, "--fail-on-drift", *files, code=4)
    assert "leg_2 drifts (sessions: 8, machines: 2). Surest: level of Coulomb friction" in said
    assert "not measured: leg_1 2026-04-01T00:00:00: LogError" in said
    assert "no sure drift" in said
    assert (tmp_path / "trend.png").stat().st_size > 20_000
    found = json.loads((tmp_path / "trend.json").read_text())
    friction = found["drifting"][0]
    assert friction["quantity"] == "level of Coulomb friction at hip"
    assert friction["change"] == pytest.approx(0.15, abs=0.01)
    assert [bool(session["failure"]) for session in found["sessions"]].count(True) == 1
    with pytest.raises(IdentificationError, match="no session can be measured"):
        follow(leg, [Session("leg_1", "2026-04-01", (str(broken),))])
